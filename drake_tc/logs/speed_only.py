"""Logs without a position, as of a motor test stand: the position is the integral of the recorded velocity.

The integral begins at 0, wherever the joint really was, so nothing that depends on the absolute position can be told
from such a log. Friction, inertia, drive and torque sensor do not.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.integrate import cumulative_trapezoid

from drake_tc.errors import LogError
from drake_tc.logs.columns import RawLog
from drake_tc.logs.record import Run
from drake_tc.types import FloatArray


def integrated(time: FloatArray, velocity: FloatArray) -> FloatArray:
    """Q (T,) with q[0] = 0 from the velocity (T,) by the trapezoidal rule; missing values are interpolated."""
    known = np.isfinite(velocity)
    filled = velocity if known.all() else np.interp(time, time[known], velocity[known])
    return np.asarray(cumulative_trapezoid(filled, time, initial=0.0))


def with_positions(raw: RawLog) -> RawLog:
    """The log with a position for every joint in `RawLog.speed_only`."""
    if not raw.speed_only:
        return raw
    columns = dict(raw.columns)
    notes = []
    for joint in raw.speed_only:
        columns[f"{joint}/position"] = integrated(raw.time, columns[f"{joint}/velocity"])
        notes.append(
            f"The log has no column {joint}/position: the velocity was integrated, so the position at the start is not "
            "known, and effects that depend on the position cannot be looked for."
        )
    return replace(raw, columns=columns, notes=(*raw.notes, *notes))


def require_alike(runs: Sequence[Run]) -> None:
    """Refuse runs of which some have a position and others the velocity alone.

    Raises:
        LogError: Names one run of each kind.
    """
    without = {joint for run in runs for joint in run.speed_only}
    for run in runs:
        for joint in sorted(without - set(run.speed_only)):
            other = next(each for each in runs if joint in each.speed_only)
            raise LogError(
                f"{other.source or other.name}: no column '{joint}/position', which {run.source or run.name} has; map "
                "it in the rig file, or diagnose the logs without it by themselves"
            )
