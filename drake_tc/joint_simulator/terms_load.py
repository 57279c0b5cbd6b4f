"""Terms of the load, and what comes from outside.

Causes that add a torque between motor and torque sensor; the last ones are in no effect library.

Outside causes, part two: what no effect of a library explains and no recorded signal announces.
"""

from collections.abc import Mapping

import numpy as np

from drake_tc.joint_simulator.reference import BandNoise, random_instants
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


LOW_HZ, HIGH_HZ = 1.0, 5.0
"""Band of the random disturbance [Hz]."""
RISE = 0.3
"""A long touch sets in and ends over this time [s]."""


def _seeds(p: Mapping[str, FloatArray]) -> list[list[int]]:
    """A seed for each column, of the cause's own seed and the run."""
    return [[int(seed), int(run)] for seed, run in zip(p["noise_seed"], p["run"], strict=True)]


class RandomDisturbance(Term):
    """A n(t), n of RMS 1 between 1 and 5 Hz: an unrecorded force that shakes the joint at random."""

    stage = "torque"

    def __init__(self, index: IntArray, p: Mapping[str, FloatArray], dt: float) -> None:
        super().__init__(index, p, dt)
        self._noise = BandNoise.draw(_seeds(self.p), LOW_HZ, HIGH_HZ)

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        return x + self.p["amplitude"] * self._noise.at(state.time)


class LongTouch(Term):
    """A w(t): somebody leans on the joint for `length` seconds of one run; w rises and falls within 0.3 s."""

    stage = "torque"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        passed = state.time - self.p["start"]
        rise = np.clip(np.minimum(passed, self.p["length"] - passed) / RISE, 0.0, 1.0)
        touched = self.p["run"] == self.p["only_run"]
        return np.asarray(x + self.p["amplitude"] * touched * np.sin(0.5 * np.pi * rise) ** 2)


class EndStop(Term):
    """k max(d + T ddot, 0) s in contact, d = s q - stop > 0: a rubber stop at one end of the travel, s = +1 or -1.

    A Kelvin-Voigt element of stiffness k and relaxation time T that pushes and never pulls. Without its damping a
    smooth curve over the position would explain it.
    """

    stage = "torque"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        side = self.p["side"]
        depth = side * state.q[self.index] - self.p["stop"]
        pressed = np.maximum(depth + self.p["time"] * side * state.v[self.index], 0.0) * (depth > 0.0)
        return np.asarray(x + self.p["stiffness"] * pressed * side)


class LoadTimesSpeed(Term):
    """c |tau| v: a worm or cycloid whose viscous friction grows with the load (tau of the step before)."""

    stage = "torque"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        return x + self.p["slope"] * np.abs(state.transmitted[self.index]) * state.v[self.index]


class DriveDropout(Term):
    """tau_m (1 - share) for `length` seconds at one random instant in every 2.5 s: a brown-out of the supply."""

    stage = "motor"
    COUNT = 12
    SPACING = 2.5

    def __init__(self, index: IntArray, p: Mapping[str, FloatArray], dt: float) -> None:
        super().__init__(index, p, dt)
        self._start = np.stack([random_instants(seed, self.COUNT, self.SPACING) for seed in _seeds(self.p)])

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        passed = state.time - self._start
        out = ((passed >= 0.0) & (passed < self.p["length"][:, None])).any(axis=1)
        return np.asarray(x * (1.0 - self.p["share"] * out))


class FrictionJump(Term):
    """g falls to g (1 - share) within 20 ms at one instant of each run: a seal lets go, whatever the temperature."""

    stage = "level"

    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The class's equation."""
        progress = np.clip((state.time - self.p["start"] - 3.0 * self.p["run"]) / 0.02, 0.0, 1.0)
        return x * (1.0 - self.p["share"] * progress)
