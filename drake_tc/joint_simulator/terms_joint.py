"""Terms of the joint itself: its drive and its friction.

Causes inside the drive: between the command that is logged and the torque of the motor.

Causes that change friction. Sliding friction is g s; `level` terms change g, `torque` terms add to it.
"""

from collections.abc import Mapping

import numpy as np

from drake_tc.joint_simulator.terms import State, Term
from drake_tc.types import FloatArray, IntArray


class Deadzone(Term):
    """y* = sign(y) max(|y| - width, 0)."""

    stage = "effort"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        return np.asarray(np.sign(x) * np.maximum(np.abs(x) - self.p["width"] * self.p["joint.gain"], 0.0))


class Saturation(Term):
    """y* = clip(y, -limit, limit)."""

    stage = "effort"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        limit = self.p["limit"] * self.p["joint.gain"]
        return np.asarray(np.clip(x, -limit, limit))


class ServoIntegrator(Term):
    """y* = y + rate int y dt (rectangle rule)."""

    stage = "effort"

    def __init__(self, index: IntArray, p: Mapping[str, FloatArray], dt: float) -> None:
        super().__init__(index, p, dt)
        self._integral = np.zeros(index.size)

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        self._integral = self._integral + self.dt * x
        return x + self.p["rate"] * self._integral


class VelocitySignSwitch(Term):
    """y* = y (1 - delta s): the drive is weaker forwards than backwards; s follows sign(v)."""

    stage = "effort"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        return x * (1.0 - self.p["delta"] * state.bristle[self.index])


class _Delay(Term):
    """x(t - delay), linear between steps; before the start, the first value."""

    def __init__(self, index: IntArray, p: Mapping[str, FloatArray], dt: float) -> None:
        super().__init__(index, p, dt)
        steps = self.p["delay"] / dt
        self._whole = np.floor(steps).astype(np.int64)
        self._rest = steps - self._whole
        self._length = int(self._whole.max()) + 2
        self._buffer = np.zeros((self._length, index.size))
        self._columns = np.arange(index.size)
        self._head = -1

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        if self._head < 0:
            self._buffer[:] = x
        self._head += 1
        self._buffer[self._head % self._length] = x
        newer = self._buffer[(self._head - self._whole) % self._length, self._columns]
        older = self._buffer[(self._head - self._whole - 1) % self._length, self._columns]
        return np.asarray(newer + self._rest * (older - newer))


class CommandDelay(_Delay):
    """A position servo receives q_d late."""

    stage = "command"


class EffortDelay(_Delay):
    """A current or voltage drive acts late."""

    stage = "effort"


class CurrentLag(Term):
    """T dtau_m/dt = y*/K - tau_m (exact for a held input)."""

    stage = "motor"

    def __init__(self, index: IntArray, p: Mapping[str, FloatArray], dt: float) -> None:
        super().__init__(index, p, dt)
        self._torque = np.zeros(index.size)
        self._share = -np.expm1(-dt / self.p["time"])

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        self._torque = self._torque + self._share * (x - self._torque)
        return self._torque


class SupplySag(Term):
    """The drive's gain falls by a share, smoothly within 0.2 s, at an instant of each run (outside cause)."""

    stage = "motor"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        start = self.p["start"] + 3.0 * self.p["run"]
        progress = np.clip((state.time - start) / 0.2, 0.0, 1.0)
        return x * (1.0 - self.p["share"] * progress)


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
