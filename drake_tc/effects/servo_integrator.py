"""Integral action inside the vendor's servo."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, DriveEffect, JointNumbers, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.kernel import DriveKernel
from drake_tc.kernels.equations import integrated
from drake_tc.kernels.joint_layout import INTEGRAL
from drake_tc.types import FloatArray

INTEGRAL_RATE_RANGE = Plausible(
    0.0,
    50.0,
    "integral action faster than the position loop (about 50 1/s) makes it unstable, and so does negative action",
)


class ServoIntegrator(DriveEffect):
    """y* = y + K_i int y dt, from the start of the run: a position servo that is a PID, not a PD.

    Linear, so it is looked for as a column: the motor torque it already supplies counts against the need.
    """

    id = "servo_integrator"
    title = "integral action of the servo"
    equation = "y_eff = y + integral_rate * integral(y)"
    kind = "drive"
    linear = True
    unknown_start = True
    coefficients = (Parameter("integral_torque", "N*m/(effort*s)", 0.0),)
    size = ("integral_rate", "1/s")
    shapes = ()
    signature = Signature(x="time", split="", look_for="a slow rise while the effort keeps its sign")

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """K_i."""
        return (
            Parameter(
                "integral_rate",
                "1/s",
                0.0,
                description="integral gain over proportional gain",
                plausible=INTEGRAL_RATE_RANGE,
            ),
        )

    def obstacle(self, context: Context) -> str:
        """Another drive's effort is recorded behind any integral action."""
        return "" if context.drive == "position_servo" else "the recorded effort contains the integral action"

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """-int y dt (T, 1)."""
        from scipy.signal import lfilter

        y = signals.effort
        integral = lfilter([0.5, 0.5], [1.0, -1.0], y, zi=[-0.5 * y[0]])[0] * signals.period
        return -np.asarray(integral)[:, None]

    def physical(self, theta: FloatArray, shape: Shape, gain: float) -> dict[str, float]:
        """K_i = theta K [1/s]."""
        return {"integral_rate": float(theta[0]) * gain}

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """The integral acts through its column."""
        return effort

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """Trapezoidal integral of the raw effort; memory is [integral, last effort]."""
        numbers = parameters["integral_rate"], 0.5 * period

        def step(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
            return integrated(value, effort, numbers, memory, at)

        return DriveKernel(2, lambda value, effort: [-period * effort, effort], step, kind=INTEGRAL, numbers=numbers)

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 0.2

    def unit_coefficients(self, n: JointNumbers) -> tuple[FloatArray, ...]:
        """See `Effect.unit_coefficients`."""
        return (np.array([1.0 / n.gain]),)
