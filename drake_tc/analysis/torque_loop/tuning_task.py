"""A torque loop and its motion as tasks for `drake_tc.analysis.tuning`: each joint's loop, motion and drive.

Each joint is taken by itself, the others where the reference has them. M_jj is that of the motion's middle posture;
margins are also asked for at the postures where M_jj is smallest and largest.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from drake_tc.actuation.compensator import Compensator
from drake_tc.actuation.model import ActuatorModel
from drake_tc.analysis.tracking_error import JointTask
from drake_tc.control.dynamics_terms import DynamicsTerms
from drake_tc.control.joint_loop import JointLoop
from drake_tc.errors import ParamsError
from drake_tc.loops.torque.joint_loops import joint_loops
from drake_tc.loops.torque.parts import LoopDesign
from drake_tc.loops.torque.references import references
from drake_tc.loops.torque.running import SETTLED
from drake_tc.loops.torque.scenario import Scenario, TorqueLoopSpec, sensor_suite
from drake_tc.robot.robot import Robot
from drake_tc.sensing.spec import SensorSpec
from drake_tc.types import GRAVITY, FloatArray

INERTIA_ROWS = 50
"""At about so many rows of the motion the inertias are taken."""


def joint_tasks(scenario: Scenario, begin: float | None = None) -> list[JointTask]:
    """One task a joint, with the scenario's own gains and filter.

    Args:
        scenario: As `joint_loops` wants it, with position servos.
        begin: Errors count from here on [s]; None: `SETTLED`, or the second half of a run shorter than twice that.

    Raises:
        ParamsError: another loop or other drives, or a scenario that cannot be built.
    """
    design = LoopDesign.of_scenario(scenario)
    desired = references(scenario, design.robot)
    motion = desired.motion.reshape(-1, 3, len(design.robot.joints))
    first = min(SETTLED, 0.5 * scenario.duration) if begin is None else begin
    return design_tasks(design, desired.time, motion, first)


def design_tasks(design: LoopDesign, time: FloatArray, motion: FloatArray, begin: float) -> list[JointTask]:
    """One task a joint, with the loop's own gains and filter.

    Args:
        design: As `joint_loops` wants it, with position servos.
        time: (T,) ticks of the control [s].
        motion: (T, 3, n) q_d, qdot_d, qddot_d [rad, rad/s, rad/s^2].
        begin: Errors are evaluated from here on [s].

    Raises:
        ParamsError: another loop or other drives.
    """
    own = joint_loops(design)
    robot, spec = design.robot, design.spec.compensation
    for drive in (*design.actuators, *design.models):
        if drive.drive.kind != "position_servo":
            raise ParamsError(f"tune: expected position servos; {drive.joint} is a {drive.drive.kind} drive")
    n = len(robot.joints)
    torque, inertias, torque_noise = _dynamics(robot, motion, design.spec)
    needed = _efforts(design.actuators, torque, motion, 0.0, rotor=True)
    given = _efforts(design.models, torque, motion, spec.direction_speed, rotor=spec.acceleration != "none")
    row = int(np.searchsorted(time, begin - 1e-9))
    noise = _noise(sensor_suite(design.spec).encoder, n)
    tasks = []
    for i, joint in enumerate(robot.joints):
        loops = tuple(_at_inertia(own[joint], inertia) for inertia in inertias[:, i].tolist())
        linear = loops[0].k_tau_model * torque[:, i] + loops[0].k_v_model * motion[:, 1, i]
        tasks.append(
            JointTask(
                joint,
                loops,
                motion[:, 0, i].copy(),
                motion[:, 1, i].copy(),
                motion[:, 2, i].copy(),
                torque[:, i].copy(),
                needed[:, i].copy(),
                given[:, i] - linear,
                float(noise[i]),
                float(torque_noise[i]),
                row,
            )
        )
    return tasks


def _at_inertia(loop: JointLoop, inertia: float) -> JointLoop:
    """A loop with other links: their weight is in the motion's torque, and small beside the servo's stiffness."""
    return replace(
        loop,
        inertia=inertia + loop.inertia - loop.link_inertia,
        link_inertia=inertia,
        gravity_stiffness=0.0,
        sensed_inertia=0.0,
        sensed_gravity=0.0,
    )


def _dynamics(robot: Robot, motion: FloatArray, spec: TorqueLoopSpec) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(T, n) M qddot + h; (3, n) M_jj at its median, least and largest; (n,) noise of the torque a sample [N m]."""
    terms = DynamicsTerms(robot)
    scratch = terms.create_scratch()
    n = motion.shape[2]
    torque, inertias = np.empty((motion.shape[0], n)), []
    stride = max(1, motion.shape[0] // INERTIA_ROWS)
    for row, (q, v, a) in enumerate(motion):
        terms.place(scratch, q, v)
        torque[row] = terms.forces(scratch, a)
        if row % stride == 0:
            rest = terms.forces(scratch, np.zeros(n))
            inertias.append([terms.forces(scratch, unit)[i] - rest[i] for i, unit in enumerate(np.eye(n))])
    by_row = np.array(inertias)
    ordered = np.stack([np.median(by_row, axis=0), by_row.min(axis=0), by_row.max(axis=0)])
    middle = motion[motion.shape[0] // 2]
    terms.place(scratch, middle[0], np.zeros(n))
    return torque, ordered, _torque_noise(robot, terms, scratch, spec)


def _torque_noise(robot: Robot, terms: DynamicsTerms, scratch: Any, spec: TorqueLoopSpec) -> FloatArray:
    """(n,) [N m]: the F/T sensors' noise through J^T, and the accelerometer's as a gravity that trembles."""
    suite, n = sensor_suite(spec), len(robot.joints)
    weight = np.abs(terms.forces(scratch, np.zeros(n))) / GRAVITY
    variance = (weight * float(np.max(_noise(suite.accel, 3)))) ** 2 if robot.imu else np.zeros(n)
    if robot.force_torque:
        jacobian = terms.jacobian(scratch)
        each = np.concatenate([_noise(suite.force, 3), _noise(suite.torque, 3)])
        variance = variance + np.tile(each, len(robot.force_torque)) ** 2 @ jacobian**2
    return np.asarray(np.sqrt(variance))


def _noise(spec: SensorSpec, channels: int) -> FloatArray:
    """(channels,) standard deviation of a sample, its rounding included (resolution/sqrt 12)."""
    rounding = np.asarray(spec.channels("resolution", channels), dtype=np.float64) / np.sqrt(12.0)
    return np.asarray(np.hypot(spec.channels("noise", channels), rounding))


def _efforts(
    models: Sequence[ActuatorModel], torque: FloatArray, motion: FloatArray, direction_speed: float, *, rotor: bool
) -> FloatArray:
    """(T, n) effort of the models along the reference, all their effects included."""
    compensator = Compensator(models, direction_speed)
    still = np.zeros(torque.shape[1])
    return np.array(
        [
            compensator.effort(tau, v, None, q, a if rotor else still)
            for tau, (q, v, a) in zip(torque, motion, strict=True)
        ]
    )
