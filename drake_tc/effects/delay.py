"""Time between the command and the torque."""

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from scipy import ndimage

from drake_tc.effects.base import Context, DriveEffect, JointNumbers, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.kernel import DriveKernel
from drake_tc.kernels.equations import delayed
from drake_tc.kernels.joint_layout import DELAY
from drake_tc.types import FloatArray

REACH = 30
"""Samples beyond which a cubic spline's weights are below the rounding error."""


def shift(values: FloatArray, samples: float) -> FloatArray:
    """values(t - d) on a uniform clock, d in samples, by cubic splines; constant beyond the ends.

    Straight lines between samples would smooth the noise away, most at half a sample.
    """
    if samples == 0.0 or values.size < 4:
        return values
    whole = math.floor(-samples)
    f = -samples - whole
    pad = REACH + abs(whole)
    padded = np.empty(values.size + 2 * pad)
    padded[:pad], padded[pad:-pad], padded[-pad:] = values[0], values, values[-1]
    weights = np.array([(1 - f) ** 3, 4 - 3 * f**2 * (2 - f), 1 + 3 * f * (1 + f - f**2), f**3]) / 6.0
    first = pad + whole - 1
    return np.correlate(ndimage.spline_filter1d(padded)[first : first + values.size + 3], weights)


DELAY_RANGE = Plausible(
    0.0,
    0.05,
    "drives, field buses and sampling are late by at most some 50 ms, and never early",
)


class Delay(DriveEffect):
    """y*(t) = y(t - d): the whole effort acts late."""

    id = "delay"
    title = "delay"
    equation = "y_eff(t) = y(t - delay)"
    kind = "drive"
    form = "loop"
    filters = True
    ages_of: ClassVar[Mapping[str, float]] = {"command": 1.0, "effort": 1.0, "inside": 1.0}
    shapes: ClassVar[tuple[Parameter, ...]] = (
        Parameter("delay", "s", 0.0, 0.2, description="time by which the effort acts later", plausible=DELAY_RANGE),
    )
    signature = Signature(
        x="acceleration", split="direction", look_for="loops: the residual follows the rate of the effort"
    )

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """From a third of a sample to 60 ms."""
        return [{"delay": float(d)} for d in np.geomspace(max(5e-4, 0.3 * context.period), 0.06, 10)]

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """y(t - d)."""
        return shift(effort, shape["delay"] / signals.period)

    def undone(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """y*(t + d)."""
        return shift(effort, -shape["delay"] / signals.period)

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """Memory is a ring of past values and the place of the newest."""
        samples = parameters["delay"] / period
        whole = math.floor(samples)
        part = samples - whole

        def step(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
            return delayed(value, whole, part, memory, at)

        ring = whole + 2
        return DriveKernel(
            1 + ring, lambda value, effort: [0.0] + [value] * ring, step, kind=DELAY, numbers=(float(whole), part)
        )

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 3e-3


class CommandDelay(Delay):
    """q_d acts late and q does not: y*(t) = q_d(t - d) - q(t)."""

    form = "command"
    filters = False
    equation = "y_eff(t) = q_d(t - delay) - q(t)"
    acts_on = "command"

    def obstacle(self, context: Context) -> str:
        """For other drives the command is the effort."""
        return "" if context.drive == "position_servo" else "the command is the effort, so that delay.loop describes it"

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """The late effort y - (q_d - q_d(t - d))."""
        return effort - signals.command + shift(signals.command, shape["delay"] / signals.period)

    def undone(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """The effort y* + (q_d - q_d(t - d))."""
        return 2.0 * effort - self.transform(effort, signals, shape)


class CommonDelay(Delay):
    """y*(t) = y(t - d) with one d for all joints: the fit of a single joint does not move it.

    No search of a joint looks for it; `drake_tc.diagnosis.robot.common_delay` finds it on all joints together.
    """

    shapes: ClassVar[tuple[Parameter, ...]] = ()
    given_shapes: ClassVar[tuple[Parameter, ...]] = Delay.shapes
