"""Joint torques from what the sensors say at one instant, see `drake_tc.estimation.torque_model`.

The plant has no gravity and its base has the proper acceleration of the IMU. With the wrench F_i = [moment about Bo;
force] that all bodies from i outwards need for their motion, by recursive Newton-Euler (`dynamics`), and the reading W
of a sensor in row i as such a wrench:

    E = F_i + W;   F_j <- F_j - E for each j from the contact's body to the base      (sensors farther out first)
    f_u = F_0;     F_j <- F_j - f_u for each j from the unknown link to the base
    tau_j = s_j . F_j

The sensors stand in the tree as joints with a zero axis, which neither move nor take a torque.

`joint_forces` and `motion_torque` are what a desired motion and the feedback on it need.
"""

from typing import Any, NamedTuple

import numpy as np

from drake_tc.kernels.compiling import INDEX, MATRIX, OUT_VECTOR, REAL, TABLE, VECTOR, helper, kernel, together
from drake_tc.kernels.dynamics import (
    BODY_WIDTH,
    Motion,
    Tree,
    add_joint_accelerations,
    add_joint_forces,
    carry_along,
    cross_into,
    frame_motion,
    frame_pose,
    move,
    rotate_into,
    wrenches_needed,
)
from drake_tc.types import FloatArray, IntArray

_PLACE, _VELOCITY = 9, 18
_GYRO, _ZERO = 0, 2
"""Of the angular acceleration: the gyro's derivative, or none of the base; 1 is none of the IMU's link."""
_STILL, _UNKNOWN = 12, 18
"""Where the acceleration of a base at rest and the place of the unknown wrench stand in `base`."""


@helper
def imu_acceleration(bodies: FloatArray, picks: IntArray, pose: FloatArray, imu: FloatArray, out: FloatArray) -> None:
    """[alpha; a] of the base into out[:6], from bodies whose base has none yet; pose (12,) of the IMU."""
    row, mode = picks[0], picks[1]
    seen, motion = np.empty(6), np.empty(12)
    rotate_into(seen, 0, pose, imu, 6)
    rotate_into(seen, 3, pose, imu, 3)
    frame_motion(bodies, row, pose, 9, motion)
    for k in range(3):
        out[k] = 0.0
        if mode != _ZERO:
            out[k] = (seen[k] if mode == _GYRO else 0.0) - motion[6 + k]
    cross_into(out, 3, out, 0, pose, 9)
    for k in range(3):
        out[3 + k] = seen[3 + k] - motion[9 + k] - out[3 + k]


ROBOT = together(TABLE, MATRIX, VECTOR, VECTOR, INDEX, TABLE, MATRIX)


class Robot(NamedTuple):
    """What does not change with the readings.

    Attributes:
        places, constants: Tree of joints and sensors, see `dynamics`.
        trunk: (10,) the base's body.
        base: (21,) the IMU's frame (12) in its body, [alpha; a] of a base without IMU, and the place from the unknown
            link's body of the unknown wrench.
        picks: Row of the IMU's body, -1 where the base is at rest; source of the angular acceleration: 0 the gyro's
            derivative, 1 none of the IMU's link, 2 none of the base; row of the unknown link's body.
        sensors: (k, 3) number of the sensor, rows of its own and of its contact's body; those farther out first.
        frames: (2k, 12) sensor frame and contact frame of each in these bodies.
    """

    places: IntArray
    constants: FloatArray
    trunk: FloatArray
    base: FloatArray
    picks: IntArray
    sensors: IntArray
    frames: FloatArray


@helper
def carry_base(joint: FloatArray, imu: FloatArray, robot: Robot) -> FloatArray:
    """(rows + 1, 30) all bodies as they move, the base as its IMU says; arguments as `estimate`."""
    places, constants, base, picks = robot.places, robot.constants, robot.base, robot.picks
    n, row = joint.shape[0] // 3, picks[0]
    q, v, vdot = joint[:n], joint[n : 2 * n], joint[2 * n :]
    bodies = np.empty((places.shape[0] + 1, BODY_WIDTH))
    root, pose, acceleration = np.zeros(13), np.empty(12), np.empty(6)
    root[0] = 1.0
    if row >= 0:
        if row > 0:
            move(Motion(root, q, v), places, constants, bodies)
            frame_pose(bodies, row, base, pose)
            rotate_into(root, 7, pose, imu, 0)
            for k in range(3):
                root[7 + k] -= bodies[row, _VELOCITY + k]
        else:
            rotate_into(root, 7, base, imu, 0)
    move(Motion(root, q, v), places, constants, bodies)
    add_joint_accelerations(bodies, places, vdot)
    if row >= 0:
        frame_pose(bodies, row, base, pose)
        imu_acceleration(bodies, picks, pose, imu, acceleration)
    else:
        acceleration[:] = base[_STILL : _STILL + 6]
    carry_along(bodies, acceleration)
    return bodies


@helper
def take_out(loads: FloatArray, places: IntArray, row: int, wrench: FloatArray) -> None:
    """F_j <- F_j - wrench (6,) for each j from `row` to the base."""
    while True:
        for k in range(6):
            loads[row, k] -= wrench[k]
        if row == 0:
            return
        row = places[row - 1, 0]


@helper
def wrench_at(wrench: FloatArray, place: FloatArray, at: int, out: FloatArray, to: int) -> None:
    """[force; moment] at place[at : at + 3] from Bo of [moment about Bo; force], into out[to : to + 6]."""
    cross_into(out, to + 3, place, at, wrench, 3)
    for k in range(3):
        out[to + k] = wrench[3 + k]
        out[to + 3 + k] = wrench[k] - out[to + 3 + k]


@kernel(together(VECTOR, VECTOR, VECTOR), ROBOT, REAL, OUT_VECTOR)
def estimate(sensed: tuple[FloatArray, ...], robot: tuple[Any, ...], largest: float, out: FloatArray) -> None:
    """Torques, unknown wrench, contact wrenches and fault, one behind the other.

    Args:
        sensed: (3n,) [q; qdot; qddot]; (9,) or more, [gyro; accel; d gyro/dt] in the IMU's frame; (6k,) W = [f; t] of
            the sensors, in their frames.
        robot: See `Robot`.
        largest: Inputs from this size on are taken for missing.
        out: (n + 6 + 6k + 1,) written; zeros and a 1 behind them where an input is missing.
    """
    (joint, imu, readings), own = sensed, Robot(*robot)
    places, picks, sensors, frames = own.places, own.picks, own.sensors, own.frames
    n = joint.shape[0] // 3
    out[:] = 0.0
    for array in sensed:
        for i in range(array.shape[0]):
            if not abs(array[i]) < largest:  # also where it is NaN
                out[out.shape[0] - 1] = 1.0
                return
    bodies = carry_base(joint, imu, own)
    loads = wrenches_needed(bodies, Tree(places, own.constants, own.trunk))
    pose, wrench = np.empty(12), np.empty(6)
    for i in range(sensors.shape[0]):
        at, row, touched = 6 * sensors[i, 0], sensors[i, 1], sensors[i, 2]
        frame_pose(bodies, row, frames[2 * i], pose)
        rotate_into(wrench, 3, pose, readings, at)
        cross_into(wrench, 0, pose, 9, wrench, 3)
        rotate_into(pose, 9, pose, readings, at + 3)
        for k in range(3):
            wrench[k] += pose[9 + k] + loads[row, k]
            wrench[3 + k] += loads[row, 3 + k]
        frame_pose(bodies, touched, frames[2 * i + 1], pose)
        wrench_at(wrench, pose, 9, out, n + 6 + at)
        take_out(loads, places, touched, wrench)
    rotate_into(pose, 9, bodies[picks[2]], own.base, _UNKNOWN)
    for k in range(3):
        pose[9 + k] += bodies[picks[2], _PLACE + k]
    wrench[:] = loads[0]
    wrench_at(wrench, pose, 9, out, n)
    take_out(loads, places, picks[2], wrench)
    add_joint_forces(bodies, loads, places, out)


TREE = together(TABLE, MATRIX, VECTOR)
"""places and constants of a tree, see `dynamics`, and (10,) the base's body."""


@kernel(together(VECTOR, VECTOR, VECTOR), TREE, VECTOR, OUT_VECTOR)
def joint_forces(motion: tuple[FloatArray, ...], tree: tuple[Any, ...], base: FloatArray, out: FloatArray) -> None:
    """M vdot + h (n,) of the joints, on a base that moves as given.

    Args:
        motion: (n,) q, v and vdot.
        tree: See `TREE`.
        base: (19,) quaternion and place of the base, [omega; v], and [alpha; proper acceleration] of its origin.
        out: (n,) written.
    """
    (q, v, vdot), own = motion, Tree(*tree)
    places = own.places
    bodies = np.empty((places.shape[0] + 1, BODY_WIDTH))
    move(Motion(base, q, v), places, own.constants, bodies)
    add_joint_accelerations(bodies, places, vdot)
    carry_along(bodies, base[13:19])
    loads = wrenches_needed(bodies, own)
    out[:] = 0.0
    add_joint_forces(bodies, loads, places, out)


LARGEST = 1e12
"""Inputs beyond this count as not finite."""


@kernel(together(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR), TREE, VECTOR, OUT_VECTOR)
def motion_torque(given: tuple[FloatArray, ...], tree: tuple[Any, ...], base: FloatArray, out: FloatArray) -> bool:
    """[M qddot_d + h; its sum with Ks e and Kd edot; Ks e; Kd edot] (4n,) into out.

    Args:
        given: (3n,) estimate [q; qdot; qddot] and reference; (n,) q to take in e, empty for that of the estimate;
            inputs of which only is asked whether they are finite; (2n,) or more, [Ks; Kd]; (2n,) or more, [q; qdot]
            where M and h are taken.
        tree: See `TREE`.
        base: See `joint_forces`.
        out: (4n,) written.

    Returns:
        Whether all inputs are finite; else the second part of `out` is NaN and the others are not to be used.
    """
    estimate, reference, position, others, gains, place = given
    n = estimate.shape[0] // 3
    finite = True
    for j in range(3 * n):
        error = reference[j] - estimate[j]
        if j < n and position.shape[0]:
            error = reference[j] - position[j]
        finite = finite and abs(estimate[j]) <= LARGEST and abs(error) <= LARGEST  # not where one is NaN
        if j < 2 * n:
            out[2 * n + j] = gains[j] * error
    for j in range(others.shape[0]):
        finite = finite and abs(others[j]) <= LARGEST
    if not finite:
        out[n : 2 * n] = np.nan
        return False
    joint_forces((place[:n], place[n : 2 * n], reference[2 * n :]), tree, base, out[:n])
    for j in range(n):
        out[n + j] = out[j] + (out[2 * n + j] + out[3 * n + j])
    return True
