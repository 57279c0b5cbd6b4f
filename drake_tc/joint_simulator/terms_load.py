"""Causes that add a torque between motor and torque sensor; the last ones are in no effect library."""

from collections.abc import Mapping

import numpy as np

from drake_tc.joint_simulator.terms import State, Term
from drake_tc.types import FloatArray, IntArray


class TorqueRipple(Term):
    """A sin(count q + phase), `count` waves a turn."""

    stage = "torque"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        return x + self.p["amplitude"] * np.sin(self.p["count"] * state.q[self.index] + self.p["phase"])


class CableSpring(Term):
    """k (q - q0)."""

    stage = "torque"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        return x + self.p["stiffness"] * (state.q[self.index] - self.p["rest"])


class Touch(Term):
    """A push for `length` seconds in one run only: A sin^2 of the passed share (outside cause)."""

    stage = "torque"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        share = (state.time - self.p["start"]) / self.p["length"]
        inside = (share > 0.0) & (share < 1.0) & (self.p["run"] == self.p["only_run"])
        return np.asarray(x + self.p["amplitude"] * inside * np.sin(np.pi * share) ** 2)


class PeriodicDisturbance(Term):
    """A sin(2 pi f t + phase): another machine shakes the stand (outside cause)."""

    stage = "torque"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        angle = 2 * np.pi * self.p["frequency_hz"] * state.time + self.p["phase"] + 1.3 * self.p["run"]
        return x + self.p["amplitude"] * np.sin(angle)


class PositionTimesVelocity(Term):
    """b slope q v: a viscous drag that grows along the travel (outside cause)."""

    stage = "torque"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        return x + self.p["slope"] * np.clip(state.q[self.index], -0.9, 0.9) * state.v[self.index]


class Detent(Term):
    """A x exp((1 - x^2)/2), x = (q - centre)/width: magnets that hold in part of the travel (outside cause)."""

    stage = "torque"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        u = (state.q[self.index] - self.p["centre"]) / self.p["width"]
        return x + self.p["amplitude"] * u * np.exp(0.5 * (1.0 - u * u))


class Ageing(Term):
    """Contacts strengthen with time and are renewed by sliding (outside cause).

    dtheta/dt = 1 - |v| theta/memory (implicit), torque += gain ln(1 + theta/0.05 s) s.
    """

    stage = "torque"

    def __init__(self, index: IntArray, p: Mapping[str, FloatArray], dt: float) -> None:
        super().__init__(index, p, dt)
        self._age = np.full(index.size, 1.0)

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        sliding = np.abs(state.v[self.index])
        self._age = (self._age + self.dt) / (1.0 + self.dt * sliding / self.p["memory"])
        return x + self.p["gain"] * np.log1p(self._age / 0.05) * state.bristle[self.index]


class TriangularCam(Term):
    """A tri(count q + phase) plus its half-amplitude third harmonic as a sawtooth (outside cause)."""

    stage = "torque"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        turns = (self.p["count"] * state.q[self.index] + self.p["phase"]) / (2 * np.pi)
        triangle = 4.0 * np.abs(turns - np.floor(turns) - 0.5) - 1.0
        third = 3.0 * turns
        saw = 2.0 * np.abs(third - np.floor(third)) - 1.0
        return x + self.p["amplitude"] * (triangle + 0.5 * saw)
