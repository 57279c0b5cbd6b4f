"""Whether a position servo holds its command between samples.

A goal that is written once a cycle acts unchanged until the next one, so the command that acts at a sample is on
average half a period T/2 older than the one recorded there. Taken for a continuous command, a stiffness K makes of it
a viscous friction that is too large by K T/2, and a delay of T/2. Free runs hold the command too.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from drake_tc.diagnosis.data.load_scale import load_scale
from drake_tc.diagnosis.data.preparation import context_of
from drake_tc.diagnosis.data.samples import HELD, Samples
from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.diagnosis.problem.declared import declared_terms, fit_declared, known_taken_off
from drake_tc.diagnosis.problem.resampling import better_share
from drake_tc.diagnosis.thresholds import CERTAINLY_BETTER, HELD_CERTAIN, HELD_FROM_PERIOD
from drake_tc.effects.base import Effect
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray


def command_is_held(build: Callable[..., Samples], rig: Rig, joint: str, loads: Sequence[Effect]) -> bool:
    """As the rig file states; else true of a position servo on a slow clock whose training runs say so.

    They say so where the declared model, with a rotor inertia, leaves a smaller error in 90 % of the block resamples
    when the command is taken to hold. What counts are the rows that lie alike on both sides of a reversal: friction
    that turns over within a small speed looks like an older command in the others. A log of few reversals has few such
    rows. Where more than half of their resamples, but fewer than 90 %, speak for a held command, all rows decide, and
    98 % of their resamples must.

    Args:
        build: Makes the training samples; takes `effort_age` and `both_sides`.
        rig: Says drive and load.
        joint: Which joint.
        loads: What an unknown load may be.
    """
    if rig.command_hold is not None or rig.drive[joint] != "position_servo":
        return bool(rig.command_hold)
    load = rig.load[joint]
    if isinstance(load, RobotLoad) and load.fitted:
        return bool(build().signals.period >= HELD_FROM_PERIOD)  # the load is not yet fitted
    alike = drop_by_hold(partial(build, both_sides=True), rig, joint, loads)
    if alike.size == 0:
        return False
    share = better_share(alike)
    if 0.5 < share < HELD_CERTAIN:
        return better_share(drop_by_hold(build, rig, joint, loads)) >= CERTAINLY_BETTER
    return share >= HELD_CERTAIN


def drop_by_hold(build: Callable[..., Samples], rig: Rig, joint: str, loads: Sequence[Effect]) -> FloatArray:
    """(B,) by how much the squared error of each block drops if the command is held, over the mean of all blocks.

    Empty on a fast clock. One number where the kernels leave other rows: nothing can be compared block by block.

    Args:
        build: Makes the training samples; takes `effort_age`.
        rig: Says drive and load.
        joint: A position servo.
        loads: What an unknown load may be.
    """
    continuous = build()
    if continuous.signals.period < HELD_FROM_PERIOD:
        return np.zeros(0)
    both = (known_taken_off(each, rig, joint) for each in (continuous, build(effort_age=HELD)))
    without, with_hold = (_block_errors(each, rig, joint, loads) for each in both)
    if without.size != with_hold.size:
        return np.array([1.0 - with_hold.sum() / without.sum()])
    return np.asarray((without - with_hold) / without.mean())


def _block_errors(samples: Samples, rig: Rig, joint: str, loads: Sequence[Effect]) -> FloatArray:
    """(B,) cross-validated squared error by block of the declared model with a rotor inertia [effort^2]."""
    names = declared_terms(rig, joint)
    inertia = [] if samples.load_unknown or "rotor_inertia" in rig.declared[joint] else ["rotor_inertia"]
    columns = Columns(samples, declared_gain=load_scale(rig, joint).gain)
    return fit_declared(columns, [*names, *inertia], context_of(samples, rig, joint), loads).block_sse
