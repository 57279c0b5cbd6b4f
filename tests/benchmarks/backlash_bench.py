"""Play of a gear told apart from the dead zone of the servo that holds it, from quasi-static pulls by hand or rig.

The static law of a position servo, effort against error, read from the instants at which nothing moves.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from drake_tc.errors import IdentificationError
from drake_tc.logs.record import Run
from drake_tc.types import BoolArray, FloatArray
from tests.benchmarks.pulls import Pull, find_pulls, most_common


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


CONFIDENCE = 0.95
LEAST_CLEAN = 3
DIFFERENCE = 0.78
"""Of a step: 95 % of the differences of two rounded positions are no further off."""


@dataclass(frozen=True)
class Interval:
    """A value with its 95 % interval [rad]; counts: how many pulls stand behind it."""

    value: float
    low: float
    high: float
    counts: int


@dataclass(frozen=True)
class BacklashReport:
    """What a held joint does when it is pulled left and right, split into its causes; widths in rad.

    Attributes:
        joint: The held joint. pulls: the evidence.
        loaded_span, unloaded_span: Mean rest under a right pull minus that under a left one; the same after letting go.
        drive: Effort against position error: the dead zone is its part.
        servo_band: Distance between the rests after the joint's own motions from either side: error that the servo
            leaves without any load (dead zone and stiction of the motor); None without such motions.
        reversal: Movement when a pull crosses to the other flank of the gear while the motor stands still.
        wind_up: Elastic movement: under a pull on the flank that is loaded already, and back when the pull lets go.
        play: `reversal` - `wind_up`: movement that needs no torque.
        lower_bound: The pulls ended where the servo starts to drive against them, and not where the gear stops: the
            joint may have moved less than its gear would let it.
        follows_start: Slope of the loaded rest over the rest before it, on reversals: near 1 or above the motor
            stands still during the pull; near 0 the servo decides where the joint ends. None if all started alike.
    """

    joint: str
    pulls: tuple[Pull, ...]
    loaded_span: Interval
    unloaded_span: Interval
    drive: DriveLaw
    servo_band: Interval | None
    reversal: Interval
    wind_up: Interval
    play: Interval
    lower_bound: bool
    follows_start: float | None


def analyse_backlash(run: Run, held: str, pullers: Sequence[str]) -> BacklashReport:
    """Split the movement of a pulled joint into play, elastic wind-up, and what its servo leaves.

    With the motor at rest, a relaxed joint that is pulled to its other flank moves by b + c T (play and compliance);
    one that is pulled on the flank it rests on, or let go, moves by c T. The motor is at rest while the error is no
    larger than the one in which the joint's own motions end. A dead zone moves nothing by itself: it shows as error
    without effort, and together with the motor's stiction as the band in which own motions end.

    Args:
        run: Positions, commands [rad] and the held joint's voltage [V]; a few samples a second are enough.
        held: The joint that holds.
        pullers: The joints that pull it, one for each side.

    Raises:
        IdentificationError: no complete pull, or too few errors to see the drive's law.
    """
    pulls = find_pulls(run, held, pullers)
    drive = fit_drive_law(run, held)
    step = drive.resolution
    side_of = {p: np.sign(np.mean([x.loaded - x.before for x in pulls if x.puller == p]) or 1.0) for p in pullers}
    side = np.array([side_of[p.puller] for p in pulls])
    before, loaded, after = (np.array([getattr(p, n) for p in pulls]) for n in ("before", "loaded", "after"))
    arrival = np.array([p.arrival for p in pulls], dtype=float)
    flank = np.where(arrival != 0.0, -arrival, np.concatenate([[0.0], side[:-1]]))
    crossing, staying = side * flank < 0.0, side * flank > 0.0
    room = _room(before, loaded, side, arrival)
    at_rest = room >= -0.5 * step
    clean = crossing & at_rest
    follows = _slope(before[crossing], loaded[crossing], side[crossing], step)
    stood = follows is not None and follows > 0.5
    free = clean.sum() >= LEAST_CLEAN and (stood or (room[clean] >= step).sum() >= LEAST_CLEAN)
    reversal = _mean((side * (loaded - before))[clean if clean.sum() >= LEAST_CLEAN else crossing], DIFFERENCE * step)
    wind_up = _mean(
        np.concatenate([(side * (loaded - before))[staying], (side * (loaded - after))[at_rest]]), DIFFERENCE * step
    )
    return BacklashReport(
        joint=held,
        pulls=pulls,
        loaded_span=_difference(loaded[side > 0], loaded[side < 0], step),
        unloaded_span=_difference(after[side > 0], after[side < 0], step),
        drive=drive,
        servo_band=_difference(before[arrival < 0], before[arrival > 0], step)
        if (arrival > 0).any() and (arrival < 0).any()
        else None,
        reversal=reversal,
        wind_up=wind_up,
        play=_minus(reversal, wind_up) if wind_up.counts else reversal,
        lower_bound=not free,
        follows_start=follows,
    )


def _room(before: FloatArray, loaded: FloatArray, side: FloatArray, arrival: FloatArray) -> FloatArray:
    """How far (P,) [rad] a pull's error stays below the one in which an own motion ends; -inf where none was seen."""
    room = np.full(side.size, -np.inf)
    for s in (1.0, -1.0):
        own = s * before[arrival == -s]
        if own.size:
            room[side == s] = float(np.mean(own)) - s * loaded[side == s]
    return room


def _mean(values: FloatArray, rounding: float) -> Interval:
    """Mean with Student's interval; values that spread less than their `rounding` keep that error."""
    if values.size == 0:
        return Interval(float("nan"), float("nan"), float("nan"), 0)
    spread = float(np.std(values, ddof=1)) if values.size > 1 else 0.0
    half = student.ppf(0.5 + 0.5 * CONFIDENCE, max(values.size - 1, 1)) * spread / np.sqrt(values.size)
    half = float(np.hypot(half, rounding if spread < rounding else 0.0))
    return Interval(float(np.mean(values)), float(np.mean(values) - half), float(np.mean(values) + half), values.size)


def _difference(right: FloatArray, left: FloatArray, step: float) -> Interval:
    """mean(right) - mean(left) with Welch's interval."""
    a, b = _mean(right, 0.5 * step), _mean(left, 0.5 * step)
    value, half = a.value - b.value, float(np.hypot(a.high - a.value, b.high - b.value))
    return Interval(value, value - half, value + half, min(a.counts, b.counts))


def _minus(a: Interval, b: Interval) -> Interval:
    value, half = a.value - b.value, float(np.hypot(a.high - a.value, b.high - b.value))
    return Interval(max(value, 0.0), max(value - half, 0.0), value + half, a.counts)


def _slope(start: FloatArray, end: FloatArray, side: FloatArray, step: float) -> float | None:
    """Pooled slope of end over start, each side about its own mean; None if the starts differ by less than a step."""
    x, y = start.copy(), end.copy()
    for s in (1.0, -1.0):
        x[side == s] -= x[side == s].mean() if (side == s).any() else 0.0
        y[side == s] -= y[side == s].mean() if (side == s).any() else 0.0
    return float(x @ y / (x @ x)) if x.size and np.ptp(x) >= step else None
