"""What a check says of channels that are late against each other: ages beyond what sampling explains, as fitted."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import curve_fit

from drake_tc.diagnosis.data.channels import channels_of
from drake_tc.diagnosis.intervals import CRITICAL
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
"""Delay below which nothing is said [s]; it matters little to the user of a model (`Effect.typical_size`)."""
CERTAIN = 4.0
"""Standard deviations from 0 from which on a delay is stated."""
LONGEST = 0.05
"""Longest delay of the velocity [s]."""
ACTING = {"delay.command": "command", "delay.loop": "effort"}
"""What acts late, by effect key."""
OTHERWISE = ", because of a filter, a bus or another clock."


@dataclass(frozen=True)
class Age:
    """Age of a channel against the position's clock [s].

    Attributes:
        seconds: Most probable. half: half width of the 95 % interval.
        expected: Whether sampling explains it, so that no delay is missing.
    """

    seconds: float
    half: float
    expected: bool = False

    @property
    def interval(self) -> tuple[float, float]:
        """95 % [s]."""
        return self.seconds - self.half, self.seconds + self.half

    @property
    def text(self) -> str:
        """Its size in words."""
        return _size(self.seconds, self.interval)

    def known(self, prepared: Prepared) -> bool:
        """Whether it is certainly not 0, and long enough to be stated."""
        least = max(LEAST * prepared.train.samples.signals.period, LEAST_SECONDS)
        return abs(self.seconds) > max(CERTAIN / CRITICAL * self.half, least)

    def finding(self, name: str, text: str) -> Finding:
        """That a channel is recorded late, and whether sampling explains it."""
        why = ", which its sampling explains." if self.expected else OTHERWISE
        return Finding(name, "note" if self.expected else "warning", self.seconds, "s", text + why, self.interval)


def late_columns(fitted: FittedJoint, runs: Sequence[Run], joint: str) -> tuple[Finding, ...]:
    """A finding for each delay that the most probable model has, and for each age that is known.

    Args:
        fitted: One joint.
        runs: Its runs.
        joint: Its name.
    """
    out = _recorded_late(fitted)
    for term in fitted.found:
        if term.effect.key in ACTING:
            delay, acts = fitted.parameters[term.effect.key]["delay"], ACTING[term.effect.key]
            text = f"The {acts} acts {_size(delay.value, delay.ci95)} late: the declared model lacks a delay."
            out.append(Finding("clocks", "note", delay.value, "s", text, delay.ci95))
    if not any(each.level == "warning" or each.name == "clocks" for each in out):
        text = "The delays between the channels are no longer than their sampling explains."
        out.append(Finding("clocks", "good", 0.0, "s", text))
    velocity = velocity_delay(fitted.prepared, runs, joint)
    if velocity is not None and abs(velocity.seconds) <= LONGEST and velocity.known(fitted.prepared):
        out.append(velocity.finding(LATE_VELOCITY, _late("velocity", "position", velocity)))
    return tuple(out)


def _size(seconds: float, interval: tuple[float, float]) -> str:
    low, high = sorted(abs(1e3 * each) for each in interval)
    return f"{abs(1e3 * seconds):.3g} ms (95 %: {low:.3g} to {high:.3g} ms)"


def _late(channel: str, other: str, age: Age) -> str:
    """That one of two channels is recorded later than the other one."""
    late, against = (channel, other) if age.seconds > 0.0 else (other, channel)
    return f"The {late} is recorded {age.text} later than the {against}"


def _recorded_late(fitted: FittedJoint) -> list[Finding]:
    """Of a joint whose load is measured: torque against position, and an effort that is recorded after it acts."""
    context, out = fitted.context, list[Finding]()
    if context.load != "torque":
        return out
    torque = age_of(fitted, "torque")
    if torque.known(fitted.prepared):
        out.append(torque.finding("delay of the torque", _late("torque", "position", torque)))
    if context.drive == "position_servo":  # the derivatives of its command take up an age
        return out
    effort = age_of(fitted, "effort")
    of_position = torque.seconds < 0.0 and abs(effort.seconds - torque.seconds) < np.hypot(effort.half, torque.half)
    if not effort.known(fitted.prepared) or of_position:
        return out
    if effort.seconds > 0.0:
        out.append(effort.finding("delay of the effort", f"The effort is recorded {effort.text} after it acts"))
        return out
    acts = Age(-effort.seconds, effort.half)
    text = f"The effort acts {acts.text} after its record, or the torque is recorded late by as much."
    return [*out, Finding("clocks", "note", acts.seconds, "s", text, acts.interval)]


def age_of(fitted: FittedJoint, channel: str) -> Age:
    """The age of a channel of the most probable model, by its prior and by a delay for which it stands."""
    evidence, best = fitted.evidence, fitted.evidence.corrected(fitted.best)
    weights, at = evidence.model.against_position(channel), evidence.places_of_ages(best)
    variance = float(weights @ best.posterior.covariance[at, at] @ weights)
    delays = [t.effect for t in fitted.found if t.effect.ages_of.get(channel) and t.effect.coefficients]
    for effect in delays:
        low, high = fitted.parameters[effect.key]["delay"].ci95
        variance += (0.5 * (high - low) / CRITICAL) ** 2
    return Age(evidence.ages(best)[channel], CRITICAL * float(np.sqrt(variance)), expected=not delays)


def velocity_delay(prepared: Prepared, runs: Sequence[Run], joint: str) -> Age | None:
    """Delay of a recorded velocity against the position; None without both.

    It is d of  v_rec(t) = g v(t - d) + b,  v the rate of the position, both through the same filter, by least squares.
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
    clocks = [np.arange(s.stop - s.start) * period for s in inner]
    splines = [CubicSpline(clock, rate[s]) for clock, s in zip(clocks, inner, strict=True)]

    def expected(_: FloatArray, late: float, gain: float, offset: float) -> FloatArray:
        parts = [f(np.clip(t - late, t[0], t[-1])) for f, t in zip(splines, clocks, strict=True)]
        return np.asarray(gain * np.concatenate(parts) + offset)

    target = np.concatenate([own[s] for s in inner])
    found, covariance = curve_fit(expected, np.zeros(target.size), target, p0=(0.0, 1.0, 0.0))
    residual = target - expected(target, *found)
    times = max(correlation_time(residual - residual.mean(), [s.stop - s.start for s in inner]), 1.0)
    return Age(float(found[0]), CRITICAL * float(np.sqrt(covariance[0, 0] * times)))
