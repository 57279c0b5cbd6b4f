"""A tick of the base estimator by centres of pressure, see `drake_tc.estimation.base_estimator`."""

import math
from typing import Any

import numpy as np

from drake_tc.kernels.base import state as base_state
from drake_tc.kernels.base.attitude import LARGEST_BIAS, attitude
from drake_tc.kernels.base.contacts import Stance, find_loads, shown_vertical, sinking
from drake_tc.kernels.base.pose import Place, find_place
from drake_tc.kernels.base.sample import (
    BREAK,
    ESTIMATOR,
    FLAT,
    SAMPLE,
    Estimator,
    Given,
    Posture,
    Sample,
    options_of,
    posture_of,
    turning,
    valid_sample,
)
from drake_tc.kernels.base.state import (
    AIR_LOAD,
    AIRBORNE,
    DROPPED,
    ENCODER_MISSING,
    ENCODER_SPIKE,
    FAILED,
    FORCE_OFFSET,
    GROUND,
    HELD_FOR,
    IMU_MISSING,
    INCONSISTENT,
    LIMITED,
    LOAD,
    LOAD_MISMATCH,
    MISMATCH,
    NO_CONTACT,
    ON,
    PAIRED,
    QUIET,
    RESTED,
    SHAPE,
    SINK,
    SLIPS,
    STARTED,
    STOOD,
    TILTED,
    TOUCHES,
    WRENCH_MISSING,
    YAW,
    YAW_DRIFT,
    Memory,
)
from drake_tc.kernels.base.velocity import UNSOLVED, Motion, find_motion, write_program
from drake_tc.kernels.compiling import OUT_VECTOR, VECTOR, helper, kernel, together
from drake_tc.kernels.linear_algebra import dot, product, times_transposed
from drake_tc.types import FloatArray

_memory_of = helper(base_state.memory_of)
_SETTLED = 0.1
"""What a contact does when it is made says nothing about the vertical; and how long one must have been in the air
before its sensor should read nothing [s]."""
_LARGEST = 1e12
"""Sum of squares of an estimate that is still one; NaN is not below it either."""
_USUAL_TIME = 0.3
"""Over which centres of pressure are averaged [s]."""
_UNLOADED = 0.25
"""Share of the load that ends a contact below which it is in the air, not on its way there."""
_AIR_TIME, _LOAD_TIME = 0.3, 1.0
"""Over which loads in the air, and the sum of loads, are averaged [s]."""


@helper
def gyro_of_foot(before: Memory, posture: Posture) -> FloatArray:
    """(3,) what the gyro would read if the most loaded foot did not turn; its bias if there is none."""
    foot = -1
    for i in range(before.contacts.shape[0]):
        row = before.contacts[i]
        if row[ON] > 0.0 and (foot < 0 or row[LOAD] > before.contacts[foot, LOAD]):
            foot = i
    if foot < 0:
        return before.bias.copy()
    return before.bias + times_transposed(posture.rotation[-1], posture.rate[-1] - posture.rate[foot])


@helper
def write_contacts(given: Given, sample: Sample, stance: Stance, found: tuple[Motion, Place], after: Memory) -> None:
    """What is remembered of the contacts, and their flags; arguments as in `find_motion` and `find_place`."""
    soles, before, options = given.soles, given.before, given.options
    (motion, place), loads, sunk, dt = found, stance.loads, stance.sunk, options.period
    all_flat, heaviest = bool(loads.on.any()), 0.0
    renewed = loads.changed or options.touchdown > 0.0
    blend = min(1.0, dt / _USUAL_TIME) if before.scalars[STARTED] and not loads.changed else 1.0
    after.held[:], after.drift[:], after.pressure[:] = place.held, motion.slip.drift, motion.found.pressure
    for i in range(soles.shape[0]):
        row, was, flat = after.contacts[i], before.contacts[i], soles[i, FLAT] > 0.0
        on, load, dropped = loads.on[i], loads.load[i], motion.slip.dropped[i]
        touched = on and not loads.new[i]
        R_WC = product(place.rotation, sunk.posture.rotation[i])
        after.foot[i] = before.foot[i] if options.touchdown and touched else R_WC
        after.foot_up[i] = loads.up[i] if renewed and not touched else before.foot_up[i]
        usual, now = before.usual[i], motion.found.pressure[i]
        after.usual[i] = usual + blend * (now - usual) if blend < 1.0 else now
        airborne, mean = 0.0 if on else was[AIRBORNE] + 1.0, was[AIR_LOAD]
        unloaded = abs(load) < max(_UNLOADED * soles[i, BREAK], 3.0 * options.force_offset)
        if unloaded and airborne * dt > _SETTLED and not sample.wrench_missing:
            mean += min(1.0, dt / _AIR_TIME) * (load - mean)
        row[ON], row[LOAD], row[DROPPED], row[AIRBORNE] = 1.0 if on else 0.0, load, dropped, airborne
        row[SINK], row[SHAPE], row[HELD_FOR], row[AIR_LOAD] = sunk.depth[i], sunk.shape[i], place.held_for[i], mean
        all_flat = all_flat and (flat or not on)
        heaviest += load if flat else 0.0
        tilted = on and flat and dot(loads.up[i], after.foot_up[i]) < math.cos(options.tilted)
        told = after.contact_flags[i]
        told[TOUCHES], told[LIMITED] = row[ON], 1.0 if on and motion.found.limited[i] else 0.0
        told[SLIPS], told[TILTED] = 1.0 if dropped > 0.0 else 0.0, 1.0 if tilted else 0.0
        told[FORCE_OFFSET] = 1.0 if abs(mean) > options.force_offset else 0.0
    mismatch = before.scalars[MISMATCH]
    if all_flat and not sample.wrench_missing:
        mismatch += min(1.0, dt / _LOAD_TIME) * (heaviest - options.weight - mismatch)
    after.scalars[MISMATCH] = mismatch


@helper
def write_base(given: Given, sample: Sample, stance: Stance, found: tuple[Motion, Place], after: Memory) -> None:
    """What is remembered of the base and the joints, and the flags of the whole; arguments as in `write_contacts`."""
    before, options, (motion, place), pose = given.before, given.options, found, stance.pose
    lever = stance.sunk.posture.velocity[-1]
    bias, scalars, told, least = pose.bias, after.scalars, False, _SETTLED / options.period
    for i in range(motion.weight.size):
        told = told or (motion.weight[i] > 0.0 and place.held_for[i] > least)
    if place.bias:
        learnt = bias - place.bias * pose.up_imu
        bias = bias if dot(learnt, learnt) > LARGEST_BIAS**2 else learnt
    scalars[STARTED], scalars[YAW], scalars[RESTED], scalars[QUIET] = 1.0, place.yaw, pose.rested, pose.quiet
    scalars[STOOD] = before.scalars[STOOD] + 1.0 if told else 0.0
    scalars[PAIRED], scalars[GROUND] = place.paired, place.ground
    after.position[:], after.rotation[:], after.velocity[:] = place.position, place.rotation, motion.found.velocity
    after.rate[:], after.lever[:], after.bias[:], after.trail[:] = pose.rate, lever, bias, pose.trail
    after.velocity_innovation[:] = 0.0
    if before.scalars[STARTED] and sample.has_accel:
        after.velocity_innovation[:] = motion.found.velocity - motion.reference
    after.q[:], after.qd[:], after.doubt[:] = sample.q, sample.qd, sample.doubt
    flags = after.flags
    flags[NO_CONTACT] = 0.0 if stance.loads.on.any() else 1.0
    flags[ENCODER_MISSING], flags[ENCODER_SPIKE] = sample.encoder_missing, sample.encoder_spike
    flags[IMU_MISSING], flags[WRENCH_MISSING] = sample.imu_missing, sample.wrench_missing
    flags[YAW_DRIFT] = 1.0 if abs(dot(bias, pose.up_imu)) > options.yaw_drift else 0.0
    flags[LOAD_MISMATCH] = 1.0 if abs(scalars[MISMATCH]) > options.force_offset else 0.0
    flags[INCONSISTENT], flags[FAILED] = place.inconsistent, 0.0


@helper
def keep(before: FloatArray, n: int, k: int, after: FloatArray) -> None:
    """The same state once more, at rest, with the flag that says so."""
    after[:] = before
    memory = _memory_of(after, n, k)
    memory.velocity[:] = 0.0
    memory.rate[:] = 0.0
    memory.lever[:] = 0.0
    memory.flags[:] = 0.0
    memory.flags[FAILED] = 1.0


@helper
def is_estimate(vector: FloatArray, memory: Memory) -> bool:
    """Whether a state holds numbers alone, but for an unknown ground, and none of the large ones of a failed tick."""
    for i in range(vector.size):
        if not abs(vector[i]) < math.inf and i != GROUND:
            return False
    size = dot(memory.position, memory.position) + dot(memory.velocity, memory.velocity)
    return size + dot(memory.held.ravel(), memory.held.ravel()) < _LARGEST


@kernel(VECTOR, SAMPLE, ESTIMATOR, together(VECTOR, OUT_VECTOR), OUT_VECTOR)
def tick(
    state: FloatArray,
    readings: tuple[FloatArray, ...],
    estimator: tuple[Any, ...],
    edge: tuple[FloatArray, FloatArray],
    out: FloatArray,
) -> bool:
    """The state after one sample; it never holds a NaN but an unknown ground.

    Args:
        state: (s,) before it, see `base.state`.
        readings: See `SAMPLE`.
        estimator: See `Estimator`.
        edge: (4 + 3k,) solution of the program at a sole's edge, see `solve_velocity`, and (5 + 13k,) that program, see
            `write_program`; written where it has to be solved.
        out: (s,) the state after it; written.

    Returns:
        Whether `out` is the answer; else the program has to be solved first.
    """
    own, (solution, program) = Estimator(*estimator), edge
    n, k = readings[0].size, own.soles.shape[0]
    options, before, after = options_of(own.settings), _memory_of(state, n, k), _memory_of(out, n, k)
    given, sample = Given(own.soles, own.tables, before, options), valid_sample(readings, before, options)
    still = posture_of(sample.q, sample.qd, estimator[4:])
    if not sample.has_gyro:
        sample.gyro[:] = gyro_of_foot(before, still)
    shown = np.zeros(3)
    if options.any_soft and options.level:
        shown = shown_vertical(given, still)
    pose = attitude(still, before, sample, options, shown)
    rigid = turning(still, pose.rate)
    loads = find_loads(given, own.between, (sample.wrench, readings[5]), rigid, pose)
    stance = Stance(pose, loads, sinking(given, rigid, loads))
    motion, problem = find_motion(given, sample, stance, solution)
    if motion.found.how == UNSOLVED:
        write_program(program, problem)
        return False
    found = motion, find_place(given, stance, motion)
    write_contacts(given, sample, stance, found, after)
    write_base(given, sample, stance, found, after)
    if not is_estimate(out, after):
        keep(state, n, k, out)
    return True
