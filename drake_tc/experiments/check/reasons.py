"""What a joint's rows contain, and why an effect cannot show in them, in a sentence that an engineer can act on."""

import math
from dataclasses import dataclass

import numpy as np

from drake_tc.config.joint_units import TURNING, JointUnits
from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.effects.base import Context, Effect
from drake_tc.effects.within_tolerance import WithinTolerance
from drake_tc.experiments.log_odds import IMITATED, NUMERICAL, EffectOdds

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


INERTIAL = ("rotor_inertia", "torque_sensor_gain", "payload", "elasticity", "delay", "current_lag")
"""Effects that show in accelerations."""
TRAVELLING = (
    *("cable_spring", "torque_ripple", "position_dependent_friction", "position_dependent_load"),
    "encoder_eccentricity",
)
"""Effects that show over a long travel."""


def by_motion(effect_id: str, f: MotionFacts) -> str:
    """A sentence where the motion explains why the effect does not show; empty where it does not."""
    torque, position, largest = f.units.torque, f.units.position, max(abs(f.load[0]), abs(f.load[1]), 1e-12)
    reasons = (
        (
            ("backlash",),
            not f.load_crosses,
            f"The load torque never changes its sign in motion: it stays between {f.load[0]:.3g} and "
            f"{f.load[1]:.3g} {torque}.",
        ),
        (
            ("load_dependent_friction", "directional_efficiency"),
            f.load_change <= 0.35,
            f"The magnitude of the load torque hardly changes: it varies by {100 * f.load_change:.0f} % about its "
            "mean.",
        ),
        (
            ("stribeck",),
            f.slow <= 0.05,
            f"The joint is rarely slow: only {100 * f.slow:.0f} % of the samples are below a tenth of "
            f"{f.speed:.3g} {position}/s.",
        ),
        (
            ("thermal_friction", "winding_temperature"),
            f.rise < 5.0,
            f"The recorded temperature changes by only {f.rise:.2g} K.",
        ),
        (
            ("deadzone",),
            not f.effort_crosses,
            "The effort never changes its sign, so that it never crosses the dead zone.",
        ),
        (("presliding_hysteresis",), f.reversals < 8, f"The motion reverses only {f.reversals} times."),
        (
            INERTIAL,
            f.inertial <= 0.15 * largest,
            f"The accelerations are low: inertia accounts for {f.inertial:.2g} {torque} of torques up to "
            f"{largest:.3g} {torque}.",
        ),
        (TRAVELLING, f.span <= f.units.large_travel, f"The joint moves over only {f.span:.2g} {position}."),
        (
            ("torque_sensor_drift", "servo_integrator"),
            f.duration <= 60.0,
            f"The longest run lasts only {f.duration:.3g} s.",
        ),
        (
            ("saturation",),
            True,
            f"A limit shows only where the effort reaches it; the largest effort is {f.effort:.3g}.",
        ),
    )
    return next((text for ids, hides, text in reasons if hides and effect_id in ids), "")


def why_hidden(effect: Effect, odds: EffectOdds, facts: MotionFacts, smallest: float, kept: float) -> str:
    """Why the effect is not seen, or only weakly: tolerances first, then motion, what imitates it, and noise.

    Args:
        effect: The effect.
        odds: Of the logs.
        facts: Of the motion.
        smallest: Size that is found.
        kept: Share of its contribution that the rest of the model leaves.
    """
    size, variant = odds.sizes[effect.key], odds.middle(effect)
    imitators = odds.imitators(variant, max(size.typical, 1e-300))
    if imitators[:1] == [WithinTolerance.title] and kept < IMITATED:
        upto = f" up to {size.text(smallest, 2)}" * math.isfinite(smallest)
        return f"Sizes{upto} may be errors of the joint's sensors within their tolerances."
    moved = by_motion(effect.id, facts)
    if moved:
        return moved
    if kept < IMITATED and imitators:
        verb = "imitates" if len(imitators) == 1 else "together imitate"
        part = "all" if kept <= NUMERICAL else f"{min(99.9, 100.0 * (1.0 - kept**2)):.3g} %"
        return f"In these motions, {' and '.join(imitators)} {verb} {part} of its contribution."
    unit, gain = facts.units.torque, odds.fitted.gain
    typical = odds.left(variant, size.typical) / gain if size.typical > 0.0 else 0.0
    asked = ""
    if 0.0 < smallest < math.inf:
        asked = f", but the noise requires at least {odds.left(variant, smallest) / gain:.2g} {unit}"
    of = f" of {size.text(size.typical, 2)}" * math.isfinite(size.typical)
    return f"An effect{of} changes the torque by {typical:.2g} {unit}{asked}."
