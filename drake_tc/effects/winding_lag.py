"""The lag of a winding that a voltage drives: the current that the back-EMF takes off lags too."""

from collections.abc import Mapping
from math import isnan, nan

import numpy as np

from drake_tc.effects.base import Context, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.current_lag import LAG_RANGE, CurrentLag, hold_coefficients
from drake_tc.effects.kernel import DriveKernel
from drake_tc.types import FloatArray

BACK_EMF_RANGE = Plausible(
    0.0,
    1.0,
    "the back-EMF opposes the voltage, and at the highest speed it cannot exceed the largest voltage",
    "effort/speed",
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
        return (
            *self.shapes,
            Parameter(
                "back_emf", "effort*s/rad", 0.0, description="constant k_e of the joint", plausible=BACK_EMF_RANGE
            ),
        )

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

        def observe(
            position: float, velocity: float, celsius: float, supply: float, memory: list[float], at: int
        ) -> None:
            if isnan(memory[at + 2]):
                memory[at + 2] = memory[at + 3] = velocity
            memory[at + 4] = velocity

        def step(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
            velocity = memory[at + 4]
            voltage = pole * memory[at] + new * value + old * memory[at + 1]
            speed = pole * memory[at + 2] + new * velocity + old * memory[at + 3]
            memory[at : at + 4] = voltage, value, speed, velocity
            return voltage + constant * (velocity - speed)

        return DriveKernel(5, lambda value, effort: [value, value, nan, nan, 0.0], step, observe)
