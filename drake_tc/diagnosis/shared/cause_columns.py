"""Columns of the causes: by how much each joint's estimated torque errs per unit of a cause.

With tau_meas what the robot's model makes of its sensors and tau the truth,

    tau_meas = tau + sum_k C_k delta_k                                                      (shared)

    link_mass     delta: model's mass less the true one; the link's shape and centre of mass stay [kg]
    link_com      the same of the centre of mass, at the same mass and inertia about it (first order) [m]
    encoder_offset  q_meas = q + b of one joint [rad, m]: all loads are computed from the measured positions
    payload       delta: the ten parameters of the link that carries it in the model less the true ones
    ft_bias       W_meas = W + b [N, N m]
    ft_gain       W_meas = (1 + s) W, one s for the forces and one for the torques; delta = s/(1 + s)
    ft_alignment  f_meas = f + r x f, t_meas = t + r x t (first order in r) [rad]
    imu_bias      gyro_meas = gyro + b_g, accel_meas = accel + b_a (first order in b_g) [rad/s, m/s^2]
    imu_gain      accel_meas = (1 + s) accel; delta = s/(1 + s)
    imu_alignment gyro_meas = gyro + r x gyro, accel_meas = accel + r x accel (first order in r) [rad]

of a link of mass m, centre of mass c and inertia I about its origin O, which moves with omega, alpha and the proper
acceleration a of O, the force and moment at O that it needs are

    F = m (a + alpha x c + omega x (omega x c)),   N = c x m a + I alpha + omega x I omega

and joint j, with its axis z through P, bears  z . (N + (p_O - P) x F)  of each link beyond it that no F/T sensor bears,
less  z . (t + (p_S - P) x f)  of each sensor's reading.  Source: derived from Del Prete et al., 2016, Algorithm 1.
"""

from collections.abc import Callable, Sequence

import numpy as np

from drake_tc.diagnosis.shared.body_motion import BodyMotion, Link, Structure
from drake_tc.estimation.off_line import Row
from drake_tc.estimation.plant import skew
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.types import BoolArray, FloatArray

STEP = 1e-4
"""Of central differences over a joint's position [rad, m]."""


def at_joints(
    motion: BodyMotion, origin: FloatArray, force: FloatArray, moment: FloatArray, slides: BoolArray
) -> FloatArray:
    """(T, n, p) what wrenches (T, 3, p) at points `origin` (T, 3) would put on every joint, as if all bore them."""
    arm = origin[:, None, :] - motion.pivot
    turning = np.einsum("tja,tap->tjp", motion.axis, moment)
    turning += np.einsum("tja,tjab,tbp->tjp", motion.axis, skew(arm), force)
    pushing = np.einsum("tja,tap->tjp", motion.axis, force)
    return np.asarray(np.where(slides[None, :, None], pushing, turning))


def _rigid(motion: BodyMotion, index: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(A, alpha, omega): A (T, 3, 3) with A r = alpha x r + omega x (omega x r), for one link."""
    alpha, omega = motion.alpha[:, index], motion.omega[:, index]
    return skew(alpha) + skew(omega) @ skew(omega), alpha, omega


def mass_column(motion: BodyMotion, link: Link, index: int, slides: BoolArray) -> FloatArray:
    """(T, n, 1) [N m/kg]."""
    force, moment = link_wrench(motion, link, index)
    column = at_joints(motion, motion.position[:, index], force[..., None], moment[..., None], slides)
    return np.asarray(column * link.loads[None, :, None] / link.mass)


def link_wrench(motion: BodyMotion, link: Link, index: int) -> tuple[FloatArray, FloatArray]:
    """F, N (T, 3) of the link, base axes [N, N m]."""
    turn, alpha, omega = _rigid(motion, index)
    rotation, proper = motion.rotation[:, index], motion.proper[:, index]
    com = rotation @ link.com
    inertia = rotation @ link.inertia @ np.swapaxes(rotation, 1, 2)
    force = link.mass * (proper + np.einsum("tab,tb->ta", turn, com))
    moment = np.cross(com, link.mass * proper) + np.einsum("tab,tb->ta", inertia, alpha)
    moment += np.cross(omega, np.einsum("tab,tb->ta", inertia, omega))
    return force, moment


def com_columns(motion: BodyMotion, link: Link, index: int, slides: BoolArray) -> FloatArray:
    """(T, n, 3) [N m/m], by the link's axes."""
    turn, alpha, omega = _rigid(motion, index)
    rotation, proper = motion.rotation[:, index], motion.proper[:, index]
    force = link.mass * turn @ rotation
    moment = -link.mass * skew(proper) @ rotation
    for k in range(3):
        unit = np.eye(3)[k]
        shift = 2.0 * link.com[k] * np.eye(3) - np.outer(unit, link.com) - np.outer(link.com, unit)
        inertia = link.mass * rotation @ shift @ np.swapaxes(rotation, 1, 2)
        moment[:, :, k] += np.einsum("tab,tb->ta", inertia, alpha)
        moment[:, :, k] += np.cross(omega, np.einsum("tab,tb->ta", inertia, omega))
    column = at_joints(motion, motion.position[:, index], force, moment, slides)
    return np.asarray(column * link.loads[None, :, None])


def reading_columns(motion: BodyMotion, structure: Structure, sensor: int, slides: BoolArray) -> FloatArray:
    """(T, n, 6) of a reading [f; t] of one F/T sensor, in its own axes [N m/N, 1]."""
    rotation = motion.sensor_rotation[:, sensor]
    nil = np.zeros_like(rotation)
    force, moment = np.concatenate([rotation, nil], axis=2), np.concatenate([nil, rotation], axis=2)
    column = at_joints(motion, motion.sensor[:, sensor], force, moment, slides)
    return np.asarray(-column * structure.above_sensor[sensor][None, :, None])


def gain_columns(reading: FloatArray, wrench: FloatArray) -> FloatArray:
    """(T, n, 2) of a sensor's forces and torques, from `reading_columns` and its readings (T, 6)."""
    each = reading * wrench[:, None, :]
    return np.stack([each[:, :, :3].sum(axis=2), each[:, :, 3:].sum(axis=2)], axis=2)


def alignment_columns(reading: FloatArray, wrench: FloatArray) -> FloatArray:
    """(T, n, 3) [N m/rad] of a sensor that is turned about its own axes, from `reading_columns` and its readings."""
    turned = np.concatenate([-skew(wrench[:, :3]), -skew(wrench[:, 3:])], axis=1)
    return np.asarray(np.einsum("tjp,tpr->tjr", reading, turned))


def accelerometer_columns(motion: BodyMotion, structure: Structure, slides: BoolArray) -> FloatArray:
    """(T, n, 3) [N m/(m/s^2)], by the IMU's axes: as if all links fell that much slower."""
    total = np.zeros((*motion.axis.shape[:2], 3))
    for index, link in enumerate(structure.links):
        force = link.mass * motion.imu_rotation
        moment = link.mass * skew(motion.rotation[:, index] @ link.com) @ motion.imu_rotation
        total += at_joints(motion, motion.position[:, index], force, moment, slides) * link.loads[None, :, None]
    return total


def motion_torque(motion: BodyMotion, structure: Structure, slides: BoolArray) -> FloatArray:
    """(T, n) what the links between base and F/T sensors put on the joints [N m]."""
    total = np.zeros(motion.axis.shape[:2])
    for index, link in enumerate(structure.links):
        total += mass_column(motion, link, index, slides)[:, :, 0] * link.mass
    return total


def gyro_columns(at: Callable[[FloatArray], BodyMotion], structure: Structure, slides: BoolArray) -> FloatArray:
    """(T, n, 3) by forward differences of 1e-4: [N m/(rad/s)] of the gyro's bias, [N m/rad] of the IMU's alignment.

    Args:
        at: The motion with an offset (3,) on the gyro [rad/s], or with the IMU turned by that much [rad].
        structure: Links.
        slides: (n,) prismatic joints.
    """
    step = 1e-4
    here = motion_torque(at(np.zeros(3)), structure, slides)
    columns = [(motion_torque(at(step * axis), structure, slides) - here) / step for axis in np.eye(3)]
    return np.stack(columns, axis=2)


def encoder_columns(model: TorqueModel, rows: Sequence[Row], offsets: FloatArray) -> FloatArray:
    """(T, n, n) by how much the loads grow with the offset of each joint's encoder [N m/rad, N].

    The slope over an offset that is known roughly, (tau(q) - tau(q - b))/b; of the others d tau/dq, by central
    differences of 1e-4.

    Args:
        model: Of the robot.
        rows: Instants as recorded.
        offsets: (n,) b; 0 where nothing is known.
    """
    q, *others = (np.array(each) for each in zip(*rows, strict=True))
    size = q.shape[1]
    ahead, behind = np.where(offsets == 0.0, STEP, 0.0), np.where(offsets == 0.0, STEP, offsets)
    columns = np.empty((len(rows), size, size))
    for joint, one in enumerate(np.eye(size)):
        ends = (model.estimate_log(q + shift[joint] * one, *others)[:, :size] for shift in (ahead, -behind))
        columns[:, :, joint] = np.subtract(*ends) / (ahead + behind)[joint]
    return columns
