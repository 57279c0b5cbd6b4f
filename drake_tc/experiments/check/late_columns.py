"""What a check says of columns that are late against each other: ages beyond what sampling explains, as fitted."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from drake_tc.diagnosis.data.channels import channels_of
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.experiments.check.consistency import Finding
from drake_tc.experiments.fitted import FittedJoint
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.logs.record import Run
from drake_tc.types import FloatArray

LATE_VELOCITY = "delay of the velocity"
"""Name of the finding on a velocity that is late against the position."""
LEAST = 0.1
"""Delay over the sampling period below which nothing is said: the columns are filtered on samples."""
LEAST_SECONDS = 5e-4
"""Delay below which nothing is said [s]: it is a small part of what matters to the user of a model (`sizes.py`)."""
CERTAIN = 4.0
"""Standard deviations from 0 from which on a delay is stated."""
LONGEST = 0.05
"""Longest delay of the velocity [s]."""
STEPS = 20
ACTING = {"delay.command": "command", "delay.loop": "effort"}
"""What acts late, by effect key."""


@dataclass(frozen=True)
class Age:
    """Age of a channel against the position's clock [s].

    Attributes:
        seconds: Most probable. half: half width of the 95 % interval.
        expected: Whether sampling explains it, so that no delay is missing.
    """

    seconds: float
    half: float
    expected: bool

    @property
    def interval(self) -> tuple[float, float]:
        """95 % [s]."""
        return self.seconds - self.half, self.seconds + self.half

    def known(self, least: float) -> bool:
        """Whether it is certainly not 0, and long enough to be stated."""
        return abs(self.seconds) > max(CERTAIN / 1.96 * self.half, least)


def late_columns(fitted: FittedJoint, runs: Sequence[Run], joint: str) -> tuple[Finding, ...]:
    """A finding for each delay that the most probable model has, and for each age that is known.

    Args:
        fitted: One joint.
        runs: Its runs.
        joint: Its name.
    """
    out = [*_recorded_late(fitted), *(_acting_late(fitted, term) for term in fitted.found if term.effect.key in ACTING)]
    if not any(each.level == "warning" or each.name == "clocks" for each in out):
        out.append(Finding("clocks", "good", 0.0, "s", "Every channel is as old as its sampling explains."))
    return (*out, *_late_velocity(fitted.prepared, runs, joint))


def _acting_late(fitted: FittedJoint, term: Term) -> Finding:
    delay = fitted.parameters[term.effect.key]["delay"]
    text = f"The {ACTING[term.effect.key]} acts {_size(delay.value, delay.ci95)} late: a delay is missing."
    return Finding("clocks", "note", delay.value, "s", text, delay.ci95)


def _recorded_late(fitted: FittedJoint) -> list[Finding]:
    """Of a joint whose load is measured: torque against position, and an effort that is recorded after it acts."""
    context = fitted.context
    if context.load != "torque":
        return []
    least, out = _least(fitted.prepared), []
    torque = age_of(fitted, "torque")
    if torque.known(least):
        late, against = ("torque", "position") if torque.seconds > 0.0 else ("position", "torque")
        text = f"The {late} comes {_size(torque.seconds, torque.interval)} late against the {against}"
        out.append(_finding("delay of the torque", torque, text))
    if context.drive == "position_servo":  # the derivatives of its command take up an age
        return out
    effort = age_of(fitted, "effort")
    of_position = torque.seconds < 0.0 and abs(effort.seconds - torque.seconds) < np.hypot(effort.half, torque.half)
    if not effort.known(least) or of_position:
        return out
    if effort.seconds > 0.0:
        text = f"The effort is recorded {_size(effort.seconds, effort.interval)} after it acts"
        out.append(_finding("delay of the effort", effort, text))
        return out
    acts = Age(-effort.seconds, effort.half, effort.expected)
    text = f"The effort acts {_size(acts.seconds, acts.interval)} after its record, or the torque comes as late."
    out.append(Finding("clocks", "note", acts.seconds, "s", text, acts.interval))
    return out


def _finding(name: str, age: Age, text: str) -> Finding:
    why = ", which its sampling explains." if age.expected else ": by a filter, a bus or another clock."
    return Finding(name, "note" if age.expected else "warning", age.seconds, "s", text + why, age.interval)


def age_of(fitted: FittedJoint, channel: str) -> Age:
    """The age of a channel of the most probable model, by its prior and by a delay for which it stands."""
    evidence, best = fitted.evidence, fitted.best
    weights, at = evidence.model.against_position(channel), evidence.places_of_ages(best)
    variance = float(weights @ best.posterior.covariance[at, at] @ weights)
    delays = [t.effect for t in fitted.found if t.effect.ages_of.get(channel) and t.effect.coefficients]
    for effect in delays:
        low, high = fitted.parameters[effect.key]["delay"].ci95
        variance += (0.5 * (high - low) / 1.96) ** 2
    return Age(evidence.ages(best)[channel], 1.96 * float(np.sqrt(variance)), expected=not delays)


def _least(prepared: Prepared) -> float:
    return max(LEAST * prepared.train.samples.signals.period, LEAST_SECONDS)


def _size(seconds: float, interval: tuple[float, float]) -> str:
    low, high = sorted(abs(1e3 * each) for each in interval)
    return f"{abs(1e3 * seconds):.3g} ms (95 %: {low:.3g} to {high:.3g} ms)"


def _late_velocity(prepared: Prepared, runs: Sequence[Run], joint: str) -> tuple[Finding, ...]:
    found = velocity_delay(prepared, runs, joint)
    if found is None or abs(found[0]) > LONGEST or not Age(*found, expected=False).known(_least(prepared)):
        return ()
    seconds, half = found
    late, against = ("velocity", "position") if seconds > 0.0 else ("position", "velocity")
    interval = (seconds - half, seconds + half)
    text = (
        f"The {late} comes {_size(seconds, interval)} late against the {against}: by a filter, a bus or another clock."
    )
    return (Finding(LATE_VELOCITY, "warning", seconds, "s", text, interval),)


def velocity_delay(prepared: Prepared, runs: Sequence[Run], joint: str) -> tuple[float, float] | None:
    """(delay, half width of its 95 % interval) [s] of a recorded velocity against the position; None without both.

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
    return late, half


def _shifted(values: FloatArray, parts: Sequence[slice], period: float, late: float, order: int = 0) -> FloatArray:
    """A derivative of values (T,) at the times t - `late` [s] of the samples in parts, end to end."""
    out = []
    for s in parts:
        at = np.arange(s.stop - s.start) * period
        out.append(CubicSpline(at, values[s])(np.clip(at - late, at[0], at[-1]), order))
    return np.concatenate(out)
