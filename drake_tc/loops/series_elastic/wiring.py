"""`add_series_elastic_loop`: torque control of voltage-driven series-elastic joints around a plant, in one call.

reference torque --> torque_control --> loop_delay --> actuators (motors, gears, springs) --> plant
^                                |
|--- motor_encoder, torque ------|

`series_elastic_controller`: the same torque control as a Diagram without a plant, from readings to voltages. Both are
wired by `add_series_elastic_control`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import Trajectory

from drake_tc.actuation.joint_effects import Models, model_list
from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.actuation.wiring import actuated_joints, add_actuators
from drake_tc.control.series_elastic import SeriesElasticControl
from drake_tc.loops.built_loop import ControlledJoints, Controller, WiredLoop, add_input
from drake_tc.loops.loop_builder import LoopBuilder, behind, late, product
from drake_tc.loops.plant import require_fitting_plant
from drake_tc.loops.series_elastic.scenario import SeriesElasticLoopSpec, spring_compliance
from drake_tc.sensing.sensor import Sensor
from drake_tc.sensing.suite import sensor_seed

OUTPUTS = {"voltage": "voltage", "friction": "friction", "shaped_reference": "shaped_reference", "flags": "fault"}
"""Signals of the loop to the ports of the torque control that they are."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SeriesElasticLoop(WiredLoop):
    """A series-elastic torque loop in a diagram; n joints.

    Stages: `torque_control`, `motor_encoder`, `link_encoder`, `torque_sensor`, `actuators`. Signals, n values each
    where nothing else is said: `link_state` and `motor_state` (2n), `spring_torque`, `measured_torque`, `voltage`,
    `friction_torque`, the readings of the sensors, and more; `flags`: an input of the torque control was not finite.

    Attributes:
        actuators: Motors, gears and springs.
    """

    actuators: ActuatorPlant


def add_series_elastic_loop(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    models: Models,
    reference_torque: OutputPort | Trajectory | None = None,
    spec: SeriesElasticLoopSpec | None = None,
    *,
    controller_models: Models | None = None,
    reference_acceleration: OutputPort | None = None,
    stages: Mapping[str, System] | None = None,
) -> SeriesElasticLoop:
    """Add motors, springs, sensors and torque control to a plant whose joints are all actuated, and connect them.

    Args:
        builder: Holds `plant`.
        plant: Finalized plant with live ports.
        models: Of the simulated drives: voltage drives with an elasticity, by joint or in the order of the plant.
        reference_torque: (n) of the springs [N m]; None: the user connects the port of `systems["torque_control"]`.
        spec: How the loop is controlled; None: the defaults.
        controller_models: What the controller takes the drives for; None: what they are.
        reference_acceleration: (n) of the links [rad/s^2]; None: as `reference_torque`, or 0.
        stages: Stage to a system of your own in its place, as in `add_torque_loop`.

    Raises:
        ParamsError: a plant that is not finalized or whose ports are sampled, a model without spring, or a stage or
            place that the loop does not have.

    Example:
        >>> models = load_models(MODELS / "coman_like" / "coman_like_actuators.yaml")
        >>> builder = DiagramBuilder()
        >>> plant = add_robot_plant(builder, load_robot(MODELS / "coman_like" / "coman_like.yaml"))
        >>> loop = add_series_elastic_loop(builder, plant, models)
        >>> loop.signals["voltage"].size() == plant.num_actuators()
        True
    """
    spec = SeriesElasticLoopSpec() if spec is None else spec
    require_fitting_plant(plant, spec.dt)
    joints = actuated_joints(plant)
    assumed = list(model_list(models if controller_models is None else controller_models, joints))
    loop = LoopBuilder(builder, spec, plant, spec.dt, stages=stages or {})
    simulated = dict(zip(joints, model_list(models, joints), strict=True))
    actuators = add_actuators(builder, plant, simulated, plant.time_step() or spec.dt)
    loop.systems["actuators"] = actuators
    state = plant.get_state_output_port()
    if builder.HasSubsystemNamed("joint_state"):
        state = builder.GetSubsystemByName("joint_state").get_output_port(0)
    loop.signals |= {
        "link_state": state,
        "motor_state": actuators.GetOutputPort("motor_state"),
        "spring_torque": actuators.GetOutputPort("transmitted_torque"),
    }
    _add_sensors(loop, len(assumed))
    voltage = add_series_elastic_control(loop, assumed, reference_torque, reference_acceleration)
    ticks = round(spec.delay / spec.dt)
    builder.Connect(late(builder, voltage, spec.dt, ticks), actuators.GetInputPort("command"))
    loop.signals["friction_torque"] = actuators.GetOutputPort("friction_torque")
    flags = tuple(f"torque_control/{joint}" for joint in joints) if "flags" in loop.signals else ()
    return SeriesElasticLoop(
        systems=loop.systems, signals=loop.signals, period=spec.dt, flag_names=flags, actuators=actuators
    )


def add_series_elastic_control(
    loop: LoopBuilder[SeriesElasticLoopSpec],
    models: list[ActuatorModel],
    reference_torque: OutputPort | Trajectory | None,
    reference_acceleration: OutputPort | None,
) -> OutputPort:
    """The torque control between the readings and the voltages, connected: of a simulated loop as of a robot.

    Args:
        loop: With the signals `motor_encoder`, and `torque_sensor` or `link_encoder` as `torque_from` says.
        models: What the controller takes the drives for.
        reference_torque: (n) of the springs [N m]; None leaves the port open.
        reference_acceleration: (n) of the links [rad/s^2]; None leaves the port open.

    Returns:
        The voltages (n) [V].

    Raises:
        ParamsError: a model without spring, or a stage or place that the controller does not have.
    """
    spec, builder = loop.scenario, loop.builder
    torque = loop.signals["torque_sensor"] if spec.torque_from == "gauge" else _deflection_torque(loop, models)
    loop.add(
        "torque_control",
        lambda: SeriesElasticControl(spec.control, models, spec.dt),
        motor_angle=loop.signals["motor_encoder"],
        torque=torque,
    )
    voltage = loop.output("torque_control", "voltage")
    if isinstance(reference_torque, Trajectory):
        reference_torque = behind(builder, "reference", TrajectorySource(reference_torque))
    for name, port in (("reference_torque", reference_torque), ("reference_acceleration", reference_acceleration)):
        if port is not None:
            loop.connect("torque_control", name, loop.passed(name, port))
            loop.signals[name] = port
    control = loop.systems["torque_control"]
    loop.signals |= {
        name: loop.output("torque_control", port) for name, port in OUTPUTS.items() if control.HasOutputPort(port)
    }
    loop.signals["measured_torque"] = torque
    loop.check_own_systems()
    return voltage


def _add_sensors(loop: LoopBuilder[SeriesElasticLoopSpec], n: int) -> None:
    """Encoders before and after the springs and the gauges of n joints."""
    spec, builder = loop.scenario, loop.builder
    for name, source, sensor in (
        ("motor_encoder", "motor_state", spec.sensors.motor_encoder),
        ("link_encoder", "link_state", spec.sensors.link_encoder),
        ("torque_sensor", "spring_torque", spec.sensors.torque),
    ):
        port = loop.signals[source]
        if port.size() == 2 * n:
            port = product(builder, f"{name}_angle", np.eye(n, 2 * n), port)
        loop.add(name, Sensor(n, sensor, spec.dt, (), sensor_seed(spec.seed, name)), truth=port)
        loop.signals[name] = loop.output(name, "reading")


def _deflection_torque(loop: LoopBuilder[SeriesElasticLoopSpec], models: list[ActuatorModel]) -> OutputPort:
    """(n) torques of the springs by the encoders before and behind them [N m]."""
    stiffness = np.diag([1.0 / spring_compliance(model) for model in models])
    encoders = loop.join("encoders", [loop.signals["motor_encoder"], loop.signals["link_encoder"]])
    return product(loop.builder, "deflection_torque", np.hstack((stiffness, -stiffness)), encoders)


INPUTS = {"motor_encoder": "motor_position", "torque_sensor": "spring_torque", "link_encoder": "position"}
"""Signal of the loop to the input port that brings it."""


def series_elastic_controller(
    joints: Sequence[str],
    models: Models,
    torque: Trajectory | Literal["input"] = "input",
    spec: SeriesElasticLoopSpec | None = None,
    *,
    accelerated: bool = False,
    stages: Mapping[str, System] | None = None,
    fused: bool = False,
) -> Controller:
    """The torque control of voltage-driven series-elastic joints as a Diagram from readings to commands.

    Input ports of the Diagram, each read every `spec.dt`:
        motor_position (n): before the springs [rad].
        spring_torque (n): of the gauges [N m]; with `spec.torque_from: gauge`.
        position (n): behind the springs [rad]; without gauges.
        reference_torque (n): of the springs [N m]; with `torque` "input".
        reference_acceleration (n): of the links [rad/s^2]; with `accelerated`.
    Output ports of the Diagram:
        command (n): voltages [V], before any delay.
        and the signals of the torque control: `measured_torque`, `friction`, `flags`, ...

    Args:
        joints: Names, in the order of the ports.
        models: What the controller takes the drives for, by joint or in that order.
        torque: What the springs shall carry (n) over time [N m]; "input": what the input port says.
        spec: How the joints are controlled; None: the defaults. Its `delay` and `sensors` are those of a simulation and
            are not used.
        accelerated: Whether there is an input port for the accelerations of the links.
        stages: Stage to a system of your own in its place, as in `add_torque_loop`.
        fused: Run the stages in one system, which gives the same numbers in less time.

    Raises:
        ParamsError: a model without spring, or a stage or place that the controller does not have.

    Example:
        >>> models = load_models(MODELS / "coman_like" / "coman_like_actuators.yaml")
        >>> controller = series_elastic_controller(list(models), models)
        >>> controller.GetOutputPort("command").size() == len(models)
        True
    """
    spec, builder, n = SeriesElasticLoopSpec() if spec is None else spec, DiagramBuilder(), len(joints)
    assumed = list(model_list(models, tuple(joints)))
    loop = LoopBuilder(builder, spec, None, spec.dt, stages=stages or {})
    read = ("motor_encoder", "torque_sensor" if spec.torque_from == "gauge" else "link_encoder")
    loop.signals |= {name: add_input(builder, INPUTS[name], n) for name in read}
    left_out = [*read, *(("reference_torque",) if torque == "input" else ()), "reference_acceleration"]
    voltage = add_series_elastic_control(
        loop,
        assumed,
        torque if isinstance(torque, Trajectory) else add_input(builder, "reference_torque", n),
        add_input(builder, "reference_acceleration", n) if accelerated else None,
    )
    flags = tuple(f"torque_control/{joint}" for joint in joints) if "flags" in loop.signals else ()
    nowhere = np.full(n, np.inf)
    controlled = ControlledJoints(
        joints=tuple(joints),
        servo=(False,) * n,
        lower=-nowhere,
        upper=nowhere,
        period=spec.dt,
        flag_names=flags,
        inputs=left_out,
    )
    signals = loop.signals | {"command": voltage}
    return Controller(builder, "series_elastic_controller", controlled, signals, fused=fused)
