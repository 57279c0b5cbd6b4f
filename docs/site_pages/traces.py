"""What each effect leaves in the residual of a model that lacks it, and which of these traces look alike."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from drake_tc.effects.base import DriveEffect, DriveKind, Effect, Shape, Signals
from drake_tc.types import FloatArray
from site_pages import standard_log

DRIVES: tuple[DriveKind, ...] = ("position_servo", "voltage", "current")
LOADS = ("torque", "pendulum", "links", "unknown")
SHAPES = 12
"""Starting points of a shape that a comparison tries at most."""


@dataclass(frozen=True)
class Trace:
    """An effect in the residual.

    Attributes:
        effect: Whose it is.
        drive, load: Kind of drive and of load with which it is shown.
        signals: Of the log.
        torque: (T,) [N m], after viscous and Coulomb friction and the drive gain took up what they can.
        shape: Of the effect.
    """

    effect: Effect
    drive: DriveKind
    load: str
    signals: Signals
    torque: FloatArray
    shape: Shape


@cache
def trace(effect: Effect) -> Trace | None:
    """The effect's trace, on the first kind of drive and load where a search may look for it; None if there is none."""
    for drive in DRIVES:
        for load in LOADS:
            context = standard_log.context(drive, load)
            if effect.unavailable(context):
                continue
            seen = standard_log.signals(drive)
            grid = effect.shape_grid(context)
            shape = grid[len(grid) // 2]
            raw = columns(effect, seen, shape, standard_log.GAIN[drive]).sum(axis=-1)
            left = raw - known(seen) @ (known(seen).T @ raw)
            if np.linalg.norm(left) > 1e-9 * max(np.linalg.norm(raw), 1e-300):
                return Trace(effect, drive, load, seen, left, shape)
    return None


def columns(effect: Effect, seen: Signals, shape: Shape, gain: float) -> FloatArray:
    """(T, k) torque that the effect adds, for each of its coefficients; one column for an effect of the drive."""
    found = effect.columns(seen, shape)
    if isinstance(effect, DriveEffect) and effect.shapes:
        lost = (seen.effort - effect.transform(seen.effort, seen, shape)) / gain
        found = np.column_stack([found, lost])
    return np.nan_to_num(found / np.maximum(np.abs(found).max(axis=0, initial=0.0), 1e-300))


def known(seen: Signals) -> FloatArray:
    """(T, 3) orthonormal basis of what every declared model fits: viscous, Coulomb, and the effort's scale."""
    basis: FloatArray = np.linalg.qr(np.column_stack([seen.velocity, seen.direction, seen.effort]))[0]
    return basis


def neighbours(one: Trace, effects: Sequence[Effect], least: float, most: int) -> list[tuple[Effect, float]]:
    """Effects that can imitate a trace, with the share of its power that they take up, the largest first."""
    found = []
    for other in effects:
        if other.key != one.effect.key and not other.unavailable(standard_log.context(one.drive, one.load)):
            share = _imitated(one, other)
            if share >= least:
                found.append((other, share))
    return sorted(found, key=lambda pair: -pair[1])[:most]


def _imitated(one: Trace, other: Effect) -> float:
    power = float(one.torque @ one.torque)
    return max(
        (float(np.sum((basis.T @ one.torque) ** 2)) / power for basis in _bases(other, one.drive, one.load)),
        default=0.0,
    )


@cache
def _bases(other: Effect, drive: DriveKind, load: str) -> tuple[FloatArray, ...]:
    """Orthonormal bases of what an effect can do beside the declared model, one a shape that is tried."""
    seen = standard_log.signals(drive)
    grid = other.shape_grid(standard_log.context(drive, load))
    chosen = grid[:: max(1, len(grid) // SHAPES)]
    bases = []
    for shape in chosen:
        raw = columns(other, seen, shape, standard_log.GAIN[drive])
        left = raw - known(seen) @ (known(seen).T @ raw)
        left = left[:, np.linalg.norm(left, axis=0) > 1e-9]
        if left.shape[1]:
            bases.append(np.linalg.qr(left)[0])
    return tuple(bases)
