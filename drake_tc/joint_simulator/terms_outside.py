"""Outside causes, part two: what no effect of a library explains and no recorded signal announces."""

from collections.abc import Mapping

import numpy as np

from drake_tc.joint_simulator.random_signals import BandNoise, random_instants
from drake_tc.joint_simulator.terms import State, Term
from drake_tc.types import FloatArray, IntArray

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
