"""Which stretches of the training runs a refinement follows: some of each run, within a budget of simulated time."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from drake_tc.diagnosis.data.recordings import SHORTEST, longest_stretch, loop_of, recording_of
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
