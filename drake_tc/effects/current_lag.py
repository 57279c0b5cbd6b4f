"""A current loop that takes its time."""

import math
from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, DriveEffect, JointNumbers, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.kernel import DriveKernel, memoryless
from drake_tc.kernels.equations import lagged
from drake_tc.kernels.joint_layout import LAG
from drake_tc.types import FloatArray


def hold_coefficients(lag: float, period: float) -> tuple[float, float, float]:
    """(p, b0, b1) of y*[n] = p y*[n-1] + b0 y[n] + b1 y[n-1], exact for y linear over each period [s]; lag > 0 [s]."""
    ratio = period / lag
    pole = math.exp(-ratio)
    share = -math.expm1(-ratio) / ratio
    return pole, 1.0 - share, share - pole


LAG_RANGE = Plausible(
    0.0,
    0.05,
    "electrical time constants L/R and current loops of servo motors lie between 0.1 and 20 ms, filters "
    "at most at 50 ms",
)


class CurrentLag(DriveEffect):
    """T dy*/dt + y* = y: first-order lag of the motor current (inductance, current loop)."""

    id = "current_lag"
    title = "lag of the motor current"
    equation = "lag * ddt(y_eff) + y_eff = y"
    kind = "drive"
    filters = True
    shapes = (Parameter("lag", "s", 0.0, 0.1, description="time constant T", plausible=LAG_RANGE),)
    signature = Signature(
        x="acceleration",
        split="direction",
        look_for="loops: the residual follows the rate of the effort, rounded",
    )

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """From half a sample to 50 ms."""
        return [{"lag": float(d)} for d in np.geomspace(max(5e-4, 0.5 * context.period), 0.05, 10)]

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """Exact for an effort that is linear between samples (first-order hold)."""
        from scipy.signal import lfilter

        if shape["lag"] <= 0.0:
            return effort
        pole, new, old = hold_coefficients(shape["lag"], signals.period)
        start = effort[0] - new * effort[0]
        return np.asarray(lfilter([new, old], [1.0, -pole], effort, zi=[start])[0])

    def undone(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """y* + T dy*/dt."""
        return np.asarray(effort + shape["lag"] * np.gradient(effort, signals.period))

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """The same recursion; memory is [y*, last y]."""
        if parameters["lag"] <= 0.0:
            return memoryless(lambda value, effort, direction: value)
        pole, new, old = hold_coefficients(parameters["lag"], period)

        def step(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
            return lagged(value, pole, new, old, memory, at)

        return DriveKernel(2, lambda value, effort: [value, value], step, kind=LAG, numbers=(pole, new, old))

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 3e-3


class CommandLag(CurrentLag):
    """T d(y* + q)/dt + y* = y: a servo that filters its command q_d, y* + q, and not the position that it measures.

    It is part of a model only where it is declared: a log tells it from a delay of the command by the corners of the
    command alone.
    """

    form = "command"
    title = "filter of the command"
    filters = False
    acts_on = "command"
    equation = "lag * ddt(y_eff + q) + y_eff = y"
    shapes = (
        Parameter(
            "lag",
            "s",
            0.0,
            1.0,
            description="time constant T",
            plausible=Plausible(0.0, 1.0, "filters of commands take up to some 0.1 s"),
        ),
    )

    def obstacle(self, context: Context) -> str:
        """Only where it is declared."""
        return "a filter of the command is known only where it is declared"

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """The effort with the filtered command in place of the command."""
        return effort - signals.command + super().transform(signals.command, signals, shape)
