"""The static law of a position servo, effort against error, read from the instants at which nothing moves."""

from dataclasses import dataclass

import numpy as np

from drake_tc.errors import IdentificationError
from drake_tc.identification.pull_tests import most_common
from drake_tc.logs.record import Run
from drake_tc.types import BoolArray, FloatArray


@dataclass(frozen=True)
class DriveLaw:
    """u = 0 for |e| <= w, else gain e + start sign(e), e = q_d - q.

    Attributes:
        gain: [V/rad].
        start: [V]; below 0 the line itself passes through a dead zone, above 0 the drive starts with a jump.
        dead_zone: Half-width w [rad], with the interval [low, high] that the encoder's steps leave it.
        low, high: The largest error that was seen without effort, and the smallest one with.
        residual: RMS of the law's effort [V]. resolution: one step of the encoder [rad].
    """

    gain: float
    start: float
    dead_zone: float
    low: float
    high: float
    residual: float
    resolution: float


def still(position: FloatArray, command: FloatArray, effort: FloatArray) -> BoolArray:
    """Samples whose neighbours show the same position, command and effort (T,)."""
    same = np.ones(position.size, dtype=bool)
    for values in (position, command, effort):
        steps = np.abs(np.diff(values)) <= 1e-9
        same[1:] &= steps
        same[:-1] &= steps
    same[[0, -1]] = False
    return same


def fit_drive_law(run: Run, joint: str) -> DriveLaw:
    """Fit the static law of `joint` over all still samples, each distinct error counting once.

    Args:
        run: Has `<joint>/position`, `/position_command` [rad] and `/voltage` [V].
        joint: Which joint.

    Raises:
        IdentificationError: fewer than two different errors with effort.
    """
    position, command = run.columns[f"{joint}/position"], run.columns[f"{joint}/position_command"]
    effort = run.columns[f"{joint}/voltage"]
    moved = np.abs(np.diff(position[np.isfinite(position)]))
    if not (moved > 1e-9).any():
        raise IdentificationError(f"{run.name}: {joint} never moves: no encoder step to be seen")
    step = float(np.min(moved[moved > 1e-9]))
    rest = still(position, command, effort) & np.isfinite(position) & np.isfinite(effort)
    error = np.round(np.abs(command - position)[rest] / step)
    push = (np.sign(command - position) * effort)[rest]
    levels = np.unique(error)
    typical = np.array([most_common(push[error == level]) for level in levels])
    driven = typical > 1e-9
    if driven.sum() < 2:
        raise IdentificationError(
            f"{run.name}: {joint} rests at {int(driven.sum())} errors with effort; two are needed"
        )
    x, y = levels[driven] * step, typical[driven]
    gain, start = np.polyfit(x, y, 1)
    silent = levels[~driven & (levels < levels[driven].min())]
    low, high = (float(silent.max()) if silent.size else 0.0) * step, float(levels[driven].min()) * step
    crossing = -start / gain if gain > 0.0 else 0.0
    return DriveLaw(
        gain=float(gain),
        start=float(start),
        dead_zone=float(np.clip(crossing, low, high)),
        low=low,
        high=high,
        residual=float(np.sqrt(np.mean((y - gain * x - start) ** 2))),
        resolution=step,
    )
