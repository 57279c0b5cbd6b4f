"""Causes that change friction. Sliding friction is g s; `level` terms change g, `torque` terms add to it."""

from collections.abc import Mapping

import numpy as np

from drake_tc.joint_simulator.terms import State, Term
from drake_tc.types import FloatArray, IntArray


class Stribeck(Term):
    """g += excess exp(-|v/v_s|^exponent): friction that falls as sliding starts."""

    stage = "level"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        ratio = np.abs(state.v[self.index]) / self.p["speed"]
        return x + self.p["excess"] * np.exp(-(ratio ** self.p["exponent"]))


class LoadDependent(Term):
    """g += mu |tau|, tau the transmitted torque of the step before (at most 0.1 ms old)."""

    stage = "level"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        return x + self.p["mu"] * np.abs(state.transmitted[self.index])


class AsymmetricLevel(Term):
    """g (1 + delta s): Coulomb level C (1 + delta) forwards, C (1 - delta) backwards."""

    stage = "level"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        return x * (1.0 + self.p["delta"] * self.p["share"] * state.bristle[self.index])


class AsymmetricViscous(Term):
    """torque += delta b |v|: viscous coefficient b (1 + delta) forwards, b (1 - delta) backwards."""

    stage = "torque"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        return x + self.p["delta"] * self.p["joint.viscous"] * np.abs(state.v[self.index])


class PositionDependent(Term):
    """g (1 + alpha cos(cycles q + phase)); never below a tenth of g."""

    stage = "level"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        wave = self.p["alpha"] * np.cos(self.p["cycles"] * state.q[self.index] + self.p["phase"])
        return x * np.maximum(1.0 + wave, 0.1)


class ThermalLevel(Term):
    """g exp(-k_c (T - T_ambient))."""

    stage = "level"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        rise = state.temperature[self.index] - self.p["joint.ambient"]
        return x * np.exp(-self.p["rate"] * self.p["coulomb_share"] * rise)


class ThermalViscous(Term):
    """torque += b v (exp(-k_v (T - T_ambient)) - 1)."""

    stage = "torque"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        rise = state.temperature[self.index] - self.p["joint.ambient"]
        factor = np.expm1(-self.p["rate"] * self.p["viscous_share"] * rise)
        return x + self.p["joint.viscous"] * state.v[self.index] * factor


class QuadraticViscous(Term):
    """torque += b2 |v| v."""

    stage = "torque"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        v = state.v[self.index]
        return x + self.p["b2"] * np.abs(v) * v


class SlowBristle(Term):
    """Presliding: a share of the Coulomb friction acts through a second, slow bristle of 5 to 50 mrad.

    torque += share C (s_slow - s),   ds_slow/dt = (v - |v| s_slow)/length;  share <= 1 keeps both parts dissipative.
    """

    stage = "torque"

    def __init__(self, index: IntArray, p: Mapping[str, FloatArray], dt: float) -> None:
        super().__init__(index, p, dt)
        self._slow = np.zeros(index.size)

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        self._slow = step_bristle(self._slow, state.v[self.index], self.p["length"], self.dt)
        return x + self.p["share"] * self.p["joint.coulomb"] * (self._slow - state.bristle[self.index])


def step_bristle(s: FloatArray, v: FloatArray, length: FloatArray, dt: float) -> FloatArray:
    """One implicit step of ds/dt = (v - |v| s)/length: s[n+1] = (s + h v)/(1 + h |v|), h = dt/length.

    |s| <= 1 is kept exactly for any step: (|s| + h|v|)/(1 + h|v|) <= 1.
    """
    h = dt / length
    return np.asarray((s + h * v) / (1.0 + h * np.abs(v)))
