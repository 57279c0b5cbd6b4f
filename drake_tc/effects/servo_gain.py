"""A drive whose gain is not what its owner declares."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, DriveEffect, Parameter, Plausible, Shape, Signals, Signature, Values
from drake_tc.effects.kernel import DriveKernel, memoryless
from drake_tc.types import FloatArray

GAIN_RANGE = Plausible(
    -0.9,
    9.0,
    "a gain that is off by more than a factor of ten is an error of units (rig file, key `units`)",
)


class ServoGain(DriveEffect):
    """y* = (1 + e) y, so that 1/K = (1 + e)/K_0 with the declared gain K_0 (rig file, key `drive_gain`).

    The declared model holds the drive at K_0. With this effect the fit's 1/K is free, and e = K_0/K - 1; the effect has
    no column of its own.
    """

    id = "servo_gain"
    title = "drive gain that is not the declared one"
    equation = "y_eff = (1 + gain_error) * y"
    kind = "drive"
    linear = True
    given_shapes = (Parameter("declared_gain", "effort/(N*m)", 0.0, description="declared gain K_0"),)
    signature = Signature(x="effort", split="", look_for="a straight line through zero, the same in both directions")

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The relative error e of 1/K."""
        return (
            Parameter(
                "gain_error",
                "-",
                -1.0,
                100.0,
                description="torque for 1 unit of effort over the declared one, minus 1",
                plausible=GAIN_RANGE,
            ),
        )

    @property
    def degrees_of_freedom(self) -> int:
        """One: the drive gain itself."""
        return 1

    def obstacle(self, context: Context) -> str:
        """Needs a declared gain."""
        if context.load == "unknown":
            return "the load is unknown, and only the declared gain fixes the scale of the torques"
        if context.load == "links":
            return "the links' masses are fitted, and only the declared gain fixes the scale of the torques"
        return "" if context.declared.get("drive_gain") else "no drive gain is declared"

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """The declared gain."""
        return [{"declared_gain": float(context.declared["drive_gain"])}]

    def physical(self, theta: FloatArray, shape: Shape, gain: float) -> dict[str, float]:
        """The error e = K_0/K - 1 with the fitted gain K."""
        return {"gain_error": shape["declared_gain"] / gain - 1.0}

    def drive_gain(self, gain: float, shape: Shape) -> float:
        """A model that lists this effect has the declared gain: the effect holds the rest."""
        return float(shape["declared_gain"])

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """(1 + e) y; in a fit, whose shapes hold no e, the error acts through the drive gain instead."""
        return np.asarray(effort * (1.0 + shape.get("gain_error", 0.0)))

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """No memory; acts on the raw effort."""
        error = parameters["gain_error"]
        return memoryless(lambda value, effort, direction: value + error * effort)

    def inverse(
        self, effort: FloatArray, position: FloatArray, direction: FloatArray, parameters: Values
    ) -> FloatArray:
        """y/(1 + e); the effort itself where the drive is dead (e = -1)."""
        gain = 1.0 + np.asarray(parameters["gain_error"])
        alive = np.abs(gain) > 1e-6
        return np.asarray(np.where(alive, effort / np.where(alive, gain, 1.0), effort))
