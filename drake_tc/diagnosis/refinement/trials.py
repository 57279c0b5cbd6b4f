"""From where a refinement starts: stretches of the training runs within a budget of time, and starting numbers.

The numbers are those of the equation error, but not those that its rows cannot tell. The rows of the equation are those
in motion. A Stribeck velocity below their speeds, or the time constant of a winding that hardly warms, ends at a bound
or beyond all sense there, where a search from it would not find the way back.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from drake_tc.actuation.model import ActuatorModel, EffectValue
from drake_tc.actuation.recorded_run import SHORTEST, longest_stretch, loop_of, recording_of
from drake_tc.effects.base import Context
from drake_tc.effects.check import plausible_range
from drake_tc.identification.output_error import Trial
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig

BUDGET = 48.0
"""Motion that is simulated at each point of the search [s], over all runs of all joints of a rig."""
LEAST_BUDGET = 12.0
"""The same of one joint at least [s]."""
LONGEST = {"position_servo": 12.0, "current": 2.0, "torque": 2.0, "voltage": 6.0}
"""Longest stretch [s] by drive: without a position loop errors add up, most of all those of a current drive."""
LEAST = 1.0
"""A stretch is at least as long [s], where the log has that much."""
MOST_TRIALS = 24
"""Stretches over all runs."""
STARTING_SHARE = 0.1
"""A coefficient without a usable estimate starts at this share of the largest value that is physically possible."""


def windows(run: Run, longest: float, share: float) -> list[slice]:
    """Stretches of one run of up to `longest` [s] each and about `share` [s] in all, evenly over the run.

    Shorter stretches than `LEAST` are left out where the run has a longer one.
    """
    usable = [s for s in run.segments() if s.stop - s.start >= SHORTEST]
    lasting = [s for s in usable if (s.stop - s.start) * run.period >= LEAST]
    size = max(round(min(longest, max(share, LEAST)) / run.period), SHORTEST)
    pieces: list[slice] = []
    for whole in lasting or usable:
        count = max(1, -(-(whole.stop - whole.start) // size))
        edges = np.linspace(whole.start, whole.stop, count + 1).astype(int)
        pieces += [slice(int(a), int(b)) for a, b in pairwise(edges) if b - a >= SHORTEST]
    count = max(1, int(share / max((np.median([p.stop - p.start for p in pieces] or [1]) * run.period), 1e-9) + 0.5))
    if count >= len(pieces):
        return pieces
    return [pieces[k] for k in np.linspace(0, len(pieces) - 1, count).round().astype(int)]


def longest_piece(lengths: Sequence[float], budget: float) -> float:
    """The longest motion [s] of each run with which runs of these lengths [s] stay within the budget [s]."""
    left, count = budget, len(lengths)
    for length in sorted(lengths):
        if length * count >= left:
            break
        left, count = left - length, count - 1
    return max(left / count, LEAST) if count else max(max(lengths), LEAST)


def trials_of(runs: Sequence[Run], rig: Rig, joint: str, step: float) -> list[Trial]:
    """What a refinement follows; a log faster than `step` [s] is thinned to it.

    A single run is dealt to two halves, which then count as runs of their own.
    """
    lengths = [sum((s.stop - s.start) * run.period for s in run.segments()) for run in runs]
    share = longest_piece(lengths, max(BUDGET / len(rig.joints), LEAST_BUDGET))
    closed = all(loop_of(rig, joint, run) is not None for run in runs)
    longest = LONGEST["position_servo" if closed else rig.drive[joint]]
    if len(runs) == 1:
        usable = longest_stretch(runs[0])
        length = 0.0 if usable is None else (usable.stop - usable.start) * runs[0].period
        longest = min(longest, max(0.5 * length, LEAST))
    found: list[Trial] = []
    for number, run in enumerate(runs):
        mine = windows(run, longest, share)[: max(1, MOST_TRIALS // len(runs))]
        for k, piece in enumerate(mine):
            half = (2 * k) // len(mine) if len(runs) == 1 else number
            found.append(_trial(run, rig, joint, piece, half, step))
    return found[:MOST_TRIALS]


def whole_runs(runs: Sequence[Run], rig: Rig, joint: str, step: float) -> list[Trial]:
    """The longest stretch of each run, as the reported free runs have it."""
    stretches = [(number, run, longest_stretch(run)) for number, run in enumerate(runs[:MOST_TRIALS])]
    return [_trial(run, rig, joint, s, number, step) for number, run, s in stretches if s is not None]


def _trial(run: Run, rig: Rig, joint: str, piece: slice, number: int, step: float) -> Trial:
    recording = recording_of(rig, joint, run, piece)
    stride = max(1, int(step / recording.period + 1e-9))
    position = run.columns[f"{joint}/position"][piece][::stride]
    return Trial(run.name, number, recording.thinned(stride) if stride > 1 else recording, position)


def start_of(model: ActuatorModel, context: Context) -> ActuatorModel:
    """The model with every effect of undetermined shape in the middle of the values that a search would try."""
    return replace(model, effects=tuple(_started(value, context) for value in model.effects))


def is_open(value: EffectValue) -> bool:
    """Whether the equation error leaves a shape of the effect undetermined: at a bound, or not to a factor of 2."""
    for parameter in value.effect.shapes:
        if parameter.name not in value.ci95:
            continue
        number, (low, high) = value.parameters[parameter.name], value.ci95[parameter.name]
        half = max(high - number, number - low)
        if parameter.name in value.at_bound or not 0.0 < half <= abs(number):
            return True
    return False


def _started(value: EffectValue, context: Context) -> EffectValue:
    if not is_open(value):
        return value
    grid = value.effect.shape_grid(context)
    numbers = dict(value.parameters)
    for parameter in value.effect.shapes:
        if parameter.name in value.ci95 and parameter.name in grid[0]:
            numbers[parameter.name] = _middle([shape[parameter.name] for shape in grid])
    for parameter in value.effect.coefficients:
        rests = parameter.name in value.at_bound or numbers.get(parameter.name) == 0.0
        most = plausible_range(parameter, context)[1]
        if parameter.name in value.ci95 and rests and parameter.lower >= 0.0 and math.isfinite(most):
            numbers[parameter.name] = STARTING_SHARE * most
    points = {name: (numbers[name], numbers[name]) for name in value.ci95}
    return EffectValue(value.key, numbers, points)


def _middle(values: list[float]) -> float:
    """Between the smallest and the largest, by their ratio where they are positive."""
    low, high = min(values), max(values)
    return math.sqrt(low * high) if low > 0.0 else float(np.median(values))
