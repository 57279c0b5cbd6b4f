"""What a joint's rows contain, and why an effect cannot show in them, in a sentence that an engineer can act on."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.config.joint_units import TURNING, JointUnits
from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.effects.base import Context, Effect
from drake_tc.effects.within_tolerance import WithinTolerance
from drake_tc.experiments.log_odds import NUMERICAL
from drake_tc.experiments.sizes import Size

SLOW = 0.1
"""Share of the largest speed, below which a row counts as slow."""


@dataclass(frozen=True)
class MotionFacts:
    """Of the rows in which the joint slides.

    Attributes:
        speed: Largest speed [rad/s]. slow: share of the rows that are slower than a tenth of it.
        span: Travelled range [rad]. reversals: times the motion turns over.
        load: (lowest, highest) load torque [N m]. load_crosses: whether both signs occur in motion.
        load_change: Standard deviation of |tau| over its mean.
        effort: Largest effort. effort_crosses: whether both signs occur.
        inertial: RMS of the torque that the accelerations need [N m], of a link of the whole inertia.
        rise: Change of the recorded temperature [K]; NaN where it was not recorded.
        duration: Of the longest run [s].
        units: Of the joint; torques are told as effort where nothing fixes their scale.
    """

    speed: float
    slow: float
    span: float
    reversals: int
    load: tuple[float, float]
    load_crosses: bool
    load_change: float
    effort: float
    effort_crosses: bool
    inertial: float
    rise: float
    duration: float
    units: JointUnits = TURNING

    @classmethod
    def of(cls, columns: Columns, context: Context, inertia: float) -> "MotionFacts":
        """Of training rows; `inertia` of rotor and link [kg m^2]."""
        s, rows = columns.samples.signals, columns.samples.rows
        speed, tau, effort = np.abs(s.velocity[rows]), s.expected_torque[rows], s.effort[rows]
        tau = s.load_torque[rows] if np.ptp(s.load_torque[rows]) > 0.0 else tau
        low, high = (float(np.percentile(tau, p)) for p in (1, 99))
        mean = float(np.mean(np.abs(tau)))
        margin = 0.02 * max(abs(low), abs(high), 1e-12)
        ends = np.percentile(effort, [1, 99])
        warm = context.temperature_span
        return cls(
            speed=context.max_speed,
            slow=float(np.mean(speed < SLOW * context.max_speed)),
            span=float(np.ptp(context.position_span)),
            reversals=int(np.count_nonzero(np.diff(np.sign(s.direction)))),
            load=(low, high),
            load_crosses=bool(low < -margin and high > margin),
            load_change=float(np.std(np.abs(tau))) / max(mean, 1e-12),
            effort=context.effort,
            effort_crosses=bool(ends[0] < 0.0 < ends[1]),
            inertial=inertia * float(np.sqrt(np.mean(s.acceleration[rows] ** 2))),
            rise=float(warm[1] - warm[0]),
            duration=context.duration,
            units=columns.samples.units,
        )


IMITATED = 0.25
"""Share of a contribution that the declared model must leave, below which it is said to imitate the effect."""
Reason = Callable[[MotionFacts], str]
"""A sentence where the motion explains why the effect does not show; empty where it does not."""


def _load_sign(f: MotionFacts) -> str:
    if f.load_crosses:
        return ""
    low, high = f.load
    return (
        f"The load torque never changes its sign in motion: it stays between {low:.3g} and {high:.3g} {f.units.torque}."
    )


def _load_change(f: MotionFacts) -> str:
    if f.load_change > 0.35:
        return ""
    return f"The magnitude of the load torque hardly changes: it varies by {100 * f.load_change:.0f} % about its mean."


def _never_slow(f: MotionFacts) -> str:
    if f.slow > 0.05:
        return ""
    tenth = f"a tenth of {f.speed:.3g} {f.units.position}/s"
    return f"The joint is rarely slow: only {100 * f.slow:.0f} % of the samples are below {tenth}."


def _temperature(f: MotionFacts) -> str:
    return "" if not f.rise < 5.0 else f"The recorded temperature changes by only {f.rise:.2g} K."


def _effort_sign(f: MotionFacts) -> str:
    return "" if f.effort_crosses else "The effort never changes its sign, so that it never crosses the dead zone."


def _few_reversals(f: MotionFacts) -> str:
    return "" if f.reversals >= 8 else f"The motion reverses only {f.reversals} times."


def _slow_accelerations(f: MotionFacts) -> str:
    largest = max(abs(f.load[0]), abs(f.load[1]), 1e-12)
    if f.inertial > 0.15 * largest:
        return ""
    shares = f"{f.inertial:.2g} {f.units.torque} of torques up to {largest:.3g} {f.units.torque}"
    return f"The accelerations are low: inertia accounts for {shares}."


def _small_travel(f: MotionFacts) -> str:
    return "" if f.span > f.units.large_travel else f"The joint moves over only {f.span:.2g} {f.units.position}."


def _short(f: MotionFacts) -> str:
    return "" if f.duration > 60.0 else f"The longest run lasts only {f.duration:.3g} s."


def _limit(f: MotionFacts) -> str:
    return f"A limit shows only where the effort reaches it; the largest effort is {f.effort:.3g}."


REASONS: Mapping[str, Reason] = {
    "backlash": _load_sign,
    "load_dependent_friction": _load_change,
    "directional_efficiency": _load_change,
    "stribeck": _never_slow,
    "thermal_friction": _temperature,
    "winding_temperature": _temperature,
    "deadzone": _effort_sign,
    "presliding_hysteresis": _few_reversals,
    "rotor_inertia": _slow_accelerations,
    "torque_sensor_gain": _slow_accelerations,
    "payload": _slow_accelerations,
    "elasticity": _slow_accelerations,
    "delay": _slow_accelerations,
    "current_lag": _slow_accelerations,
    "cable_spring": _small_travel,
    "torque_ripple": _small_travel,
    "position_dependent_friction": _small_travel,
    "position_dependent_load": _small_travel,
    "encoder_eccentricity": _small_travel,
    "torque_sensor_drift": _short,
    "servo_integrator": _short,
    "saturation": _limit,
}
"""By effect id, the property of the motion that usually hides it."""


@dataclass(frozen=True)
class Hidden:
    """What is known of an effect that does not show.

    Attributes:
        facts: Of the motion.
        size: Of the effect. smallest: that is found.
        kept: Share of its contribution that the rest of the model leaves. imitators: what imitates it.
        remainder: RMS that it leaves at its typical size [N m]. least: that it would need [N m].
    """

    facts: MotionFacts
    size: Size
    smallest: float
    kept: float
    imitators: Sequence[str]
    remainder: float
    least: float


def sentence(effect: Effect, hidden: Hidden) -> str:
    """Why the effect is not seen, or only weakly: tolerances first, then motion, what imitates it, and noise."""
    if hidden.imitators[:1] == [WithinTolerance.title] and hidden.kept < IMITATED:
        upto = f" up to {hidden.smallest:.2g} {hidden.size.unit}".removesuffix(" -") * math.isfinite(hidden.smallest)
        return f"Sizes{upto} may be errors of the joint's sensors within their tolerances."
    found = REASONS.get(effect.id)
    by_motion = found(hidden.facts) if found is not None else ""
    if by_motion:
        return by_motion
    size = "" if not math.isfinite(hidden.size.typical) else f" of {hidden.size.typical:.2g} {hidden.size.unit}"
    size = size.removesuffix(" -")
    if hidden.kept < IMITATED and hidden.imitators:
        share = min(99.9, 100.0 * (1.0 - hidden.kept**2))
        verb = "imitates" if len(hidden.imitators) == 1 else "together imitate"
        part = "all" if hidden.kept <= NUMERICAL else f"{share:.3g} %"
        return f"In these motions, {' and '.join(hidden.imitators)} {verb} {part} of its contribution."
    unit = hidden.facts.units.torque
    asked = f", but the noise requires at least {hidden.least:.2g} {unit}" if math.isfinite(hidden.least) else ""
    return f"An effect{size} changes the torque by {hidden.remainder:.2g} {unit}{asked}."
