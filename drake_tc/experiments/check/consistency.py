"""Whether a joint's columns can belong together: quantisation, limits, temperature, clocks, energy and gravity."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from drake_tc.config.joint_units import TORQUE
from drake_tc.diagnosis.notes import LogRemark
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.experiments.fitted import FittedJoint
from drake_tc.experiments.sizes import JointNumbers
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
    text += f", {100.0 * step / max(spread, 1e-300):.0f} % of the effort's spread: record it finer." if coarse else "."
    return Finding("command step", "warning" if coarse else "good", step, unit, text)


def _limit(prepared: Prepared) -> Finding | None:
    if any(isinstance(n, LogRemark) and "rests at its limit" in n.statement for n in prepared.train.samples.notes):
        return None  # the notes on the logs say so, of the recorded effort
    effort, unit = prepared.train.samples.signals.effort, prepared.context.units.effort
    largest = float(np.max(np.abs(effort)))
    share = float(np.mean(np.abs(effort) > 0.995 * largest))
    if share < AT_LIMIT:
        return Finding(
            "largest effort", "good", largest, unit, f"The effort rarely reaches its maximum of {largest:.3g} {unit}."
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
        f"The most probable model has {', '.join(names)} beside the declared one; close-loop asks held-out runs "
        "whether it holds."
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
        text = f"The load torque falls with the acceleration ({inertia:.2g} kg*m^2): its sign, or its clock, is wrong."
        return Finding("gravity", "warning", moment, "N*m", text)
    text = (
        f"Gravity (m g l = {moment:.3g} N*m) and inertia explain {100.0 * left:.0f} % of the load torque; the rest is "
        "other loads."
    )
    return Finding("gravity", "good", moment, "N*m", text)


def _moved_mass(acceleration: FloatArray, force: FloatArray) -> Finding:
    """Of the measured force (N,) of a joint that slides, what a mass with its weight makes."""
    basis = np.column_stack([acceleration, np.ones(force.size)])
    mass, constant = (float(b) for b in np.linalg.lstsq(basis, force, rcond=None)[0])
    share = 1.0 - float(np.var(force - basis @ [mass, constant]) / max(np.var(force), 1e-300))
    if mass < 0.0 and share > 0.9:
        text = f"The load force falls with the acceleration ({mass:.2g} kg): its sign, or its clock, is wrong."
        return Finding("gravity", "warning", constant, "N", text)
    text = (
        f"A mass of {max(mass, 0.0):.3g} kg and a constant force of {constant:.3g} N explain {100.0 * share:.0f} % of "
        "the load force; the rest is other loads."
    )
    return Finding("gravity", "good", constant, "N", text)
