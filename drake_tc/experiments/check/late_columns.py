"""What a check says of columns that are late against each other."""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from drake_tc.diagnosis.data.channels import channels_of
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.experiments.check.consistency import Finding
from drake_tc.experiments.check.delays import STEPS, ColumnDelay, torque_delay
from drake_tc.experiments.check.joint import JointEffects
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.logs.record import Run
from drake_tc.types import FloatArray

LEAST = 0.1
"""Delay over the sampling period below which nothing is said: the columns are filtered on samples."""
LEAST_SECONDS = 5e-4
"""Delay below which nothing is said [s]: it is a small part of what matters to the user of a model (`sizes.py`)."""


def late_columns(prepared: Prepared, effects: JointEffects, runs: Sequence[Run], joint: str) -> tuple[Finding, ...]:
    """A finding for each delay that is known.

    Args:
        prepared: One joint.
        effects: What its logs show of every effect.
        runs: Its runs.
        joint: Its name.
    """
    least = max(LEAST * prepared.train.samples.signals.period, LEAST_SECONDS)
    found = torque_delay(prepared, effects.noise, effects.contributions)
    torque, effort = (_told(each, least) for each in found)
    velocity = _told(velocity_delay(prepared, runs, joint), least)
    out = []
    if torque:
        out.append(_between(torque, "torque", "position"))
    if effort and effort.seconds > 0.0:
        text = f"The effort is recorded {_size(effort)} after it acts, or later."
        out.append(Finding("delay of the effort", "warning", effort.seconds, "s", text, effort.interval))
    if velocity:
        out.append(_between(velocity, "velocity", "position"))
    return tuple(out)


def _told(delay: ColumnDelay | None, least: float) -> ColumnDelay | None:
    """The delay, if it is known and long enough to be stated."""
    return delay if delay is not None and delay.known and abs(delay.seconds) > least else None


def _between(delay: ColumnDelay, name: str, other: str) -> Finding:
    """The finding of two measured columns; a negative delay is one of the other column."""
    late, against = (name, other) if delay.seconds > 0.0 else (other, name)
    text = f"The {late} comes {_size(delay)} late against the {against}: by a filter, a bus or another clock."
    return Finding(f"delay of the {name}", "warning", delay.seconds, "s", text, delay.interval)


def _size(delay: ColumnDelay) -> str:
    low, high = sorted(abs(1e3 * each) for each in delay.interval)
    return f"{abs(1e3 * delay.seconds):.3g} ms (95 %: {low:.3g} to {high:.3g} ms)"


def velocity_delay(prepared: Prepared, runs: Sequence[Run], joint: str) -> ColumnDelay | None:
    """Delay of a recorded velocity against the position; None where not both are recorded.

    It is d of  v_rec(t) = g v(t - d) + b,  v the rate of the position, both through the same filter, by Gauss and
    Newton's method with the gain g and the offset b free.
    """
    channels, samples = channels_of(runs, joint), prepared.train.samples
    recorded = channels.raw("velocity")
    if channels.speed_only or not np.isfinite(recorded).all() or recorded.size != len(samples.signals):
        return None
    light, period = samples.light, samples.signals.period
    inner = [slice(s.start + light.margin, s.stop - light.margin) for s in samples.segments]
    inner = [s for s in inner if s.stop - s.start > 2 * light.margin]
    if not inner:
        return None
    own, rate = light.smooth(recorded), light.derivative(channels.raw("position"))
    target = np.concatenate([own[s] for s in inner])
    late, half = 0.0, 0.0
    for _ in range(STEPS):
        v = _shifted(rate, inner, period, late)
        z = -_shifted(rate, inner, period, late, 1)
        columns = np.column_stack([v, np.ones_like(v), z])
        beta, *_ = np.linalg.lstsq(columns, target, rcond=None)
        change = float(beta[2] / beta[0])
        late = float(np.clip(late + change, -0.2, 0.2))
        residual = target - columns @ beta
        times = max(correlation_time(residual - residual.mean(), [s.stop - s.start for s in inner]), 1.0)
        alone = z - columns[:, :2] @ np.linalg.lstsq(columns[:, :2], z, rcond=None)[0]
        spread = np.sqrt(np.mean(residual**2) * times) / max(float(np.linalg.norm(alone)), 1e-300)
        half = 1.96 * float(spread) / max(abs(float(beta[0])), 1e-300)
        if abs(change) < 1e-6:
            break
    return ColumnDelay(late, half)


def _shifted(values: FloatArray, parts: Sequence[slice], period: float, late: float, order: int = 0) -> FloatArray:
    """A derivative of values (T,) at the times t - `late` [s] of the samples in parts, end to end."""
    out = []
    for s in parts:
        at = np.arange(s.stop - s.start) * period
        out.append(CubicSpline(at, values[s])(np.clip(at - late, at[0], at[-1]), order))
    return np.concatenate(out)
