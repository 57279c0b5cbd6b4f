"""Feedforward through the actuators' models and feedback of the torque, see `drake_tc.control.torque_control`."""

import math
from typing import Any

import numpy as np

from drake_tc.kernels import equations
from drake_tc.kernels import torque_equations as at
from drake_tc.kernels.compiling import INDEX, MATRIX, OUT_VECTOR, REAL, TABLE, VECTOR, helper, kernel, together
from drake_tc.kernels.joint_layout import DEAD_ZONE, TERM_END, TERM_FIRST, TERM_KIND
from drake_tc.kernels.torque_equations import REFERENCE_CELSIUS, JointState
from drake_tc.kernels.torque_terms import parts_of
from drake_tc.types import FloatArray, IntArray

LARGEST = 1e12
"""Inputs that sum to more than this count as not finite."""
_dead_zone_inverse, _switch_inverse = helper(equations.dead_zone_inverse), helper(equations.switch_inverse)
_needed_torque, _soft_sign = helper(equations.needed_torque), helper(equations.soft_sign)


TABLES = together(MATRIX, MATRIX, TABLE, VECTOR)
"""Of all joints, see `torque_equations`."""


@helper
def effort_of(tables: tuple[Any, ...], j: int, now: JointState, acceleration: float) -> float:
    """Effort of one joint, see `drake_tc.actuation.compensator`."""
    joints, inverses, terms, values = tables
    joint = joints[j]
    tau, velocity, direction = now.tau, now.v, now.direction
    parts = joint[at.LEVEL : at.LEVEL + 3].copy()
    for t in range(int(joint[at.TERMS]), int(joint[at.TERMS_END])):
        own = values[terms[t, TERM_FIRST] : terms[t, TERM_END]]
        level, damping, rest = parts_of(terms[t, TERM_KIND], now, own)
        parts[0] += level
        parts[1] += damping
        parts[2] += rest
    needed = _needed_torque(tau, velocity, direction, parts) + joint[at.INERTIA] * acceleration
    effort = joint[at.GAIN] * needed
    for i in range(int(joint[at.INVERSES]), int(joint[at.INVERSES_END])):
        if inverses[i, 0] == DEAD_ZONE:
            effort = _dead_zone_inverse(effort, inverses[i, 1], joint[at.SMOOTHING])
        else:
            effort = _switch_inverse(effort, direction, inverses[i, 1])
    lead = joint[at.HALF_GAP] * _soft_sign(joint[at.GAIN] * tau, joint[at.SMOOTHING])
    whole: float = effort + joint[at.COMPLIANCE] * tau + lead
    return whole


@helper
def part_of(estimate: FloatArray, reference: FloatArray, source: int, place: int) -> float:
    """A number of the motion to compensate for."""
    number: float = 0.0
    if source == 0:
        number = estimate[place]
    elif source == 1:
        number = reference[place]
    return number


@kernel(together(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR), TABLES, OUT_VECTOR)
def efforts(given: tuple[FloatArray, ...], tables: tuple[Any, ...], out: FloatArray) -> None:
    """Efforts (n,) of n joints for link torques, velocities, directions, positions, accelerations and temperatures."""
    tau, velocity, direction, position, acceleration, celsius = given
    for j in range(tau.shape[0]):
        now = JointState(position[j], velocity[j], direction[j], tau[j], celsius[j], direction[j])
        out[j] = effort_of(tables, j, now, acceleration[j])


@kernel(together(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR), INDEX, REAL, TABLES, OUT_VECTOR)
def solve(
    given: tuple[FloatArray, ...], sources: IntArray, per_speed: float, tables: tuple[Any, ...], out: FloatArray
) -> None:
    """The rows of `drake_tc.control.torque_control.SOLUTION`, n each, one behind the other.

    Args:
        given: (n,) tau_d and tau_hat [N m], (n,) q [rad], (3n,) motion as filtered, (3n,) desired motion, which is not
            looked at where nothing is taken from there, (n,) d [N m] or empty for none, (2n,) [Kp; Ki], (n,) s [N m s].
        sources: (3,) of the velocity, the direction and the acceleration: 0 the estimate, 1 the reference, 2 zero.
        per_speed: 1 over the speed that gives the direction [s/rad].
        tables: See `TABLES`.
        out: (6n,) written; NaN where an input is not finite.
    """
    (desired, estimated, position, estimate, reference, lost, gains, total), joints = given, tables[0]
    n = desired.shape[0]
    size = 0.0
    for j in range(n):
        size += abs(desired[j]) + abs(estimated[j]) + abs(position[j])
        if lost.shape[0]:
            size += abs(lost[j])
        for k in range(3):
            size += abs(part_of(estimate, reference, sources[k], (1 if k < 2 else 2) * n + j))
    if not size <= LARGEST:  # also where one is NaN
        out[:] = np.nan
        return
    for j in range(n):
        limit, integral = joints[j, at.LIMIT], gains[n + j] * total[j]
        asked = desired[j] + gains[j] * (desired[j] - estimated[j]) + integral
        torque = min(max(asked, -limit), limit)
        commanded = torque + (lost[j] if lost.shape[0] else 0.0)
        velocity = part_of(estimate, reference, sources[0], n + j)
        direction = math.tanh(part_of(estimate, reference, sources[1], n + j) * per_speed)
        acceleration = part_of(estimate, reference, sources[2], 2 * n + j)
        now = JointState(position[j], velocity, direction, commanded, REFERENCE_CELSIUS, direction)
        effort = effort_of(tables, j, now, acceleration)
        out[j] = joints[j, at.SERVO] * position[j] + effort
        out[n + j], out[2 * n + j], out[3 * n + j] = asked, torque, effort
        out[4 * n + j], out[5 * n + j] = integral, commanded
