"""The stages between reference and guard, each a system, wired for one robot.

`TorqueLoopBuilder`: what the stages of the torque loop share while it is being wired.

Ports of the torque loop made of others: zeroed F/T readings, the base's motion without delay.

The stages that undo delay and disturbance: model filter, disturbance observer, delay predictor.

What a scenario comes to before anything is wired: robot, actuators, gains.

`LoopDesign`: what a torque loop is wired from, of a scenario or of a diagram of the user's own.

`sliding_scenario`: its drives in sliding, where friction is linear, which is what a linear analysis takes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydrake.systems.framework import OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.model_file import ModelFile, models_of_joints
from drake_tc.actuation.wiring import sliding
from drake_tc.control.dynamics_terms import BaseRotation
from drake_tc.control.gains import TorqueGains
from drake_tc.control.guard import CommandGuard, rated_guard
from drake_tc.control.inverse_dynamics import InverseDynamics, MotionSources
from drake_tc.control.torque_control import TorqueControl
from drake_tc.errors import ParamsError
from drake_tc.estimation.disturbance_observer import DelayPredictor, DisturbanceObserver, ObserverSpec
from drake_tc.estimation.joint_torque import JointTorqueEstimator, WrenchTare
from drake_tc.estimation.torque_model import BaseSource, TorqueModel
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.loops.loop_builder import LoopBuilder, behind, first_imu, picked, product, split, total
from drake_tc.loops.scenarios import ModelFactors, erring
from drake_tc.loops.torque.references import posture
from drake_tc.loops.torque.scenario import Scenario, TorqueLoopSpec, base_source, loop_spec, sensor_suite
from drake_tc.robot.link_changes import link_changes
from drake_tc.robot.plant import check_joint_types, joint_limits
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.sensing.suite import Readings
from drake_tc.sensor_validation.fault_monitor import FaultMonitor
from drake_tc.types import FloatArray


@dataclass
class TorqueLoopBuilder(LoopBuilder[TorqueLoopSpec]):
    """The torque loop under construction.

    Attributes:
        robot: Of the loop.
        readings: Of its sensors.
        models: The drives as the controller takes them, in the order of the joints.
        gains: Feedback gains.
        force_reference: (6k) f_d at the contacts; None: no contact force is commanded.
    """

    robot: Robot = field(kw_only=True)
    readings: Readings = field(kw_only=True)
    models: list[ActuatorModel] = field(kw_only=True)
    gains: TorqueGains = field(kw_only=True)
    force_reference: OutputPort | None = None

    @property
    def base_from(self) -> BaseSource:
        """Where the motion of the base comes from."""
        return base_source(self.scenario, self.robot)

    @property
    def controller_robot(self) -> Robot:
        """The robot as estimator and controller take it: with `base_from: fixed` a floating base counts as fixed."""
        return replace(self.robot, fixed_base=True) if self.base_from == "fixed" else self.robot


def zeroed(parts: TorqueLoopBuilder, name: str, wrench: OutputPort) -> OutputPort:
    """F/T readings less the bias that the tare has found, by blocks of Drake's own: no call into Python."""
    builder, size = parts.builder, wrench.size()
    if not builder.HasSubsystemNamed("wrench_correction"):
        memory = builder.GetSubsystemByName("wrench_tare").GetOutputPort("memory")  # [bias; count]
        product(builder, "wrench_correction", -np.eye(size, size + 1), memory)
    return total(builder, name, wrench, builder.GetSubsystemByName("wrench_correction").get_output_port(0))


def base_now(parts: TorqueLoopBuilder) -> OutputPort:
    """The IMU and its derivative at the end of the window: without delay, with twice the noise and more."""
    if parts.builder.HasSubsystemNamed("base_now"):
        made: OutputPort = parts.builder.GetSubsystemByName("base_now").GetOutputPort("imu_estimate")
        return made
    window, order = parts.scenario.filters.window, parts.scenario.filters.encoder_order
    smooth = SavitzkyGolayFilter(6, window, order, parts.scenario.dt, window - 1)
    imu: Any = parts.readings.imu
    parts.add("base_predictor", smooth, signal=first_imu(parts.builder, imu))
    requested = {"imu_estimate": list(range(12))}
    return picked(parts.builder, "base_now", smooth.GetOutputPort("estimate"), requested)["imu_estimate"]


class Prediction(NamedTuple):
    """What is known of the joints now, for inverse dynamics and torque control.

    Attributes:
        delayed: `joint_estimate`, `estimated_torque` and `position` as filters, estimator and encoders have them.
        known: The same ports, predicted where the scenario has a predictor, with `disturbance` where it has an
            observer.
        observer: Which both need, to be connected later; None where there is neither.
    """

    delayed: Mapping[str, OutputPort]
    known: Mapping[str, OutputPort]
    observer: DisturbanceObserver | None = None


def prediction(parts: TorqueLoopBuilder, delayed: Mapping[str, OutputPort]) -> Prediction:
    """What is known of the joints now, of `delayed` ports: see `Prediction`."""
    scenario, builder = parts.scenario, parts.builder
    if scenario.predictor is None and scenario.observer is None:
        return Prediction(delayed, delayed)
    n, dt = len(parts.robot.joints), scenario.dt
    spec = scenario.observer or ObserverSpec()
    forward = scenario.compensation.acceleration == "reference"
    system = DisturbanceObserver(
        parts.controller_robot, parts.models, spec, dt, rotor_inertia=scenario.rotor_inertia, fed_forward=forward
    )
    observer = parts.add("disturbance_observer", system)
    parts.signals["disturbance"] = observer.GetOutputPort("disturbance")
    known = dict(delayed)
    if scenario.observer is not None:
        known["disturbance"] = observer.GetOutputPort("compensation")
    if scenario.predictor is not None:
        wires = {name: observer.GetOutputPort(name) for name in ("link_torque", "motion", "fault")} | dict(delayed)
        predictor = parts.add("delay_predictor", DelayPredictor(n, scenario.predictor, dt), **wires)
        smooth = SavitzkyGolayFilter(n, scenario.filters.window, scenario.filters.encoder_order, dt)
        parts.add("model_filter", smooth, signal=predictor.GetOutputPort("model_torque"))
        builder.Connect(smooth.GetOutputPort("value"), predictor.GetInputPort("delayed_model_torque"))
        known |= {name: predictor.GetOutputPort(name) for name in delayed}
        parts.signals["predicted_torque"] = predictor.GetOutputPort("estimated_torque")
    return Prediction(delayed, known, observer)


def live_torque(parts: TorqueLoopBuilder, observer: DisturbanceObserver) -> JointTorqueEstimator:
    """A torque estimate of this tick, from raw readings (the F/T sensors zeroed) and the observer's motion."""
    builder = parts.builder
    delayed: Any = builder.GetSubsystemByName("torque_estimator")
    wires = {"joint_estimate": observer.GetOutputPort("motion")}
    if parts.base_from == "imu":
        wires["imu_estimate"] = base_now(parts)
    if parts.readings.force_torque is not None:
        wires["wrench_estimate"] = parts.readings.force_torque
        if builder.HasSubsystemNamed("wrench_tare"):
            wires["wrench_estimate"] = zeroed(parts, "live_wrench", wires["wrench_estimate"])
    return parts.add("live_torque", JointTorqueEstimator(delayed.model), **wires)  # type: ignore[no-any-return]


def connect_observer(
    parts: TorqueLoopBuilder, observer: DisturbanceObserver, found: Prediction, reference: OutputPort, sent: OutputPort
) -> None:
    """Wire the observer to what is made behind it: it reads all of it for its next state only.

    Args:
        parts: Of the loop.
        observer: From `prediction`.
        found: What that returned.
        reference: Desired motion.
        sent: What leaves the guard.
    """
    n, builder, scenario = len(parts.robot.joints), parts.builder, parts.scenario
    spec = scenario.observer or ObserverSpec()
    feedforward = parts.output("inverse_dynamics", "feedforward_torque")
    wires = dict(found.delayed) | {
        name: parts.output("torque_control", name) for name in ("commanded_torque", "command")
    }
    estimated = scenario.compensation.velocity == "estimate"
    wires["compensated_motion"] = found.known["joint_estimate"] if estimated else reference
    wires |= {"feedforward_torque": feedforward, "reference": reference, "sent_command": sent}
    acceleration = split(builder, "reference_acceleration", reference, [2 * n, n])[1]
    wires["delayed_reference"] = parts.join("model_signals", [feedforward, acceleration])
    estimator: Any = builder.GetSubsystemByName("torque_estimator")
    if spec.torque == "live":
        wires["joint_estimate"] = observer.GetOutputPort("motion")
        estimator = live_torque(parts, observer)
        wires["estimated_torque"] = estimator.GetOutputPort("estimated_torque")
    else:
        filters = scenario.filters
        at = None if spec.delay is None else filters.window - 1 - spec.delay / scenario.dt
        smooth = SavitzkyGolayFilter(2 * n, filters.window, filters.encoder_order, scenario.dt, at)
        parts.add("reference_filter", smooth, signal=wires["delayed_reference"])
        wires["delayed_reference"] = smooth.GetOutputPort("value")
    wires["torque_fault"] = estimator.GetOutputPort("fault")
    for name, port in wires.items():
        builder.Connect(port, observer.GetInputPort(name))


def servo_command(parts: TorqueLoopBuilder, reference: OutputPort) -> OutputPort:
    """The reference itself; the vendor's servo does the rest."""
    n = len(parts.robot.joints)
    position, _ = split(parts.builder, "reference_position", reference, [n, 2 * n])
    nothing: Any = np.zeros(1)
    sound = behind(parts.builder, "no_fault", ConstantVectorSource(nothing))
    parts.signals["reference"] = reference
    return _guarded(parts, position, sound)


def torque_command(parts: TorqueLoopBuilder, reference: OutputPort) -> OutputPort:
    """Reference to command through filters, estimator, inverse dynamics and torque control."""
    scenario = parts.scenario
    estimates, ports = _estimation(parts)
    sensed: Any = parts.readings.joint_torque
    torque = estimates["estimated_torque"]
    parts.signals |= {"reference": reference, **estimates}
    delayed = {
        "joint_estimate": ports["joint_estimate"],
        "estimated_torque": sensed if scenario.torque_from == "sensor" else torque,
        "position": parts.readings.encoder,
    }
    found = prediction(parts, delayed)
    known = found.known
    moved = {name: known[name] for name in ("joint_estimate", "position")} | {"reference": reference}
    if not parts.controller_robot.fixed_base:
        predicted = scenario.predictor is not None
        moved["base_joint_estimate"] = known["joint_estimate"]
        moved["imu_estimate"] = base_now(parts) if predicted else ports["imu_estimate"]
    _inverse_dynamics(parts, estimates, moved)
    parts.signals["desired_torque"] = desired = parts.output("inverse_dynamics", "desired_torque")
    _torque_control(parts, known, desired, reference)
    flags = _monitor(parts, estimates, reference)
    if scenario.log_components:
        parts.signals["components"] = parts.output("torque_control", "components")
    command = _guarded(parts, parts.output("torque_control", "command"), flags)
    if found.observer is not None:
        connect_observer(parts, found.observer, found, reference, command)
    return command


def _torque_control(
    parts: TorqueLoopBuilder, known: Mapping[str, OutputPort], desired: OutputPort, reference: OutputPort
) -> None:
    """The torque control, which compensates a disturbance where one is known."""
    scenario = parts.scenario
    limit, disturbed = joint_limits(parts.robot).effort, "disturbance" in known
    wires = dict(known) | {"desired_torque": desired}
    if parts.systems["inverse_dynamics"].HasOutputPort("torque_terms"):
        wires["torque_terms"] = parts.output("inverse_dynamics", "torque_terms")
    if scenario.compensation.needs_reference:
        wires["reference"] = reference
    parts.add(
        "torque_control",
        lambda: TorqueControl(
            parts.models, parts.gains, limit, scenario.dt, scenario.compensation, disturbance=disturbed
        ),
        **wires,
    )


def _inverse_dynamics(
    parts: TorqueLoopBuilder, estimates: Mapping[str, OutputPort], inputs: dict[str, OutputPort]
) -> None:
    """The inverse dynamics, with a force task where a force is commanded or its share of the command is recorded."""
    scenario, robot = parts.scenario, parts.controller_robot
    asked = parts.force_reference if robot.force_torque else None
    if asked is not None:
        inputs |= {"force_reference": asked, "contact_wrench": estimates["contact_wrench"]}
    if "inverse_dynamics" in parts.stages:
        parts.add("inverse_dynamics", None, **inputs)
        return
    rotation: BaseRotation = "neglected" if scenario.angular_acceleration == "neglected" else "gyro"
    sources = MotionSources(scenario.configuration, "encoder", rotation)
    dynamics = InverseDynamics(robot, parts.gains, sources, force_task=asked is not None)
    parts.add("inverse_dynamics", dynamics, **inputs)


def _estimation(parts: TorqueLoopBuilder) -> tuple[dict[str, OutputPort], dict[str, OutputPort]]:
    """Filters, tare and torque estimator: the estimator's ports and the filters'."""
    scenario = parts.scenario
    spec = scenario.filters
    orders = (spec.encoder_order, spec.inertial_order)
    ports = parts.filtered_readings(parts.readings, spec.window, orders, imu=parts.base_from == "imu")
    parts.signals["joint_estimate"] = ports["joint_estimate"]
    if "torque_estimator" in parts.stages:
        parts.add("torque_estimator", None, **ports)
        needed = ("estimated_torque", *(("contact_wrench",) if parts.robot.force_torque else ()))
        return {name: parts.output("torque_estimator", name) for name in needed}, ports
    model = TorqueModel(
        parts.controller_robot, base=parts.base_from, angular_acceleration=scenario.angular_acceleration
    )
    if scenario.tare and parts.robot.force_torque:
        filled = scenario.filters.window * scenario.dt
        tare = WrenchTare(model, filled, filled + scenario.tare)
        wires = {name: ports[name] for name in ("joint_estimate", "imu_estimate") if name in ports}
        parts.add("wrench_tare", tare, wrench=ports["wrench_estimate"], **wires)
        ports["wrench_estimate"] = zeroed(parts, "zeroed_wrench", ports["wrench_estimate"])
    estimator = JointTorqueEstimator(model)
    parts.add("torque_estimator", estimator, **ports)
    places = {name: list(range(part.start, part.stop)) for name, part in estimator.parts.items()}
    found = picked(parts.builder, "torque_estimates", estimator.GetOutputPort("estimate"), places)
    return {name: parts.passed(f"torque_estimator.{name}", port) for name, port in found.items()}, ports


def _monitor(parts: TorqueLoopBuilder, estimates: Mapping[str, OutputPort], reference: OutputPort) -> OutputPort:
    """The fault monitor's port `any_fault`; where nothing may touch the robot, a contact wrench is a fault."""
    robot, scenario, readings = parts.robot, parts.scenario, parts.readings
    free = tuple(mount.name for mount in robot.force_torque) if scenario.untouched else ()
    n = len(robot.joints)
    place, rate, _ = split(parts.builder, "reference_velocity", reference, [n, n, n])
    wires = {"position": readings.encoder, "reference_velocity": rate, "reference": place}
    wires["command"] = parts.output("torque_control", "command")
    if readings.imu is not None:
        wires["imu"] = first_imu(parts.builder, readings.imu)
    if readings.force_torque is not None:
        wires["wrench"] = readings.force_torque
        wires["contact_wrench"] = estimates["contact_wrench"]
    spec = scenario.monitor.for_sensors(sensor_suite(scenario))
    monitor = parts.add("fault_monitor", lambda: FaultMonitor(robot, spec, scenario.dt, free), **wires)
    if isinstance(monitor, FaultMonitor):
        parts.flag_names = tuple(monitor.flag_names)
        parts.signals["flags"] = monitor.GetOutputPort("flags")
    return parts.output("fault_monitor", "any_fault")


def _guarded(parts: TorqueLoopBuilder, command: OutputPort, fault: OutputPort) -> OutputPort:
    """The command behind the guard."""
    encoder = parts.readings.encoder
    n, spec = len(parts.robot.joints), parts.scenario.guard
    servo = tuple(model.drive.kind == "position_servo" for model in parts.models)
    if parts.scenario.controller == "torque":
        limits = joint_limits(parts.robot)
        spec = rated_guard(spec, parts.models, limits.effort, limits.velocity)
    guard = parts.add(
        "guard",
        lambda: CommandGuard(n, parts.scenario.dt, spec, servo),
        command=command,
        position=encoder,
        fault=fault,
    )
    if isinstance(guard, CommandGuard):
        parts.signals |= picked(parts.builder, "guard_state", guard.GetOutputPort("next"), {"mode": [3 * n]})
    return parts.output("guard", "command")


def loop_robot(scenario: Scenario, *, controller: bool = False) -> Robot:
    """The scenario's robot, its base free where it hangs in springs, without joint stops where it says so.

    Masses and payloads of links that `close-loop` found are those of the actuators' model file: the simulated one, or
    the controller's.

    Raises:
        ParamsError: a file that cannot be read, or a base that floats and is taken to have no angular acceleration.
    """
    robot = load_robot(scenario.path(scenario.robot))
    named = model_file(scenario, controller=controller)
    if named is not None:
        robot = replace(robot, changes=link_changes(named))
    if scenario.suspension is not None:
        robot = replace(robot, fixed_base=False)
    base_source(scenario, robot)
    if scenario.joint_stops == "none":
        endless = {"lower": -np.inf, "upper": np.inf}
        robot = replace(robot, limits={joint: {**robot.limits.get(joint, {}), **endless} for joint in robot.joints})
    return robot


def model_file(scenario: Scenario, *, controller: bool) -> Path | None:
    """The model file that the scenario names for plant or controller; None: that of the robot file."""
    named = scenario.actuators if not (controller and scenario.model) else scenario.model
    return None if named is None else scenario.path(named)


def actuator_models(scenario: Scenario, robot: Robot, *, controller: bool = False) -> dict[str, ActuatorModel]:
    """The simulated actuators, or those that the controller compensates, joint by joint.

    Raises:
        ParamsError: no model file at all, or one that lacks a joint.
    """
    path = model_file(scenario, controller=controller) or robot.actuators
    if path is None:
        raise ParamsError(f"{robot.source}: expected `actuators`, here or in the scenario, got none")
    chosen = models_of_joints(path, robot.joints)
    if not controller:
        return chosen
    factors = scenario.model_factors
    has_friction = any(value.key == "viscous" for model in chosen.values() for value in model.effects)
    viscous = {"viscous": factors.k_v / factors.k_tau} if has_friction else {}
    return dict(zip(chosen, erring(chosen.values(), {"gain": factors.k_tau, **viscous}), strict=True))


def torque_gains(scenario: Scenario, robot: Robot) -> TorqueGains:
    """The scenario's gains in the parametrisation of the torque loop: Ks = K6/(K (1 + Kp)), Kd = K7/(K (1 + Kp)).

    Raises:
        ParamsError: a gain that is not possible, or a joint that the robot does not have.
    """
    spec = scenario.gains
    k6, k7, kp, ki = (np.array(spec.of(name, robot.joints)) for name in ("k6", "k7", "kp", "ki"))
    kf = np.tile(np.broadcast_to(np.asarray(spec.kf, dtype=np.float64), 6), len(robot.force_torque))
    return TorqueGains.from_servo(actuator_models(scenario, robot, controller=True), k6, k7, kp, ki=ki, kf=kf)


@dataclass(frozen=True, eq=False, kw_only=True)
class LoopDesign:
    """What a torque loop is wired from.

    Attributes:
        robot: What the controller takes the robot for.
        plant_robot: The simulated one.
        spec: How the loop is controlled.
        actuators: (n) models of the simulated drives, in the order of the robot's joints.
        models: (n) what the controller takes the drives for.
        gains: Feedback gains.
        posture: (n,) where the motion rests [rad].

    Example:
        >>> scenario = TORQUE_LOOP.scenario("brisk_swing")
        >>> LoopDesign.of_scenario(scenario).gains.size
        6
    """

    robot: Robot
    plant_robot: Robot
    spec: TorqueLoopSpec
    actuators: tuple[ActuatorModel, ...]
    models: tuple[ActuatorModel, ...]
    gains: TorqueGains
    posture: FloatArray

    def __post_init__(self) -> None:
        n, sensors = len(self.robot.joints), len(self.robot.force_torque)
        if self.gains.size != n:
            raise ParamsError(f"gains: expected {n}, one per joint, got {self.gains.size}")
        if self.gains.kf.size and self.gains.kf.shape[0] != 6 * sensors:
            raise ParamsError(f"gains.kf: expected {6 * sensors} rows, six per F/T sensor, got {len(self.gains.kf)}")
        check_joint_types(self.robot, (*self.models, *self.actuators))

    @classmethod
    def of_scenario(cls, scenario: Scenario) -> "LoopDesign":
        """A scenario's.

        Raises:
            ParamsError: a file that cannot be read, or a joint or gain that is not possible.
        """
        robot = loop_robot(scenario, controller=True)
        return cls(
            robot=robot,
            plant_robot=loop_robot(scenario),
            spec=loop_spec(scenario),
            actuators=tuple(actuator_models(scenario, robot).values()),
            models=tuple(actuator_models(scenario, robot, controller=True).values()),
            gains=torque_gains(scenario, robot),
            posture=posture(scenario.motion, robot),
        )


def sliding_scenario(scenario: Scenario, folder: Path, direction: float = 0.0) -> Scenario:
    """The scenario with drives, true and assumed, that hold only what is linear in sliding.

    The inverse of a dead zone in the controller's model is constant there as the dead zone itself is.

    Args:
        scenario: Whose drives.
        folder: Takes the two model files; must exist for as long as the scenario is used.
        direction: Of the sliding, 1 or -1; 0 takes the mean gain of drives that switch with it.

    Raises:
        ParamsError: drives that cannot be read.
    """
    plain = replace(scenario, model_factors=ModelFactors())

    def saved(name: str, *, controller: bool) -> str:
        robot = loop_robot(scenario, controller=controller)
        models = actuator_models(plain, robot, controller=controller)
        path = str((folder / f"sliding_{name}.yaml").resolve())
        ModelFile(sliding(models, direction), shared=robot.changes.causes, links=robot.changes.fitted).save(path)
        return path

    return replace(scenario, actuators=saved("actuators", controller=False), model=saved("model", controller=True))
