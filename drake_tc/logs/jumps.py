"""Jumps of a recorded angle: an encoder that lost its zero, or rows that a logger dropped without a gap in time.

The steps s_k = q_{k+1} - q_k of a moving joint differ from their neighbours only by its acceleration. A step that is
far larger than all others is therefore a jump of the reading and not a motion.
"""

import numpy as np
from scipy.ndimage import median_filter

from drake_tc.logs.columns import RawLog, file_row
from drake_tc.logs.rig import Rig
from drake_tc.types import BoolArray, FloatArray, IntArray

NEIGHBOURHOOD = 9
"""Number of steps whose median is taken as the motion of the joint there."""
ALONE, AROUND = 10.0, 10
"""A jump departs from that median by more than `ALONE` times as much as any other step within `AROUND` rows. An impact
rings, and has several large steps."""
LARGEST = 3.0
"""A jump is so many times larger than the largest other step of the run: no motion of this joint is as fast."""
MANY_STEPS = 30.0
"""A jump has so many times the encoder's smallest step: the last digit may flicker."""
LONG = 1.5
"""Sampling periods between two samples above which rows are missing: the joint moved on meanwhile."""
MOST = 5
"""Most jumps of one column that are taken for a lost zero."""


def jumps(time: FloatArray, angle: FloatArray) -> IntArray:
    """Rows k (m,) after which the angle jumps and stays at its new value. NaN are skipped, and spikes are not jumps.

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
    """Rows (T,) beside jumps of the joints' positions, at which the run is to be split, and one note for each jump."""
    beside, notes = np.zeros(raw.time.size, dtype=bool), []
    for name in (f"{joint}/position" for joint in rig.joints if joint not in raw.speed_only):
        rows = jumps(raw.time, raw.columns[name])
        for k in rows.tolist():
            end = k + 1 + int(np.argmax(np.isfinite(raw.columns[name][k + 1 :])))
            beside[k : end + 1] = True
            unit = rig.units_of(name.removesuffix("/position")).position
            size = float(raw.columns[name][end] - raw.columns[name][k])
            notes.append(
                f"Column {name} jumps by {size:.3g} {unit} at {raw.time[end] - raw.time[0]:.6g} s"
                f" ({file_row(raw.path, end)}) and stays at the new value. The joint moves this fast nowhere else: the"
                " encoder lost its zero, or rows are missing. The run was split there. If the zero was lost, cut the"
                " log at this row, and either leave out one part or correct its zero."
            )
    return beside, tuple(notes)
