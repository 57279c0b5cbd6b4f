"""Angles that jump and stay there: an encoder that lost its zero, or rows that a logger dropped without a gap in time.

No joint moves like this. The steps s_k = q_{k+1} - q_k of a joint differ from those around them by what it accelerates,
so a step that is far larger than all others is a step of the reading.
"""

import numpy as np
from scipy.ndimage import median_filter

from drake_tc.logs.columns import RawLog, file_row
from drake_tc.logs.rig import Rig
from drake_tc.types import BoolArray, FloatArray, IntArray

NEIGHBOURHOOD = 9
"""Steps whose median is what the joint does there."""
ALONE, AROUND = 10.0, 10
"""A jump departs so many times further from that median than any other step within so many rows: an impact rings."""
LARGEST = 3.0
"""And is so many times larger than the largest other step of the run: no motion of this joint is as fast."""
MANY_STEPS = 30.0
"""And so many of the encoder's smallest steps: the last digit flickers."""
LONG = 1.5
"""Periods from which on rows are missing between two samples; the joint moved on meanwhile."""
MOST = 5
"""Jumps of one column; more of them are no lost zero."""


def jumps(time: FloatArray, angle: FloatArray) -> IntArray:
    """Rows k (m,) whose angle [rad] jumps until row k + 1 and stays there; NaN are left out, and spikes are no jumps.

    Args:
        time: (T,) [s].
        angle: (T,) [rad].
    """
    at = np.flatnonzero(np.isfinite(angle))
    if at.size < 20 * NEIGHBOURHOOD:
        return np.empty(0, dtype=np.int64)
    steps = np.diff(angle[at])
    periods = np.diff(time[at])
    departure = np.abs(steps - median_filter(steps, NEIGHBOURHOOD, mode="nearest"))
    size = np.abs(steps)
    finest = float(np.min(size, where=size > 0.0, initial=np.inf))
    candidates = np.flatnonzero((departure > MANY_STEPS * finest) & (periods < LONG * np.median(periods)))
    candidates = candidates[np.argsort(-departure[candidates])][: MOST + 1]
    found = np.array([k for k in candidates.tolist() if _alone(departure, k)], dtype=np.int64)
    others = float(np.delete(size, found).max(initial=0.0))
    found = np.sort(found[departure[found] > LARGEST * others])
    return at[found] if found.size <= MOST else np.empty(0, dtype=np.int64)


def _alone(departure: FloatArray, k: int) -> bool:
    around = departure[max(k - AROUND, 0) : k + AROUND + 1]
    return bool(departure[k] > ALONE * np.delete(around, min(k, AROUND)).max(initial=0.0))


def find_jumps(raw: RawLog, rig: Rig) -> tuple[BoolArray, tuple[str, ...]]:
    """Rows (T,) on both sides of jumps of the joints' positions, where the run is to be split, and notes."""
    beside, notes = np.zeros(raw.time.size, dtype=bool), []
    for name in (f"{joint}/position" for joint in rig.joints if joint not in raw.speed_only):
        rows = jumps(raw.time, raw.columns[name])
        for k in rows.tolist():
            end = k + 1 + int(np.argmax(np.isfinite(raw.columns[name][k + 1 :])))
            beside[k : end + 1] = True
            size = float(raw.columns[name][end] - raw.columns[name][k])
            notes.append(
                f"Column {name} jumps by {size:.3g} rad at {raw.time[end] - raw.time[0]:.6g} s"
                f" ({file_row(raw.path, end)}) and stays there. The joint moves so fast nowhere else: the encoder lost"
                " its zero, or rows are missing. The run was split there. If the zero was lost, cut the log there, and"
                " leave one part out or correct its zero."
            )
    return beside, tuple(notes)
