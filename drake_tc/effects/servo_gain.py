"""A drive whose gain is not what its owner declares."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, DriveEffect, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.kernel import DriveKernel, memoryless
from drake_tc.types import FloatArray

GAIN_RANGE = Plausible(
    -0.9,
    9.0,
    "a gain that is off by more than a factor of ten is an error of units (rig file, key `units`)",
)


class ServoGain(DriveEffect):
    """y* = (1 + e) y, so that 1/K = (1 + e)/K_0 with the declared gain K_0 (rig file, key `drive_gain`).

    A fit whose drive gain is free holds e in its 1/K, and this column is then the drive's own. It can be looked for
    only where the fit holds 1/K at 1/K_0; it is linear in e/K_0 there.
    """

    id = "servo_gain"
    title = "drive gain that is not the declared one"
    kind = "drive"
    linear = True
    coefficients = (Parameter("gain_torque", "N*m/effort"),)
    signature = Signature(x="effort", split="", look_for="a straight line through zero, the same in both directions")

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The relative error e of 1/K."""
        return (Parameter("gain_error", "-", -1.0, 100.0, description="e", plausible=GAIN_RANGE),)

    def obstacle(self, context: Context) -> str:
        """Needs a declared gain."""
        return "" if context.declared.get("drive_gain") else "no drive gain is declared"

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """-y (T, 1)."""
        return -signals.effort[:, None]

    def physical(self, theta: FloatArray, shape: Shape, gain: float) -> dict[str, float]:
        """E = theta K_0; `gain` is the declared K_0, at which the fit holds the drive."""
        return {"gain_error": float(theta[0]) * gain}

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """The error acts through its column."""
        return effort

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """No memory; acts on the raw effort, as the column does."""
        error = parameters["gain_error"]
        return memoryless(lambda value, effort, direction: value + error * effort)

    def inverse(
        self, effort: FloatArray, direction: FloatArray, parameters: Mapping[str, FloatArray | float]
    ) -> FloatArray:
        """y/(1 + e); the effort itself where the drive is dead (e = -1)."""
        gain = 1.0 + np.asarray(parameters["gain_error"])
        alive = np.abs(gain) > 1e-6
        return np.asarray(np.where(alive, effort / np.where(alive, gain, 1.0), effort))


def gain_error(gain: float, interval: tuple[float, float], declared: float) -> tuple[float, tuple[float, float]]:
    """E and its interval from a fit with a free gain: 1 + e = K_0/K.

    Args:
        gain: Fitted K [effort/(N m)].
        interval: Its 95 % interval.
        declared: K_0 [effort/(N m)].
    """
    low, high = (declared / x - 1.0 for x in (interval[1], interval[0]))
    return declared / gain - 1.0, (low, high)
