"""Whether a joint's columns can belong together: quantisation, limits, temperature, clocks, energy and gravity."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from drake_tc.config.joint_units import TORQUE
from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.notes import LogRemark
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.effects.base import JointNumbers
from drake_tc.experiments.fitted import FittedJoint
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
    made = [each(prepared) for each in (_position_step, _sample_times, _effort_step, _limit, _temperature, _lead)]
    made += [*late, _declared(fitted), _effects(fitted), _energy(prepared, fitted.numbers), _gravity(prepared)]
    return tuple(each for each in made if each is not None)


def _position_step(prepared: Prepared) -> Finding | None:
    samples, resolution = prepared.train.samples, prepared.train.samples.resolution
    step, unit = resolution.position_step, samples.units.position
    if step <= 0.0:
        return None
    level: Level = "note" if step > 0.2 * COARSE * float(np.std(samples.signals.position)) else "good"
    text = (
        f"The position has steps of {step:.3g} {unit}; speeds below {resolution.least_speed:.2g} {unit}/s are not "
        "resolved, and samples there take no part."
    )
    return Finding("position step", level, step, unit, text)


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
    text = f"The command has steps of {step:.3g} {unit}"
    if step <= COARSE * spread:
        return Finding("command step", "good", step, unit, f"{text}.")
    share = 100.0 * step / max(spread, 1e-300)
    text += f", {share:.0f} % of the effort's standard deviation, which is too coarse."
    return Finding("command step", "warning", step, unit, text)


def _limit(prepared: Prepared) -> Finding | None:
    if any(isinstance(n, LogRemark) and "rests at its limit" in n.statement for n in prepared.train.samples.notes):
        return None  # the notes on the logs say so, of the recorded effort
    effort, unit = np.abs(prepared.train.samples.signals.effort), prepared.context.units.effort
    largest = float(np.max(effort))
    share = float(np.mean(effort > 0.995 * largest))
    if share < AT_LIMIT:
        text = f"The effort reaches its maximum ({largest:.3g} {unit}) only rarely, so it shows no limit."
        return Finding("largest effort", "good", largest, unit, text)
    text = f"The effort stays at its maximum of {largest:.3g} {unit} in {100.0 * share:.1f} % of the samples."
    return Finding("largest effort", "note", largest, unit, text)


def _temperature(prepared: Prepared) -> Finding:
    low, high = prepared.context.temperature_span
    text = f"The temperature changes by {high - low:.3g} K."
    if not np.isfinite(high - low):
        text = "No temperature was recorded: friction that changes as the joint warms up cannot be distinguished from "
        text += "other drifts."
    level: Level = "good" if high - low <= DRIFT else "note"
    return Finding("temperature", level, high - low, "K", text)


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
    return rms(a - b) if size > 10 else float("inf")


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
            "The declared model fits with positive friction. Nothing in the rig file fixes the scale of the unknown "
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
    """Of a measured load, what follows acceleration and angle as inertia and gravity do; a weight where it slides."""
    if prepared.context.load != "torque":
        return None
    slides, s, rows = prepared.context.units.slides, prepared.train.samples.signals, prepared.train.samples.rows
    q, tau, one = s.position[rows], s.load_torque[rows], np.ones(rows.size)
    follows = [one] if slides else [np.sin(q), np.cos(q), one]
    if np.linalg.cond(np.column_stack(follows)) > 300.0:
        text = "The travel is too small to see gravity in the load torque."
        return Finding("gravity", "note", float("nan"), "N*m", text)
    basis = np.column_stack([s.acceleration[rows], *follows])
    beta = np.linalg.lstsq(basis, tau, rcond=None)[0]
    inertia, weight = float(beta[0]), float(beta[1]) if slides else float(np.hypot(beta[1], beta[2]))
    explained = 1.0 - float(np.var(tau - basis @ beta) / max(np.var(tau), 1e-300))
    unit, share = ("N" if slides else "N*m"), f"{100.0 * explained:.0f} %"
    if inertia < 0.0 and explained > 0.9:
        load = f"force decreases with the acceleration ({inertia:.2g} kg)"
        if not slides:
            load = f"torque decreases with the acceleration ({inertia:.2g} kg*m^2)"
        return Finding("gravity", "warning", weight, unit, f"The load {load}: its sign or its time stamps are wrong.")
    text = f"Gravity (m g l = {weight:.3g} N*m) and inertia explain {share} of the variance of the load torque"
    if slides:
        text = f"A mass of {max(inertia, 0.0):.3g} kg and a constant force of {weight:.3g} N explain {share} of the "
        text += "variance of the load force"
    return Finding("gravity", "good", weight, unit, f"{text}; the rest comes from other loads.")
