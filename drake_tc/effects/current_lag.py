"""A current loop that takes its time."""

import math
from collections.abc import Mapping
from math import isnan, nan

import numpy as np

from drake_tc.effects.base import Context, DriveEffect, JointNumbers, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.kernel import DriveKernel, DriveSurroundings, memoryless
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
        numbers = hold_coefficients(parameters["lag"], period)

        def step(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
            return lagged(value, numbers, memory, at)

        return DriveKernel(2, lambda value, effort: [value, value], step, kind=LAG, numbers=numbers)

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


BACK_EMF = Parameter(
    "back_emf",
    "effort*s/rad",
    0.0,
    description="constant k_e of the joint",
    plausible=Plausible(
        0.0,
        1.0,
        "the back-EMF opposes the voltage, and at the highest speed it cannot exceed the largest voltage",
        "effort/speed",
    ),
)
LEAST_LAG = 1e-4
"""Shortest time constant of a winding that is fitted [s]; `LAG_RANGE` has its source.

For T to 0 the column T F_e qddot keeps its size if F_e grows as 1/T: without this bound the term becomes an inertia.
"""


class WindingLag(CurrentLag):
    """A winding has L di/dt + R i = V - k_e qdot, k_e on the joint's side [V s/rad].

    With T = L/R and tau_motor = k_t N i that is

        T dtau_motor/dt + tau_motor = V/K - F_e qdot,      K = R/(k_t N),  F_e = k_e/K.

    A drive without inductance takes F_e qdot off at once, and the joint's viscous friction F_v holds that. With it the
    torque is lag[V]/K - F_e lag[qdot], so that beside F_v qdot the balance misses F_e (lag[qdot] - qdot):

        lag[V]/K = tau + J qddot + F_v qdot + F_e (lag[qdot] - qdot) + ...
    """

    title = "lag of the winding's current, its back-EMF included"
    equation = "lag * ddt(y_eff) + y_eff = y + back_emf * lag * qddot"
    form = "winding"
    shapes = (Parameter("lag", "s", LEAST_LAG, 0.1, LEAST_LAG, "time constant L/R", LAG_RANGE),)
    coefficients = (Parameter("back_emf_damping", "N*m*s/rad", 0.0, description="F_e"),)
    signature = Signature(
        x="acceleration",
        split="direction",
        look_for="loops: the residual follows the rate of the voltage and that of the speed, rounded",
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """T and k_e."""
        return (*self.shapes, BACK_EMF)

    def obstacle(self, context: Context) -> str:
        """Only a voltage is opposed by a back-EMF."""
        return "" if context.drive == "voltage" else "back-EMF changes the current of voltage drives only"

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """lag[qdot] - qdot (T, 1)."""
        return np.asarray(self._lagged(signals.velocity, signals, shape) - signals.velocity)[:, None]

    def _lagged(self, values: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        from scipy.signal import lfilter

        if shape["lag"] <= 0.0 or signals.period <= 0.0:
            return values
        pole, new, old = hold_coefficients(shape["lag"], signals.period)
        start = values[0] - new * values[0]
        return np.asarray(lfilter([new, old], [1.0, -pole], values, zi=[start])[0])

    def physical(self, theta: FloatArray, shape: Shape, gain: float) -> dict[str, float]:
        """k_e = F_e K."""
        return {"lag": float(shape["lag"]), "back_emf": float(theta[0]) * gain}

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """y* = lag[y] + k_e (qdot - lag[qdot]); memory is [lag[y], last y, lag[qdot], last qdot, qdot now]."""
        lag, constant = parameters["lag"], parameters["back_emf"]
        if lag <= 0.0:
            return super().kernel(parameters, period)
        pole, new, old = hold_coefficients(lag, period)

        def observe(now: DriveSurroundings, memory: list[float], at: int) -> None:
            if isnan(memory[at + 2]):
                memory[at + 2] = memory[at + 3] = now.velocity
            memory[at + 4] = now.velocity

        def step(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
            velocity = memory[at + 4]
            voltage = pole * memory[at] + new * value + old * memory[at + 1]
            speed = pole * memory[at + 2] + new * velocity + old * memory[at + 3]
            memory[at : at + 4] = voltage, value, speed, velocity
            return voltage + constant * (velocity - speed)

        return DriveKernel(5, lambda value, effort: [value, value, nan, nan, 0.0], step, observe)
