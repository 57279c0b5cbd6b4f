"""Errors of a joint's own sensors within the tolerances that the rig file declares, as a part of every model."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from drake_tc.effects.base import Context, Parameter, SensorEffect, Shape, Signals, Signature
from drake_tc.effects.effort_bias import EffortBias
from drake_tc.effects.library import effect
from drake_tc.types import FloatArray

CUT_OFF = 3.0
"""Tolerances that an error reaches at most; a larger one is an effect of its own."""


class WithinTolerance(SensorEffect):
    """The columns, side by side, of effects of sensors with one coefficient each (`members`).

    Each coefficient theta_i has the prior N(0, t_i^2) with the declared tolerance t_i, cut off at 3 t_i. No search
    looks for this effect, and no report or model file holds it. A member that is itself among the terms of a fit takes
    the place of its part, which is then held at 0 (`problem.regression.bounds_of`).
    """

    id = "within_tolerance"
    title = "errors of the joint's sensors within tolerance"
    kind = "sensor"
    linear = True
    signature = Signature(x="load_torque", split="", look_for="nothing: such errors are expected")
    members: tuple[SensorEffect | EffortBias, ...] = ()
    tolerances: tuple[float, ...] = ()

    def __reduce__(self) -> tuple[object, tuple[tuple[tuple[str, float], ...]]]:
        names = (member.id for member in self.members)
        return within_tolerance, (tuple(zip(names, self.tolerances, strict=True)),)

    def obstacle(self, context: Context) -> str:
        """It is declared, never looked for."""
        return "tolerances are declared with `sensors`"

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, k): see the class."""
        return np.concatenate([member.columns(signals, {}) for member in self.members], axis=1)

    def balance_inertia(self, theta: FloatArray, shape: Shape, rotor_inertia: float) -> float:
        """The sum over the members."""
        parts = zip(self.members, theta, strict=True)
        return sum(member.balance_inertia(np.array([each]), shape, rotor_inertia) for member, each in parts)

    def torque_scale(self, theta: FloatArray, shape: Shape) -> float:
        """The product over the members."""
        parts = zip(self.members, theta, strict=True)
        return float(np.prod([member.torque_scale(np.array([each]), shape) for member, each in parts]))

    def corrupt(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """What the sensors would have recorded: the last member's error acts first. The effort stays as it is."""
        for member in reversed(self.members):
            signals = member.corrupt(signals, parameters) if isinstance(member, SensorEffect) else signals
        return signals

    def restore(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """The signals without these errors: the first member's error is taken off first. The effort stays as it is."""
        for member in self.members:
            signals = member.restore(signals, parameters) if isinstance(member, SensorEffect) else signals
        return signals


@lru_cache
def within_tolerance(tolerances: tuple[tuple[str, float], ...]) -> WithinTolerance:
    """The effect of these sensor effects.

    Args:
        tolerances: (id, tolerance) of each, a torque sensor's bias before its gain. The balance is that of the sensor's
            own scale, tau_meas = (1 + g) tau + b, so that b comes off before g.
    """
    members = tuple(effect(name) for name, _ in tolerances)
    sizes = tuple(size for _, size in tolerances)
    limited = tuple(
        Parameter(p.name, p.unit, -CUT_OFF * size, CUT_OFF * size)
        for member, size in zip(members, sizes, strict=True)
        for p in member.coefficients
    )
    content = {"coefficients": limited, "members": members, "tolerances": sizes, "__doc__": WithinTolerance.__doc__}
    made: WithinTolerance = type("JointSensorErrors", (WithinTolerance,), content)()
    return made
