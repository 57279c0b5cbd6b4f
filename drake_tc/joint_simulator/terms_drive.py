"""Causes inside the drive: between the command that is logged and the torque of the motor."""

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
