"""What drive effects leave of an effort that alone tells the torques.

Without a known torque a dead zone or a limit could explain the effort, or its noise, by taking it away. An error is
therefore told as a share of the effort that is left.
"""

from collections.abc import Sequence

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, Term

NUDGE = 1e-3
"""Step of the difference quotient over the standard deviation of the effort."""


def effort_left(columns: Columns, terms: Sequence[Term]) -> float:
    """Share of the effort y that the drive effects f among the terms leave; 1 where the effort is not the target.

    The smaller of std(f(y))/std(y) and the RMS of the slope df/dy, which is the share of white noise that passes f.
    """
    if not columns.effort_is_target or not columns.drives(terms):
        return 1.0
    whole = max(float(np.std(columns.effort(()))), 1e-300)
    return min(float(np.std(columns.effort(terms))) / whole, _noise_passed(columns, terms, NUDGE * whole))


def _noise_passed(columns: Columns, terms: Sequence[Term], nudge: float) -> float:
    """RMS over the rows of the slope of the effort after the drive effects over that before, at most 1."""
    high, low = (columns.acting_effort(terms, by) for by in (nudge, -nudge))
    slope = (high - low)[columns.samples.rows] / (2.0 * nudge)
    return min(float(np.sqrt(np.mean(slope**2))), 1.0)
