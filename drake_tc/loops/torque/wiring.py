"""`add_torque_loop`: the standard torque loop around a plant, in one call.

    reference --> inverse_dynamics --> torque_control --> guard --> actuators --> plant --> encoder, imu, force_torque
                       ^                    ^               ^                                      |
                       |--- torque_estimator|               |-- fault_monitor <---- raw readings --|
                                 ^--------- filter <-----------------------------------------------|

All from the readings to the guard is wired by `add_torque_controller`, which `drake_tc.loops.torque.controller` calls
for a controller without a plant.

Between the stages stand blocks of Drake's own that join, split and add signals; a signal that a stage has beside others
is taken from one port, as every call into Python costs a tick some microseconds.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import ConstantVectorSource, TrajectorySource
from pydrake.trajectories import Trajectory

from drake_tc.actuation.joint_values import Models, model_list
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.actuation.wiring import add_actuators
from drake_tc.control.gains import TorqueGains
from drake_tc.control.trajectories import constant_trajectory
from drake_tc.errors import ParamsError
from drake_tc.loops.built_loop import WiredLoop
from drake_tc.loops.plant import require_live_ports
from drake_tc.loops.torque.default_gains import torque_design, warn_of_weak_joints
from drake_tc.loops.torque.parts import LoopDesign
from drake_tc.loops.torque.references import check_range
from drake_tc.loops.torque.scenario import TorqueLoopSpec, sensor_suite
from drake_tc.loops.torque.stages import TorqueLoopBuilder, servo_command, torque_command
from drake_tc.robot.robot import Robot
from drake_tc.sensing.suite import SensorSuite, add_sensors

LOOKED_AT = 1000
"""Instants at which a trajectory is held against the joints' ranges."""
LONGEST = 1e4
"""Of a trajectory without end, that is looked at [s]."""
Reference = OutputPort | Trajectory | None
"""(3n) [q_d; qdot_d; qddot_d] from a port, q_d (n) as a trajectory, or None: the robot's posture."""


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
    free: bool = False,
    stages: Mapping[str, System] | None = None,
    between: Mapping[str, System] | None = None,
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
            40 degrees (`drake_tc.loops.torque.default_gains`). A loop without these margins logs a warning.
        controller_models: What the controller takes the drives for; None: what they are.
        force_reference: (6k) forces and torques at the F/T sensors' contacts [N, N m]; None: no force is commanded, or
            0 where the gains feed forces back.
        free: Whether nothing may touch the robot; a contact wrench then counts as a fault.
        stages: Stage to a system of your own in its place. It needs the stage's output ports that others read; of its
            input ports those are connected whose names the stage's inputs or the loop's signals have.
        between: "stage.port" to a system of your own behind that output port, for example a low pass behind
            "torque_control.command"; its first input and output have the port's size.

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
    require_live_ports(plant)
    actuators, assumed = (
        model_list(each, robot.joints) for each in (models, models if controller_models is None else controller_models)
    )
    design = torque_design(robot, spec, actuators, assumed, gains)
    warn_of_weak_joints(design, (*(stages or {}), *(between or {})))
    return wire_torque_loop(
        builder, plant, design, reference, force_reference, free=free, stages=stages, between=between
    )


def wire_torque_loop(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    design: LoopDesign,
    reference: Reference = None,
    force_reference: OutputPort | None = None,
    *,
    free: bool = False,
    stages: Mapping[str, System] | None = None,
    between: Mapping[str, System] | None = None,
) -> TorqueLoop:
    """Add the loop of a design, which says drives, gains and window, without a look at its margins.

    Args:
        builder: Holds `plant`.
        plant: Finalized plant with live ports.
        design: What to wire.
        reference: What the joints shall do.
        force_reference: (6k) of the contacts at the F/T sensors [N, N m].
        free: Whether nothing may touch the robot.
        stages: Stage to a system in its place.
        between: "stage.port" to a system behind that port.

    Raises:
        ParamsError: as `add_torque_loop`.
    """
    robot, spec = design.robot, design.spec
    if force_reference is None and design.gains.kf.any():
        nothing: Any = np.zeros(6 * len(robot.force_torque))
        force_reference = builder.AddNamedSystem("force_reference", ConstantVectorSource(nothing)).get_output_port()
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
        between=between or {},
        robot=robot,
        readings=sensors.readings,
        models=list(design.models),
        gains=design.gains,
        force_reference=force_reference,
        free=free,
    )
    command = add_torque_controller(parts, reference)
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
        if path.rows() == n:
            begin, end = np.clip((path.start_time(), path.end_time()), -LONGEST, LONGEST)
            times = np.linspace(begin, end, LOOKED_AT)
            check_range(robot, times, path.vector_values(times).T, "reference")
        reference = builder.AddNamedSystem("reference", TrajectorySource(path, 2)).get_output_port()
    if reference.size() != 3 * n:
        raise ParamsError(
            f"reference: expected a port of size {3 * n}, [q_d; qdot_d; qddot_d] of {n} joints, or a trajectory of"
            f" {n} positions, got a port of size {reference.size()}"
        )
    return reference
