"""The velocity update of a tick: base velocity and centres of pressure from what the contacts carry."""

from typing import NamedTuple

import numpy as np

from drake_tc.kernels.base_attitude import Attitude
from drake_tc.kernels.base_contacts import LEAST_LOAD, Loads, Slip, slipping
from drake_tc.kernels.base_kinematics import Posture
from drake_tc.kernels.base_options import FLAT, Options
from drake_tc.kernels.base_sample import Sample
from drake_tc.kernels.base_state import DROPPED, LIMITED, STARTED, Memory
from drake_tc.kernels.base_velocity import Velocity, VelocityProblem, solve_velocity
from drake_tc.kernels.compiling import helper
from drake_tc.kernels.vectors import cross, times, times_transposed
from drake_tc.types import GRAVITY, FloatArray

_FIRST = 1e-3
"""Share of `velocity_time` that the rest before the first tick is trusted."""


class Motion(NamedTuple):
    """What stage 1 finds.

    Attributes:
        found: Velocity and centres of pressure. reference: (3,) what the accelerometer carried on [m/s].
        slip: What was dropped. weight: (k,) loads of the contacts that count [N].
    """

    found: Velocity
    reference: FloatArray
    slip: Slip
    weight: FloatArray


@helper
def predicted_velocity(
    before: Memory, sample: Sample, posture: Posture, pose: Attitude, loads: Loads, dt: float
) -> FloatArray:
    """(3,) ydot_ref: the last velocity, and what the accelerometer adds to it [m/s]; arguments as in `find_motion`."""
    if not before.scalars[STARTED] or not (sample.has_accel or loads.on.any()):
        return np.zeros(3)  # nothing says how the base moves: it is held
    moved = times(before.rotation, before.velocity + before.lever)
    reference: FloatArray = times_transposed(pose.predicted, moved) - posture.velocity[-1]
    if sample.has_accel:
        reference += dt * (pose.accel - GRAVITY * pose.up)
    return reference


@helper
def find_motion(
    soles: FloatArray,
    before: Memory,
    sample: Sample,
    posture: Posture,
    pose: Attitude,
    loads: Loads,
    solution: FloatArray,
    options: Options,
) -> tuple[Motion, VelocityProblem]:
    """Base velocity and centres of pressure; and the program that says what they are.

    Args:
        soles: (k, w) rows of the contacts.
        before: The state before the tick.
        sample: Readings after validation.
        posture: Contacts against the base.
        pose: Orientation.
        loads: What the contacts carry.
        solution: Of the program, see `solve_velocity`.
        options: Of the estimator.
    """
    k, dt, first = soles.shape[0], options.period, not before.scalars[STARTED]
    reference = predicted_velocity(before, sample, posture, pose, loads, dt)
    matrix, still, against = np.empty((k, 3, 2)), np.empty((k, 3)), np.empty((k, 3))
    spread, new, at_edge = np.empty(k), loads.new.copy(), False
    for i in range(k):
        still[i] = posture.velocity[i]
        for axis in range(2):
            column = cross(posture.rate[i], posture.rotation[i, :, axis])
            for a in range(3):
                matrix[i, a, axis] = column[a]
                still[i, a] += column[a] * loads.pressure[i, axis]
        against[i] = -still[i] - reference
        spread[i] = soles[i, FLAT] * options.cop_moment / max(loads.wrench[i, 2], LEAST_LOAD)
        new[i] = new[i] or first
        at_edge = at_edge or before.contact_flags[i, LIMITED] > 0.0
    last = Slip(before.drift, before.contacts[:, DROPPED].copy())
    slip = slipping(loads.on, new, loads.load, against, last, options)
    weight = np.zeros(k)
    for i in range(k):
        if loads.on[i] and not slip.dropped[i]:
            weight[i] = max(loads.load[i], LEAST_LOAD)
    total = weight.sum()
    trust = (_FIRST if first else 1.0) * options.velocity_time / dt / options.contact_velocity**2
    share = weight / (total if total > 0.0 else 1.0)
    problem = VelocityProblem(reference, trust, matrix, still, loads.pressure, spread, share, options.contact_velocity)
    return Motion(solve_velocity(problem, soles, at_edge, solution), reference, slip, weight), problem


@helper
def write_program(out: FloatArray, problem: VelocityProblem) -> None:
    """[ydot_ref, c, s_d, C_i, D_i + C_i x_cop, x_cop, s_m/f_i, w_i] into (5 + 13k,)."""
    k = problem.weight.size
    out[:3], out[3], out[4] = problem.reference, problem.trust, problem.deviation
    out[5 : 5 + 6 * k], out[5 + 6 * k : 5 + 9 * k] = problem.matrix.ravel(), problem.still.ravel()
    out[5 + 9 * k : 5 + 11 * k] = problem.pressure.ravel()
    out[5 + 11 * k : 5 + 12 * k], out[5 + 12 * k :] = problem.spread, problem.weight
