"""`SeriesElasticSpec`: which torque law a series-elastic joint runs, and its numbers."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from drake_tc.errors import ParamsError

Mode = Literal["observer", "last_step_friction", "feedforward", "feedforward_p", "pi", "momentum_observer"]
MOST_TICKS = 10_000
"""Longest time of a spec [control periods]."""
WITH_P: tuple[Mode, ...] = ("observer", "last_step_friction", "feedforward_p", "pi", "momentum_observer")
"""Laws that feed the torque error back in proportion."""


@dataclass(frozen=True)
class SeriesElasticSpec:
    """One torque law (Faraji et al., 2015, section II.B); the same interface for the paper's and for those it is
    compared with.

    Attributes:
        mode: `observer`: inverse motor model, one-step friction observer that knows reversals in advance, P.
            `last_step_friction`: the last step's friction as it was. `feedforward`: inverse motor model with the
            friction of its parameters. `feedforward_p`: the same with P. `pi`: P and I of the torque error alone.
            `momentum_observer`: as `observer`, with the generalized-momentum observer of friction.
        kp: Motor torque for a torque error [N m/(N m)]: P = kp Rm/(kt N); not used by `feedforward`.
        ki: Integral gain of `pi` [1/s].
        leak: Factor a little below 1 on the observed friction [-]; of the two one-step observers.
        step: Length of the step whose friction they take for the next [s].
        momentum_gain: K of `momentum_observer` [rad/s].
        delay: Time from a voltage being computed to it reaching the motor, plus the age of the readings [s].
        horizon: Time by which the desired torque is extrapolated [s]; 0: to the middle of the tick, for which a voltage
            is held.
        spring_time: Assumed damping of the spring over its stiffness [s].
        reference_window: Length of the stretch of the desired torque to which a cubic is fitted for its derivatives
            [s]; 0: no derivatives, for a torque that contains noisy feedback.
        speed_step: Time over which the travel of the motor gives its speed [s].
        speed_bandwidth: Bandwidth with which the measured speed corrects the desired one [rad/s].
        friction_speed: v_s [rad/s] of tanh(v/v_s) where friction is taken from the parameters.

    Raises:
        ParamsError: a value that is not possible.
    """

    mode: Mode = "observer"
    kp: float = 0.3
    ki: float = 0.0
    leak: float = 0.98
    step: float = 0.005
    momentum_gain: float = 30.0
    delay: float = 0.015
    horizon: float = 0.0
    spring_time: float = 0.0
    reference_window: float = 0.01
    speed_step: float = 0.004
    speed_bandwidth: float = 20.0
    friction_speed: float = 0.01

    def __post_init__(self) -> None:
        if self.mode not in get_args(Mode):
            raise ParamsError(f"control.mode: expected one of {', '.join(get_args(Mode))}, got {self.mode!r}")
        for name in ("step", "momentum_gain", "speed_step", "speed_bandwidth", "friction_speed"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise ParamsError(f"control.{name}: expected a positive number, got {getattr(self, name)!r}")
        for name in ("kp", "ki", "delay", "horizon", "reference_window", "spring_time"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise ParamsError(f"control.{name}: expected a number >= 0, got {getattr(self, name)!r}")
        if not 0.0 <= self.leak <= 1.0:
            raise ParamsError(f"control.leak: expected a factor from 0 to 1, got {self.leak!r}")
        if self.horizon > 0.0 and self.reference_window == 0.0:
            raise ParamsError("control.horizon: expected a reference_window > 0 to extrapolate from")

    def ticks(self, name: str, dt: float) -> int:
        """A time of the spec in control periods, one at least but for delay and window.

        Raises:
            ParamsError: it is no whole number of periods, within 1e-6 of one.
        """
        ticks: float = getattr(self, name) / dt
        if not abs(ticks) <= MOST_TICKS:
            raise ParamsError(
                f"control.{name}: expected at most {MOST_TICKS} periods of {dt:g} s; got {getattr(self, name):g} s"
            )
        if abs(ticks - round(ticks)) > 1e-6 or (round(ticks) < 1 and name not in ("delay", "reference_window")):
            raise ParamsError(
                f"control.{name}: expected a multiple of the period {dt:g} s, got {getattr(self, name):g} s"
            )
        return round(ticks)
