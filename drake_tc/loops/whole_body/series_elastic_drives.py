"""Series-elastic drives under the controller (Faraji et al., 2015): torque control, voltage, springs.

torque (- damping) --> torque_control --> loop_delay --> actuators (motors, gears, springs) --> plant
                          ^ motor_encoder, torque_gauge --------|

With a `position_gain` position_control around the motors' own encoders takes the place of torque_control.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import OutputPort
from pydrake.systems.primitives import ConstantVectorSource, LinearSystem

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.actuation.wiring import add_actuators, joint_inertias
from drake_tc.control.series_elastic import MotorPositionControl, SeriesElasticControl
from drake_tc.errors import ParamsError
from drake_tc.estimation.link_position import LinkPosition, spring_times
from drake_tc.loops.built_loop import Start
from drake_tc.loops.fused import StageValues
from drake_tc.loops.loop_builder import behind, late, picked, product, total
from drake_tc.loops.scenarios import erring
from drake_tc.loops.whole_body.sensors import WholeBodyBuilder, required_models
from drake_tc.sensing.sensor import Sensor
from drake_tc.sensing.suite import sensor_seed
from drake_tc.types import FloatArray

_SPRING = "elasticity"


@dataclass(frozen=True, eq=False)
class SpringReadings:
    """What is read of the springs, joint by joint.

    Attributes:
        motor_angle: Encoders before the springs [rad].
        torque: Gauges [N m].
    """

    motor_angle: OutputPort
    torque: OutputPort


@dataclass(frozen=True, eq=False)
class SpringCommand:
    """What leaves the torque control of springs.

    Attributes:
        voltage: Of the motors (n) [V].
        torque: What the springs shall carry (n) [N m].
        held: The constant angles at which `position_gain` holds the motors; None with torque control.
    """

    voltage: OutputPort
    torque: OutputPort
    held: Any = None


def check_springs(models: Mapping[str, ActuatorModel], source: str = "models") -> None:
    """Every joint has a voltage drive behind a spring.

    Raises:
        ParamsError: one has not.
    """
    for joint, model in models.items():
        if model.drive.kind != "voltage" or all(value.key != _SPRING for value in model.effects):
            raise ParamsError(
                f"{source}: {joint}: expected a voltage drive and an elasticity; the model lacks one of them"
            )


def add_spring_drives(wiring: WholeBodyBuilder, plant: MultibodyPlant) -> tuple[ActuatorPlant, SpringReadings]:
    """Motors, gears and springs in front of the plant, with the sensors on both sides of the springs.

    Args:
        wiring: Of the diagram.
        plant: In the diagram.

    Raises:
        ParamsError: see `check_springs`.
    """
    spec, n, builder = wiring.scenario.series_elastic, wiring.law.model.n, wiring.builder
    models = required_models(wiring, "models")
    check_springs(models)
    actuators = add_actuators(builder, plant, models, plant.time_step() or wiring.law.period)
    wiring.systems["actuators"] = actuators
    angle = product(builder, "motor_angle", np.eye(n, 2 * n), actuators.GetOutputPort("motor_state"))
    readings = []
    for name, truth, sensor in (
        ("motor_encoder", angle, spec.motor_encoder),
        ("torque_gauge", actuators.GetOutputPort("transmitted_torque"), spec.gauge),
    ):
        seed = sensor_seed(wiring.scenario.seed, name)
        system = wiring.add(name, Sensor(n, sensor, wiring.law.period, (), seed), truth=truth)
        readings.append(system.GetOutputPort("reading"))
    return actuators, SpringReadings(*readings)


def controller_springs(wiring: WholeBodyBuilder) -> tuple[FloatArray, FloatArray]:
    """(n,) compliances [rad/(N m)] and (n,) damping over stiffness [s] of the springs, as the controller takes them."""
    assumed = _assumed(wiring)
    compliance = np.array(
        [value.parameters["compliance"] for model in assumed for value in model.effects if value.key == _SPRING]
    )
    motors = np.array([model.inertia for model in assumed])
    return compliance, spring_times(compliance, motors, joint_inertias(wiring.known_plant))


def link_position(wiring: WholeBodyBuilder, springs: SpringReadings, encoder: OutputPort) -> OutputPort:
    """(n,) position of the links [rad]: the fine encoders less the springs, or that of the coarse ones.

    Args:
        wiring: Of the diagram.
        springs: Their readings.
        encoder: Behind the springs.
    """
    if wiring.scenario.series_elastic.link_from == "link":
        return encoder
    compliance, times = controller_springs(wiring)
    system = LinkPosition(compliance, times, wiring.law.period)
    wiring.add("link_position", system, motor_angle=springs.motor_angle, torque=springs.torque)
    port: OutputPort = system.GetOutputPort("position")
    return port


def control_springs(wiring: WholeBodyBuilder, springs: SpringReadings, torque: OutputPort) -> SpringCommand:
    """Torque control between the controller's torque and the drives' voltages.

    Args:
        wiring: Of the diagram.
        springs: Their readings.
        torque: What is desired of the joints.
    """
    spec = wiring.scenario.series_elastic
    if spec.position_gain > 0.0:
        voltage, held = _hold_motors(wiring, springs)
        command = SpringCommand(voltage, torque, held)
    else:
        if spec.joint_damping > 0.0:
            torque = _damped(wiring, torque)
        command = SpringCommand(_track_torque(wiring, springs, torque), torque)
    wiring.signals["voltage"] = command.voltage
    return command


def drive_springs(wiring: WholeBodyBuilder, actuators: ActuatorPlant, command: SpringCommand) -> Start:
    """Let the voltages drive the simulated motors, after the delay of the loop.

    Args:
        wiring: Of the diagram.
        actuators: From `add_spring_drives`.
        command: From `control_springs`.

    Returns:
        What winds the springs for the torque that the controller wants first, as a robot that has stood for long has
        them, under the voltage that keeps them so.

    Raises:
        ParamsError: times that are no whole number of the controller's periods.
    """
    spec, law, builder = wiring.scenario.series_elastic, wiring.law, wiring.builder
    ticks = spec.ticks(law.period)
    voltage = late(builder, command.voltage, law.period, ticks)
    delay: Any = voltage.get_system()
    builder.Connect(voltage, actuators.GetInputPort("command"))
    wiring.signals["applied_torque"] = actuators.GetOutputPort("transmitted_torque")
    gains = np.array([model.drive.gain for model in required_models(wiring, "models").values()])

    def start(values: StageValues) -> None:
        first = values.output(command.torque)
        rest = gains * first
        if ticks:
            values.set_state(delay, np.tile(rest, ticks))
        _wind(actuators, values, first, rest)
        if command.held is not None:
            angle = values.output(actuators.GetOutputPort("motor_state"))
            source = command.held.get_mutable_source_value(values.context_of(command.held))
            source.SetFromVector(angle[: law.model.n] + first / spec.position_gain)

    return start


def _assumed(wiring: WholeBodyBuilder) -> list[ActuatorModel]:
    """What the controller takes the drives for."""
    factors = wiring.scenario.series_elastic.model_factors
    return erring(required_models(wiring, "models").values(), factors, "series_elastic.model_factors")


def _track_torque(wiring: WholeBodyBuilder, springs: SpringReadings, torque: OutputPort) -> OutputPort:
    """The voltages of the torque law, connected."""
    spec = wiring.scenario.series_elastic
    inputs = {"motor_angle": springs.motor_angle, "torque": springs.torque, "reference_torque": torque}
    if spec.acceleration_bandwidth > 0.0:
        inputs["reference_acceleration"] = _desired_acceleration(wiring, spec.acceleration_bandwidth)
    assumed = _assumed(wiring)
    wiring.add("torque_control", lambda: SeriesElasticControl(spec.control, assumed, wiring.law.period), **inputs)
    return wiring.output("torque_control", "voltage")


def _hold_motors(wiring: WholeBodyBuilder, springs: SpringReadings) -> tuple[OutputPort, Any]:
    """Voltages of position loops around the motors, and the constant angles at which they are held, not yet known."""
    spec, n = wiring.scenario.series_elastic, wiring.law.model.n
    nothing: Any = np.zeros(n)
    held = wiring.builder.AddNamedSystem("held_angle", ConstantVectorSource(nothing))
    loops = MotorPositionControl(spec.position_gain, _assumed(wiring))
    inputs = {"motor_angle": springs.motor_angle, "reference_angle": held.get_output_port()}
    wiring.add("position_control", loops, **inputs)
    return wiring.output("position_control", "voltage"), held


def _damped(wiring: WholeBodyBuilder, torque: OutputPort) -> OutputPort:
    """(n,) torque less damping times the joints' velocities [N m], as far as the controller knows these."""
    model, builder, spec = wiring.law.model, wiring.builder, wiring.scenario.series_elastic
    joints = model.robot.joints
    if strange := sorted(set(spec.damped_joints) - set(joints)):
        raise ParamsError(f"series_elastic.damped_joints: no joint {strange[0]!r}; there: {', '.join(joints)}")
    chosen = np.array([not spec.damped_joints or joint in spec.damped_joints for joint in joints])
    state = wiring.signals["estimated_state" if "estimated_state" in wiring.signals else "state"]
    against = np.zeros((model.n, state.size()))
    against[np.arange(model.n), model.nq + model.actuated] = np.where(chosen, -spec.joint_damping, 0.0)
    damped = total(builder, "damped_torque", torque, product(builder, "joint_damping", against, state))
    wiring.signals["damped_torque"] = damped
    return damped


def _desired_acceleration(wiring: WholeBodyBuilder, bandwidth: float) -> OutputPort:
    """(n,) of the links, as the controller expects them [rad/s^2], through a low pass of `bandwidth` [rad/s]."""
    law, builder = wiring.law, wiring.builder
    acceleration = wiring.output("tsid", "acceleration")
    places = {"joints": law.model.actuated.tolist()}
    desired = picked(builder, "desired_acceleration", acceleration, places)["joints"]
    share, one = -np.expm1(-bandwidth * law.period), np.eye(law.model.n)
    a: Any = (1.0 - share) * one
    b: Any = share * one
    c: Any = one
    d: Any = 0.0 * one
    return behind(builder, "smooth_acceleration", LinearSystem(a, b, c, d, law.period), desired)


def _wind(actuators: ActuatorPlant, values: StageValues, torque: FloatArray, voltage: FloatArray) -> None:
    """Give the actuators the memory of joints that have carried `torque` (n,) under `voltage` (n,) for one step."""
    alone: Any = actuators.CreateDefaultContext()
    state = values.input(actuators, "state")
    for name, value in (("command", voltage), ("state", state), ("load_torque", torque)):
        actuators.GetInputPort(name).FixValue(alone, value)
    step: Any = actuators.GetOutputPort("step").Eval(alone)
    kinds = step.size - alone.get_discrete_state(0).size()
    values.set_state(actuators, step[kinds:])
