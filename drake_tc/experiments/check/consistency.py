"""Whether a joint's columns can belong together: quantisation, limits, temperature, clocks, energy and gravity.

What a check says of columns that are late against each other: ages beyond what sampling explains, as fitted.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline

from drake_tc.config.joint_units import TORQUE
from drake_tc.diagnosis.data.channels import channels_of
from drake_tc.diagnosis.notes import LogRemark
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.effects.base import JointNumbers
from drake_tc.experiments.fitted import FittedJoint
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.logs.record import Run
from drake_tc.report.words import joined
from drake_tc.types import FloatArray

Level = Literal["good", "note", "warning"]
COARSE = 0.05
"""Step of a column over its standard deviation, above which it is told to be coarse."""
AT_LIMIT = 0.01
"""Share of the samples at the largest effort, above which the drive is told to saturate."""
DRIFT = 5.0
"""Rise of the temperature [K] from which on friction may change with it."""
FRICTION = ("viscous", "coulomb")
"""Keys of the declared friction."""


@dataclass(frozen=True)
class Finding:
    """One property of the columns.

    Attributes:
        name: Of the property.
        level: good, note (something to know) or warning (the columns may not belong together).
        value: The figure that was computed; NaN where there is none.
        unit: Of the value.
        text: One sentence.
        interval: 95 % interval of the value; None where there is none.
    """

    name: str
    level: Level
    value: float
    unit: str
    text: str
    interval: tuple[float, float] | None = None


def findings(fitted: FittedJoint, late: Sequence[Finding] = ()) -> tuple[Finding, ...]:
    """All findings about one joint.

    Args:
        fitted: One joint; its training rows are looked at.
        late: Delays of columns that are known.
    """
    prepared = fitted.prepared
    made = [
        _position_step(prepared),
        _sample_times(prepared),
        _effort_step(prepared),
        _limit(prepared),
        _temperature(prepared),
        _lead(prepared),
        *late,
        _declared(fitted),
        _effects(fitted),
        _energy(prepared, fitted.numbers),
        _gravity(prepared),
    ]
    return tuple(each for each in made if each is not None)


def _position_step(prepared: Prepared) -> Finding | None:
    resolution, samples = prepared.train.samples.resolution, prepared.train.samples
    if resolution.position_step <= 0.0:
        return None
    share = resolution.position_step / max(float(np.std(samples.signals.position)), 1e-300)
    level: Level = "note" if share > 0.2 * COARSE else "good"
    unit = samples.units.position
    text = f"The position has steps of {resolution.position_step:.3g} {unit}"
    text += f"; speeds below {resolution.least_speed:.2g} {unit}/s are not resolved, and samples there take no part."
    return Finding("position step", level, resolution.position_step, unit, text)


def _sample_times(prepared: Prepared) -> Finding | None:
    timing, unit = prepared.train.samples.resolution.timing, prepared.train.samples.units.position
    if timing is None:
        return None
    text = (
        f"The instants of the samples scatter by {1e6 * timing.time:.3g} us (RMS) about their time stamps. At the "
        f"fastest motion, positions therefore err by {timing.time * timing.fastest:.3g} {unit}, "
        f"{timing.time * timing.fastest / timing.noise:.3g} times their noise at rest."
    )
    return Finding("sample times", "note", timing.time, "s", text)


def _effort_step(prepared: Prepared) -> Finding | None:
    samples, unit = prepared.train.samples, prepared.context.units.effort
    step, spread = samples.resolution.effort_step, float(np.std(samples.signals.effort[samples.rows]))
    if step <= 0.0:
        return None
    coarse = step > COARSE * spread
    text = f"The command has steps of {step:.3g} {unit}"
    text += (
        f", {100.0 * step / max(spread, 1e-300):.0f} % of the effort's standard deviation, which is too coarse."
        if coarse
        else "."
    )
    return Finding("command step", "warning" if coarse else "good", step, unit, text)


def _limit(prepared: Prepared) -> Finding | None:
    if any(isinstance(n, LogRemark) and "rests at its limit" in n.statement for n in prepared.train.samples.notes):
        return None  # the notes on the logs say so, of the recorded effort
    effort, unit = prepared.train.samples.signals.effort, prepared.context.units.effort
    largest = float(np.max(np.abs(effort)))
    share = float(np.mean(np.abs(effort) > 0.995 * largest))
    if share < AT_LIMIT:
        return Finding(
            "largest effort",
            "good",
            largest,
            unit,
            f"The effort reaches its maximum ({largest:.3g} {unit}) only rarely, so it shows no limit.",
        )
    text = f"The effort stays at its maximum of {largest:.3g} {unit} in {100.0 * share:.1f} % of the samples."
    return Finding("largest effort", "note", largest, unit, text)


def _temperature(prepared: Prepared) -> Finding:
    low, high = prepared.context.temperature_span
    if not np.isfinite(high - low):
        text = (
            "No temperature was recorded: friction that changes as the joint warms up cannot be distinguished from "
            "other drifts."
        )
        return Finding("temperature", "note", float("nan"), "K", text)
    level: Level = "note" if high - low > DRIFT else "good"
    return Finding("temperature", level, high - low, "K", f"The temperature changes by {high - low:.3g} K.")


def _lead(prepared: Prepared) -> Finding | None:
    """A servo's command leads the motion that it causes."""
    if prepared.context.drive != "position_servo":
        return None
    samples = prepared.train.samples
    s, longest = samples.signals, max(samples.segments, key=lambda part: part.stop - part.start)
    command, position = s.command[longest], s.position[longest]
    most = max(1, round(0.5 / s.period))
    shifts = np.unique(np.round(np.linspace(-most, most, 101)).astype(int))
    errors = [_apart(command, position, int(k)) for k in shifts]
    best = float(shifts[int(np.argmin(errors))]) * s.period
    if best < -s.period:
        text = f"The position leads its command by {-1e3 * best:.3g} ms: the columns may be exchanged or on two clocks."
        return Finding("lead of the command", "warning", best, "s", text)
    return Finding("lead of the command", "good", best, "s", f"The command leads the position by {1e3 * best:.3g} ms.")


def _apart(first: FloatArray, second: FloatArray, lead: int) -> float:
    """RMS difference of two channels (T,) when the first leads the second by so many samples."""
    size = first.size - abs(lead)
    a, b = (first[:size], second[lead:]) if lead >= 0 else (first[-lead:], second[:size])
    return float(np.sqrt(np.mean((a - b) ** 2))) if size > 10 else float("inf")


def _declared(fitted: FittedJoint) -> Finding:
    """Drive gain and friction: the declared model by itself must not ask for power, and the gain has its interval."""
    units, alone = fitted.prepared.train.samples.units, fitted.alone().parameters
    wrong = [key for key in FRICTION if key in alone and alone[key][key].value <= 0.0]
    gain = fitted.parameters["drive"]["gain"]
    if wrong:
        text = (
            f"The declared model fits without {' and '.join(wrong)} friction: a column has the wrong sign, or an "
            "effect is missing."
        )
        return Finding("declared model", "warning", gain.value, units.gain, text)
    if units.torque_as_effort:
        text = (
            f"The declared model fits with positive friction. Nothing in the rig file fixes the scale of the unknown "
            f"load, so that torques are stated as effort [{units.effort}]; declare drive_gain to get "
            f"{units.text(TORQUE)}."
        )
        return Finding("declared model", "note", float("nan"), units.gain, text)
    low, high = gain.ci95
    text = (
        f"The declared model fits with positive friction and a drive gain of {gain.value:.4g} {units.gain} (95 %: "
        f"{low:.4g} to {high:.4g})."
    )
    return Finding("declared model", "good", gain.value, units.gain, text, gain.ci95)


def _effects(fitted: FittedJoint) -> Finding | None:
    """What the most probable model has beside the declared one."""
    names = [term.effect.title for term in fitted.found]
    if not names:
        return None
    text = (
        f"The most probable model contains {joined(names)} in addition to the declared model; close-loop tests on "
        "held-out runs whether this holds."
    )
    return Finding("effects", "note", float(len(names)), "-", text)


def _energy(prepared: Prepared, numbers: JointNumbers) -> Finding | None:
    """Of the work that the motor does on a closed motion, friction keeps a part: it never gives any."""
    samples = prepared.train.samples
    if samples.load_unknown:
        return None
    s, rows = samples.signals, samples.rows
    power = s.effort[rows] / numbers.gain * s.velocity[rows]
    into_load = (s.load_torque[rows] + s.rotor_inertia * s.acceleration[rows]) * s.velocity[rows]
    spent = float(np.mean(np.abs(power)))
    share = float(np.mean(power - into_load)) / max(spent, 1e-300)
    if share < 0.0:
        text = (
            f"The joint gives {-100.0 * share:.1f} % more work than the motor puts in: signs, units or clocks of "
            "torque and command do not belong together."
        )
        return Finding("energy", "warning", share, "-", text)
    return Finding("energy", "good", share, "-", f"Friction takes {100.0 * share:.1f} % of the motor's work.")


def _gravity(prepared: Prepared) -> Finding | None:
    """Of a measured load, what follows the angle as gravity does."""
    if prepared.context.load != "torque":
        return None
    s, rows = prepared.train.samples.signals, prepared.train.samples.rows
    q, tau = s.position[rows], s.load_torque[rows]
    if prepared.context.units.slides:
        return _moved_mass(s.acceleration[rows], tau)
    basis = np.column_stack([np.sin(q), np.cos(q), s.acceleration[rows], np.ones(rows.size)])
    if np.linalg.cond(basis[:, [0, 1, 3]]) > 300.0:
        return Finding(
            "gravity", "note", float("nan"), "N*m", "The travel is too small to see gravity in the load torque."
        )
    beta = np.linalg.lstsq(basis, tau, rcond=None)[0]
    moment = float(np.hypot(beta[0], beta[1]))
    left = 1.0 - float(np.var(tau - basis @ beta) / max(np.var(tau), 1e-300))
    inertia = float(beta[2])
    if inertia < 0.0 and left > 0.9:
        text = (
            f"The load torque decreases with the acceleration ({inertia:.2g} kg*m^2): its sign or its time stamps are "
            "wrong."
        )
        return Finding("gravity", "warning", moment, "N*m", text)
    text = (
        f"Gravity (m g l = {moment:.3g} N*m) and inertia explain {100.0 * left:.0f} % of the variance of the load "
        "torque; the rest comes from other loads."
    )
    return Finding("gravity", "good", moment, "N*m", text)


def _moved_mass(acceleration: FloatArray, force: FloatArray) -> Finding:
    """Of the measured force (N,) of a joint that slides, what a mass with its weight makes."""
    basis = np.column_stack([acceleration, np.ones(force.size)])
    mass, constant = (float(b) for b in np.linalg.lstsq(basis, force, rcond=None)[0])
    share = 1.0 - float(np.var(force - basis @ [mass, constant]) / max(np.var(force), 1e-300))
    if mass < 0.0 and share > 0.9:
        text = f"The load force decreases with the acceleration ({mass:.2g} kg): its sign or its time stamps are wrong."
        return Finding("gravity", "warning", constant, "N", text)
    text = (
        f"A mass of {max(mass, 0.0):.3g} kg and a constant force of {constant:.3g} N explain {100.0 * share:.0f} % of "
        "the variance of the load force; the rest comes from other loads."
    )
    return Finding("gravity", "good", constant, "N", text)


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
        out.append(
            Finding(
                "clocks",
                "good",
                0.0,
                "s",
                "The delays between the channels are no longer than their sampling explains.",
            )
        )
    return (*out, *_late_velocity(fitted.prepared, runs, joint))


def _acting_late(fitted: FittedJoint, term: Term) -> Finding:
    delay = fitted.parameters[term.effect.key]["delay"]
    text = (
        f"The {ACTING[term.effect.key]} acts {_size(delay.value, delay.ci95)} late: the declared model lacks a delay."
    )
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
        text = f"The {late} is recorded {_size(torque.seconds, torque.interval)} later than the {against}"
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
    text = (
        f"The effort acts {_size(acts.seconds, acts.interval)} after its record, or the torque is recorded late by as "
        "much."
    )
    out.append(Finding("clocks", "note", acts.seconds, "s", text, acts.interval))
    return out


def _finding(name: str, age: Age, text: str) -> Finding:
    why = ", which its sampling explains." if age.expected else ", because of a filter, a bus or another clock."
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
        f"The {late} is recorded {_size(seconds, interval)} later than the {against}, because of a filter, a bus or "
        "another clock."
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
