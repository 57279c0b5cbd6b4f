"""Feedforward through the actuators' models and feedback of the torque, see `drake_tc.control.torque_control`."""

import math

import numpy as np

from drake_tc.kernels import compensation_layout as at
from drake_tc.kernels import equations
from drake_tc.kernels.compiling import INDEX, MATRIX, OUT_VECTOR, REAL, TABLE, VECTOR, helper, kernel
from drake_tc.kernels.joint_layout import DEAD_ZONE, TERM_END, TERM_FIRST, TERM_KIND
from drake_tc.kernels.torque_equations import REFERENCE_CELSIUS, JointState
from drake_tc.kernels.torque_terms import parts_of
from drake_tc.types import FloatArray, IntArray

LARGEST = 1e12
"""Inputs that sum to more than this count as not finite."""
_dead_zone_inverse, _switch_inverse = helper(equations.dead_zone_inverse), helper(equations.switch_inverse)
_needed_torque, _soft_sign = helper(equations.needed_torque), helper(equations.soft_sign)


@helper
def effort_of(
    joint: FloatArray,
    inverses: FloatArray,
    terms: IntArray,
    values: FloatArray,
    now: JointState,
    acceleration: float,
) -> float:
    """Effort of one joint, see `drake_tc.actuation.compensator`; joint is its row of the table."""
    tau, velocity, direction = now.tau, now.v, now.direction
    parts = joint[at.LEVEL : at.LEVEL + 3].copy()
    for t in range(int(joint[at.TERMS]), int(joint[at.TERMS_END])):
        own = values[terms[t, TERM_FIRST] : terms[t, TERM_END]]
        level, damping, rest = parts_of(terms[t, TERM_KIND], now, own)
        parts[0] += level
        parts[1] += damping
        parts[2] += rest
    effort = joint[at.GAIN] * _needed_torque(tau, velocity, direction, acceleration, parts, joint[at.INERTIA])
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


@kernel(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, MATRIX, MATRIX, TABLE, VECTOR, OUT_VECTOR)
def efforts(
    tau: FloatArray,
    velocity: FloatArray,
    direction: FloatArray,
    position: FloatArray,
    acceleration: FloatArray,
    celsius: FloatArray,
    joints: FloatArray,
    inverses: FloatArray,
    terms: IntArray,
    values: FloatArray,
    out: FloatArray,
) -> None:
    """Efforts (n,) of n joints for link torques; tables see `compensation_layout`."""
    for j in range(tau.shape[0]):
        now = JointState(position[j], velocity[j], direction[j], tau[j], celsius[j], direction[j])
        out[j] = effort_of(joints[j], inverses, terms, values, now, acceleration[j])


@kernel(
    *(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, INDEX, REAL),
    *(MATRIX, MATRIX, TABLE, VECTOR, OUT_VECTOR),
)
def solve(
    desired: FloatArray,
    estimated: FloatArray,
    position: FloatArray,
    estimate: FloatArray,
    reference: FloatArray,
    lost: FloatArray,
    gains: FloatArray,
    total: FloatArray,
    sources: IntArray,
    per_speed: float,
    joints: FloatArray,
    inverses: FloatArray,
    terms: IntArray,
    values: FloatArray,
    out: FloatArray,
) -> None:
    """The rows of `drake_tc.control.torque_control.SOLUTION`, n each, one behind the other.

    Args:
        desired: (n,) tau_d [N m].
        estimated: (n,) tau_hat [N m].
        position: (n,) q [rad].
        estimate: (3n,) motion as filtered.
        reference: (3n,) desired motion; not looked at where nothing is taken from there.
        lost: (n,) d [N m]; empty for none.
        gains: (2n,) [Kp; Ki].
        total: (n,) s [N m s].
        sources: (3,) of the velocity, the direction and the acceleration: 0 the estimate, 1 the reference, 2 zero.
        per_speed: 1 over the speed that gives the direction [s/rad].
        joints: See `compensation_layout`.
        inverses: The same.
        terms: The same.
        values: The same.
        out: (6n,) written; NaN where an input is not finite.
    """
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
        effort = effort_of(joints[j], inverses, terms, values, now, acceleration)
        out[j] = joints[j, at.SERVO] * position[j] + effort
        out[n + j], out[2 * n + j], out[3 * n + j] = asked, torque, effort
        out[4 * n + j], out[5 * n + j] = integral, commanded
