"""Which motions the tests of Del Prete and Mansard (2015) take: a rule on the classic controller alone.

Of all candidates that the classic controller follows (a solution at every state, the task's error below 1e-3 m/s^2),
the one over whose states p spreads most evenly over 0 to 100: the largest entropy of p in tenths. In tests 1 and 2 the
classic controller is the one without force regularisation, from 3 on the one with it, as in the paper.

The grid of reaches was laid after trials, with robust controllers too, in which nearer bounds on the capture point and
other goals left classic and robust ones without solution; the rule chose within it.
"""

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from drake_tc.diagrams.papers.delprete2015.com_move import Sway, tenths
from drake_tc.diagrams.papers.delprete2015.probability import probability
from drake_tc.diagrams.papers.delprete2015.reach import Goal
from drake_tc.diagrams.papers.delprete2015.setup import torque_error
from drake_tc.diagrams.papers.delprete2015.simulation import Moment
from drake_tc.diagrams.papers.delprete2015.torque_safety import SAMPLES
from drake_tc.tsid.robust.scaled import p_ind
from drake_tc.types import FloatArray

LENGTHS = (0.20, 0.22, 0.24, 0.26)
AZIMUTHS = (0.0, 30.0, 45.0, 60.0, 75.0, 90.0)
AHEAD = (0.0, 0.015, 0.03)
LOWERED = (0.0, 0.02)
FOLLOWED = 1e-3
"""Largest error of the task [m/s^2]."""
OFFSETS = ((0.6, 0.1, 0.2), (0.7, 0.2, 0.2), (0.75, 0.0, 0.1), (0.75, 0.1, 0.1))
RISES = (4.0, 5.0)
MARGINS = (0.05, 0.06, 0.07, 0.08)
STRIDE = 8
"""States between those at which p is computed."""


@dataclass(frozen=True, eq=False)
class Coverage:
    """What the classic controller makes of one candidate.

    Attributes:
        followed: Whether it has a solution at every state and follows the centre of mass.
        tenths: (10,) states with p in each tenth.
        mean: Of p.
        error: Mean |p - p_ind|; takes no part in the choice.
    """

    followed: bool
    tenths: FloatArray
    mean: float
    error: float

    @property
    def entropy(self) -> float:
        """Of the tenths, 1 where all are visited alike; -1 where the candidate is not followed."""
        if not self.followed:
            return -1.0
        share = self.tenths[self.tenths > 0.0] / self.tenths.sum()
        return float(-(share * np.log(share)).sum() / np.log(self.tenths.size))


def candidates() -> list[Sway]:
    """All: from 20 cm, as in the paper, to a third more; all directions; the middle ahead and lowered, or not."""
    return [Sway(*numbers) for numbers in itertools.product(LENGTHS, AZIMUTHS, AHEAD, LOWERED)]


def goals() -> list[Goal]:
    """Of the reach."""
    return [Goal(*numbers) for numbers in itertools.product(OFFSETS, RISES, MARGINS)]


def coverage(moments: Iterable[Moment], seed: int = 0) -> Coverage:
    """Of one candidate's motion."""
    states, error = [], torque_error()
    for state in moments:
        if not state.solved or state.task_error(3) > FOLLOWED:
            return Coverage(False, np.zeros(10), np.nan, np.nan)
        states.append(state)
    some = states[::STRIDE]
    p = np.array([probability(s.truth.polytope, s.torque, error, samples=SAMPLES, seed=seed).value for s in some])
    near = np.array([p_ind(s.truth.polytope, s.torque, error) for s in some])
    return Coverage(True, tenths(p), float(p.mean()), float(np.abs(p - near).mean()))
