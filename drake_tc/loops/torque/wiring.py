"""`add_torque_loop`: the standard torque loop around a plant, in one call.

    reference --> inverse_dynamics --> torque_control --> guard --> actuators --> plant --> encoder, imu, force_torque
                       ^                    ^               ^                                      |
                       |--- torque_estimator|               |-- fault_monitor <---- raw readings --|
                                 ^--------- filter <-----------------------------------------------|

All from the readings to the guard is wired by `add_torque_controller`, also for a controller without a plant.

Between the stages stand blocks of Drake's own that join, split and add signals; a signal that a stage has beside others
is taken from one port, as every call into Python costs a tick some microseconds.

`torque_controller`: the torque control of a robot as a Diagram without a plant, from readings to commands.

    position, imu, force_torque --> filter, torque_estimator, inverse_dynamics, torque_control, guard --> command

Fed with the readings of a simulated loop, its commands are the same to the last bit.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import ConstantVectorSource, TrajectorySource
from pydrake.trajectories import Trajectory

from drake_tc.actuation.joint_effects import Models, model_list
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.actuation.wiring import add_actuators
from drake_tc.control.gains import TorqueGains
from drake_tc.control.trajectories import constant_trajectory
from drake_tc.errors import ParamsError
from drake_tc.loops.built_loop import ControlledJoints, Controller, Watched, WiredLoop, add_input
from drake_tc.loops.loop_builder import behind
from drake_tc.loops.plant import require_fitting_plant
from drake_tc.loops.torque.default_gains import torque_design, warn_of_weak_joints
from drake_tc.loops.torque.references import check_range, references, table_source
from drake_tc.loops.torque.scenario import Scenario, TorqueLoopSpec, sensor_suite
from drake_tc.loops.torque.stages import LoopDesign, TorqueLoopBuilder, servo_command, torque_command
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.sensing.suite import Readings, SensorSuite, add_sensors
from drake_tc.sensor_validation.monitor_spec import LATE

LOOKED_AT = 1000
"""Instants at which a trajectory is held against the joints' ranges."""
LONGEST = 1e4
"""Of a trajectory without end, that is looked at [s]."""
Reference = OutputPort | Trajectory | None
"""(3n) [q_d; qdot_d; qddot_d] from a port, q_d (n) as a trajectory, or None: the robot's posture."""


class Desired(NamedTuple):
    """What the joints shall do, and the forces and torques (6k) at the F/T sensors' contacts [N, N m], if any."""

    motion: Reference = None
    force: OutputPort | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class TorqueLoop(WiredLoop):
    """A torque loop in a diagram.

    Stages: `filter`, `torque_estimator`, `inverse_dynamics`, `torque_control`, `fault_monitor`, `guard` and others.
    Signals: `joint_state` [q; v] of the plant, `reference`, `joint_estimate`, `estimated_torque`, `desired_torque`,
    `command` (what the drives get), `actuation`, the sensors' readings, and more.

    Attributes:
        sensors: Encoders, IMU, F/T sensors; each has the port `reading`.
        actuators: The simulated drives.
        design: What the loop was wired from.
    """

    sensors: SensorSuite
    actuators: ActuatorPlant
    design: LoopDesign


def add_torque_loop(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    robot: Robot,
    models: Models,
    reference: Reference = None,
    spec: TorqueLoopSpec | None = None,
    *,
    gains: TorqueGains | None = None,
    controller_models: Models | None = None,
    force_reference: OutputPort | None = None,
    stages: Mapping[str, System] | None = None,
) -> TorqueLoop:
    """Add sensors, estimation, control and drives to a plant, and connect all of them.

    Args:
        builder: Holds `plant`.
        plant: Finalized plant of the robot with live ports, from `add_robot_plant` or the user's own.
        robot: From `load_robot`.
        models: Of the simulated drives, by joint or in the order of the robot's joints.
        reference: What the joints shall do. A trajectory must stay within the joints' ranges; a port that leaves them
            raises the flag `reference/out_of_range`, and the guard holds.
        spec: How the loop is controlled; None: the defaults, with the longest window of the filters with which every
            joint can have its margins.
        gains: Feedback gains; None: for each joint the stiffest that leave a gain margin of 2 and a phase margin of
            40 degrees (`drake_tc.loops.torque.default_gains`). A loop without these margins, or whose margins are
            not known, logs a warning.
        controller_models: What the controller takes the drives for; None: what they are.
        force_reference: (6k) forces and torques at the F/T sensors' contacts [N, N m]; None: no force is commanded, or
            0 where the gains feed forces back.
        stages: Stage to a system of your own in its place. It needs the stage's output ports that others read; of its
            input ports those are connected whose names the stage's inputs or the loop's signals have. "stage.port" to a
            system of your own behind that output port, for example a low pass behind "torque_control.command"; its
            first input and output have the port's size.

    Raises:
        ParamsError: a plant that is not finalized or whose ports are sampled, models or gains that do not fit the
            robot, or a stage or place that the loop does not have.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> builder = DiagramBuilder()
        >>> plant = add_robot_plant(builder, robot)
        >>> loop = add_torque_loop(builder, plant, robot, load_models(robot.actuators))
        >>> loop.signals["command"].size()
        6
    """
    require_fitting_plant(plant, (TorqueLoopSpec() if spec is None else spec).dt, robot)
    actuators, assumed = (
        model_list(each, robot.joints) for each in (models, models if controller_models is None else controller_models)
    )
    design = torque_design(robot, spec, actuators, assumed, gains)
    warn_of_weak_joints(design, stages or ())
    return wire_torque_loop(builder, plant, design, Desired(reference, force_reference), stages)


def wire_torque_loop(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    design: LoopDesign,
    desired: Desired,
    stages: Mapping[str, System] | None = None,
) -> TorqueLoop:
    """Add the loop of a design, which says drives, gains and window, without a look at its margins.

    Args:
        builder: Holds `plant`.
        plant: Finalized plant with live ports.
        design: What to wire.
        desired: What joints and contacts shall do.
        stages: Stage, or "stage.port", to a system in its place or behind that port.

    Raises:
        ParamsError: as `add_torque_loop`.
    """
    robot, spec, force_reference = design.robot, design.spec, desired.force
    expected = 6 * len(robot.force_torque)
    if force_reference is not None and force_reference.size() != expected:
        raise ParamsError(
            f"force_reference: expected a port of size {expected}, six per F/T sensor, got size"
            f" {force_reference.size()}"
        )
    if force_reference is None and design.gains.kf.any():
        nothing: Any = np.zeros(6 * len(robot.force_torque))
        force_reference = behind(builder, "force_reference", ConstantVectorSource(nothing))
    sensors = add_sensors(builder, plant, robot, sensor_suite(spec), spec.dt, spec.seed, spec.faults)
    parts = TorqueLoopBuilder(
        builder,
        spec,
        plant,
        spec.dt,
        {
            "joint_state": plant.get_state_output_port(),
            "acceleration": plant.get_generalized_acceleration_output_port(),
        },
        stages=stages or {},
        robot=robot,
        readings=sensors.readings,
        models=list(design.models),
        gains=design.gains,
        force_reference=force_reference,
    )
    command = add_torque_controller(parts, desired.motion)
    simulated = dict(zip(robot.joints, design.actuators, strict=True))
    actuators = add_actuators(builder, plant, simulated, plant.time_step() or spec.dt)
    builder.Connect(command, actuators.GetInputPort("command"))
    actuation = builder.GetSubsystemByName("actuation").get_output_port(0)
    parts.signals["actuation"] = actuation
    return TorqueLoop(
        systems={**parts.systems, "actuators": actuators},
        sensors=sensors,
        actuators=actuators,
        signals=parts.signals,
        flag_names=parts.flag_names,
        period=spec.dt,
        design=design,
    )


def add_torque_controller(parts: TorqueLoopBuilder, reference: Reference) -> OutputPort:
    """The stages from the readings to the guard, connected: the controller of a simulated loop as of a robot.

    Args:
        parts: With the ports of the readings.
        reference: What the joints shall do.

    Returns:
        The command of the drives (n).

    Raises:
        ParamsError: a reference of another size, or a stage or place that the controller does not have.
    """
    named = vars(parts.readings).items()
    parts.signals |= {name: port for name, port in named if port is not None}
    desired = parts.passed("reference", _reference(parts.builder, parts.robot, reference))
    torque = parts.scenario.controller == "torque"
    command = torque_command(parts, desired) if torque else servo_command(parts, desired)
    parts.signals["command"] = command
    parts.check_own_systems()
    return command


def _reference(builder: DiagramBuilder, robot: Robot, reference: Reference) -> OutputPort:
    """The port with [q_d; qdot_d; qddot_d].

    Raises:
        ParamsError: a reference of another size, or a trajectory that leaves a joint's range.
    """
    n = len(robot.joints)
    if not isinstance(reference, OutputPort):
        path: Any = constant_trajectory(robot.posture) if reference is None else reference
        if not isinstance(reference, Trajectory | None):
            raise ParamsError(
                f"reference: expected a trajectory of {n} positions or an output port, got {type(path).__name__}"
            )
        if path.rows() == n:
            begin, end = np.clip((path.start_time(), path.end_time()), -LONGEST, LONGEST)
            times = np.linspace(begin, end, LOOKED_AT)
            check_range(robot, times, path.vector_values(times).T, "reference")
        reference = behind(builder, "reference", TrajectorySource(path, 2))
    if reference.size() != 3 * n:
        raise ParamsError(
            f"reference: expected a port of size {3 * n}, [q_d; qdot_d; qddot_d] of {n} joints, or a trajectory of"
            f" {n} positions, got a port of size {reference.size()}"
        )
    return reference


INPUTS = {"encoder": "position", "imu": "imu", "force_torque": "force_torque", "joint_torque": "joint_torque"}
"""Field of `Readings` to the input port that brings it."""


def torque_controller(
    robot: Robot,
    models: Models,
    motion: Trajectory | System | Literal["input"] | None = None,
    spec: TorqueLoopSpec | None = None,
    *,
    gains: TorqueGains | None = None,
    stages: Mapping[str, System] | None = None,
    fused: bool = False,
) -> Controller:
    """The torque control of a robot as a Diagram from readings to commands, without a plant.

    Input ports of the Diagram, each read every `spec.dt`:
        position (n): of the joints, in the order of the robot file [rad].
        imu (6 per IMU): [gyro; accel] in the IMU's frame [rad/s, m/s^2]; where the robot has an IMU.
        force_torque (6 per sensor): [force; torque] in the sensor's frame [N, N m]; where it has F/T sensors.
        joint_torque (n): of joint-torque sensors [N m]; with `spec.torque_from: sensor`.
        reference (3n): [q_d; qdot_d; qddot_d]; with `motion` "input".
        force_reference (6 per F/T sensor): f_d [N, N m]; where the gains feed forces back.
    Output ports of the Diagram:
        command (n): of the drives: q_d [rad], i [A] or V [V]. Finite whatever comes in, except before the first
            position has come in: a servo's command is then 0 (`CommandGuard`).
        and the signals of the stages: `mode` of the guard, `flags`, `estimated_torque`, `desired_torque`, ...

    Args:
        robot: From `load_robot`.
        models: What the controller takes the drives for, by joint or in the order of the robot's joints.
        motion: What the joints shall do: positions (n) over time, or a system with one output [q_d; qdot_d; qddot_d]
            (3n); None: the robot's posture; "input": what the input port `reference` says.
        spec: How the joints are controlled; None: the defaults, as in `add_torque_loop`. Its `sensors` say what noise
            the fault monitor expects, its `faults` are those of simulated sensors and are not used.
        gains: Feedback gains; None: those that leave each joint its margins, as in `add_torque_loop`.
        stages: Stage to a system of your own in its place, as in `add_torque_loop`.
        fused: Run the stages in one system, which gives the same numbers in less time.

    Raises:
        ParamsError: models or gains that do not fit the robot, a motion of another size, or a stage or place that the
            controller does not have.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> controller = torque_controller(robot, load_models(robot.actuators))
        >>> controller.GetInputPort("position").size(), controller.GetOutputPort("command").size()
        (6, 6)
    """
    assumed = model_list(models, robot.joints)
    design = torque_design(robot, spec, assumed, assumed, gains)
    warn_of_weak_joints(design, stages or ())
    spec, gains = design.spec, design.gains
    if spec.monitor.encoder_timing == 0.0:
        spec = replace(spec, monitor=replace(spec.monitor, encoder_timing=LATE))
    builder, n = DiagramBuilder(), len(robot.joints)
    sizes = {"encoder": n, "imu": 6 * len(robot.imu), "force_torque": 6 * len(robot.force_torque)}
    sizes["joint_torque"] = n if spec.torque_from == "sensor" else 0
    ports = {name: add_input(builder, INPUTS[name], size) for name, size in sizes.items() if size}
    forced = bool(gains.kf.any()) and bool(robot.force_torque)
    if isinstance(motion, str) and motion != "input":
        raise ParamsError(f'motion: expected a trajectory, a system or "input", got {motion!r}')
    if isinstance(motion, System):
        if not motion.num_output_ports():
            raise ParamsError(f"motion: expected a system with an output port of size {3 * n}, got one without")
        reference: Reference = behind(builder, "reference", motion)
    else:
        reference = add_input(builder, "reference", 3 * n) if isinstance(motion, str) else motion
    parts = TorqueLoopBuilder(
        builder,
        spec,
        None,
        spec.dt,
        stages=stages or {},
        robot=robot,
        readings=Readings(**ports),
        models=list(assumed),
        gains=gains,
        force_reference=add_input(builder, "force_reference", sizes["force_torque"]) if forced else None,
    )
    add_torque_controller(parts, reference)
    servo = tuple(model.drive.kind == "position_servo" for model in assumed)
    limits = joint_limits(robot)
    controlled = ControlledJoints(
        joints=robot.joints,
        servo=servo,
        lower=limits.lower,
        upper=limits.upper,
        period=spec.dt,
        flag_names=parts.flag_names,
        watched=Watched(tuple(assumed), spec.filters.window, spec.filters.encoder_order)
        if spec.controller == "torque" and "filter" not in parts.stages
        else None,
        inputs=tuple(ports),
    )
    return Controller(builder, f"{robot.name}_controller", controlled, parts.signals, fused=fused)


def scenario_controller(scenario: Scenario) -> Controller:
    """The controller of a scenario's loop, in one system: its robot, models, gains and references, without its plant.

    Args:
        scenario: Of the torque loop; forces that it commands at a contact come in through `force_reference`.

    Raises:
        ParamsError: a file that cannot be read, or names that do not fit.
    """
    design = LoopDesign.of_scenario(scenario)
    path = references(scenario, design.robot)
    motion = table_source(path.time, path.motion)
    return torque_controller(design.robot, design.models, motion, design.spec, gains=design.gains, fused=True)
