"""The search for a motion keeps the limits and never loses."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.effects.base import Context, JointNumbers, plain_signals
from drake_tc.effects.library import effect
from drake_tc.effects.presliding_hysteresis import PreslidingHysteresis
from drake_tc.experiments.design.criteria import Criterion, Worth
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.motions import JointLimits, motion_basis
from drake_tc.experiments.design.search import MotionSearch

LIMITS = JointLimits((-0.8, 0.8), 2.0, 9.0)


@pytest.fixture
def joint() -> DesignJoint:
    numbers = JointNumbers(2e-2, 3.0, 2.0, 1.2, 30.0, 0.6, 2.0, 1.6)
    context = Context(drive="current", load="torque", recorded=frozenset(), max_speed=2.0, position_span=(-0.8, 0.8))
    declared = (Term(effect("viscous")), Term(effect("coulomb")))
    return DesignJoint("joint", numbers, context, 0.3, 0.9, 18.0, 0.0, 0.0, declared, 0.1, 60.0, 2e-3)


class Hill(Criterion):
    """Highest where the motion is largest: its worth is the mean square of the position over that of the limits."""

    def worth(self, fitted):
        q = fitted.evidence.model.train.samples.signals.position
        return Worth((), float(np.mean(q**2)) / LIMITS.position[1] ** 2, 0.0)

    def sentences(self, rows, noun, gain):
        return ()


def test_a_search_climbs_within_the_limits_and_never_loses(joint):
    """Of all motions within +-q the one that waits at both ends has the largest mean square, q^2."""
    basis = motion_basis("fourier", 10.0, 0.02, replace(LIMITS, bandwidth_hz=1.0))
    search = MotionSearch((joint,), basis, LIMITS, Hill(), 1)
    first, found = (search.best(np.random.default_rng(0), starts=1, trials=trials) for trials in (0, 200))
    assert first.value == first.start_value == found.start_value < found.value <= 1.0
    motion = basis.motion(found.x[0])
    for order, (low, high) in enumerate(LIMITS.bounds):
        assert low * (1.0 + 1e-9) <= motion[order].min() and motion[order].max() <= high * (1.0 + 1e-9)


def test_the_bristle_of_a_smoothed_direction_follows_dahl():
    """Dahl's equation dz/ds = (sign(v) - z)/s_p, integrated in small steps, beside a direction that turns over slowly.

    Away from the reversals the smoothed direction is 1, and the state is the same.
    """
    time = np.arange(0.0, 8.0, 1e-3)
    q, v = 0.3 * np.sin(2.0 * time), 0.6 * np.cos(2.0 * time)
    travel, z, expected = np.zeros_like(q), 0.0, np.zeros_like(q)
    for i in range(1, q.size):
        way = np.sign(v[i])
        moved = abs(q[i] - q[i - 1])
        travel[i] = moved + (travel[i - 1] if way == np.sign(v[i - 1]) else 0.0)
        z = way + (z - way) * np.exp(-moved / 0.05)
        expected[i] = z
    known = {"velocity": v, "direction": np.tanh(v / 0.02), "travel": travel}
    signals = replace(plain_signals(q.size, known), period=1e-3)
    found = PreslidingHysteresis().hysteresis(signals, {"presliding_travel": 0.05})
    away = np.abs(v) > 0.15
    # tanh(0.15/0.02) is 1 to 6e-7
    assert_allclose(found[away], expected[away], atol=2e-6)
