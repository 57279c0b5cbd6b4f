"""Torque effects whose equation is one of `drake_tc.kernels.torque_equations`."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from drake_tc.effects.base import Shape, Signals, TorqueEffect
from drake_tc.effects.kernel import EquationKernel
from drake_tc.kernels.torque_equations import EQUATIONS, JointState
from drake_tc.types import FloatArray


class EquationEffect(TorqueEffect):
    """A torque effect with one equation for fit, simulation and compensation, which the last two run compiled.

    A subclass names the equation and, where these are not its parameters in their order, the equation's numbers.
    """

    torque_kind: ClassVar[int]
    """Kind of the equation (`drake_tc.kernels.torque_equations`)."""

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """The equation's numbers n from the parameters; each may be an array."""
        return tuple(parameters[p.name] for p in self.parameters)

    def hysteresis(self, signals: Signals, shape: Shape) -> FloatArray | float:
        """The effect's own hysteretic state in [-1, 1] over a log (T,); 0 where it has none."""
        return 0.0

    def kernel(self, parameters: Mapping[str, float]) -> EquationKernel:
        """The equation at one joint and one instant."""
        return EquationKernel(self.torque_kind, tuple(map(float, self.numbers(parameters))))

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, k): the equation for one unit of each coefficient."""
        units = np.eye(len(self.coefficients))[:, :, None]
        each = dict(zip((p.name for p in self.coefficients), units, strict=True)) | dict(shape)
        rows = self._torques(signals, each, len(units), self.hysteresis(signals, shape))
        return np.ascontiguousarray(rows.T)

    def equation_torque(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> FloatArray:
        """The equation's torque (T,) for the values of `parameters`, of an effect that is fitted by other coefficients.

        It holds J qddot. Each parameter may be one value a joint (T,).
        """
        return np.asarray(self._torques(signals, parameters, 1, 0.0)[0])

    def _torques(
        self, signals: Signals, parameters: Mapping[str, Any], count: int, hysteresis: FloatArray | float
    ) -> FloatArray:
        """(count, T) of parameters that are numbers, (count, 1) or (T,)."""
        q, v, direction, tau = signals.position, signals.velocity, signals.direction, signals.load_torque
        now = JointState(q, v, direction, tau, signals.temperature, hysteresis)
        level, damping, rest = EQUATIONS[self.torque_kind](now, self.numbers(parameters))
        total, inertia = np.zeros((count, len(signals))), self.inertia(parameters)
        for part, signal in ((level, direction), (damping, v), (rest, 1.0), (inertia, signals.acceleration)):
            if np.ndim(part) or part:
                total += part * signal
        return total
