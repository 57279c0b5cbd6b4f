"""A position servo that resonates below the bandwidth of a design: the response, and the warning."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from drake_tc.effects.base import Context, JointNumbers
from drake_tc.experiments.design.following import FOLLOWED, followed, followed_up_to, tracking_warning
from drake_tc.experiments.design.goal import parse_goal
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.motions import JointLimits
from drake_tc.experiments.design.run import DesignOptions, design_joint

LIMITS = JointLimits((-1.0, 1.0), 4.0, 25.0)


@pytest.fixture
def soft() -> DesignJoint:
    """500 N m/rad and 0.8 kg m^2: a resonance at 4 Hz with a twentieth of the critical damping."""
    numbers = JointNumbers(2e-3, 3.0, 2.0, 0.8, 25.0, 0.05, 4.0, 2.0, 0.3)
    context = Context(drive="position_servo", load="torque", recorded=frozenset())
    return DesignJoint("joint", numbers, context, 0.3, 0.5, 5.0, 0.0, 0.0, (), 0.01, 60.0, 2e-3)


def wave(frequency_hz: float, size: float, step: float = 5e-3) -> np.ndarray:
    w, time = 2.0 * np.pi * frequency_hz, np.arange(0.0, 10.0, step)
    return size * np.stack([np.sin(w * time), w * np.cos(w * time), -(w**2) * np.sin(w * time), 0.0 * time])


def test_the_response_is_that_of_the_simulated_servo(soft):
    n, w = soft.numbers, 2.0 * np.pi * 3.0

    def slope(t, x):
        return [x[1], ((0.1 * np.sin(w * t) - x[0]) / n.gain - n.viscous * x[1]) / n.inertia]

    run = solve_ivp(slope, (0.0, 30.0), [0.0, 0.0], t_eval=np.arange(20.0, 30.0, 5e-3), rtol=1e-9, atol=1e-12)
    found = followed(soft, wave(3.0, 0.1), 5e-3)
    # the transient has decayed by exp(-3/1.6 * 20); 20 s are a whole number of periods
    assert_allclose(run.y, found[:2], atol=1e-6)


def test_the_servo_follows_up_to_the_stated_frequency(soft):
    highest = followed_up_to(soft)
    assert_allclose(np.abs(followed(soft, wave(round(highest, 1), 1.0), 5e-3)[0]).max(), FOLLOWED, rtol=0.01)
    assert followed_up_to(replace(soft, numbers=replace(soft.numbers, viscous=60.0))) == math.inf
    assert followed_up_to(replace(soft, context=replace(soft.context, drive="current"))) == math.inf


def test_a_motion_at_the_resonance_is_warned_of_and_a_slow_one_is_not(soft):
    (text,) = tracking_warning(soft, LIMITS, wave(3.8, 0.04), 5e-3)
    assert "resonate" in text and f"--bandwidth {followed_up_to(soft):.2g}" in text
    assert tracking_warning(soft, LIMITS, wave(0.4, 0.9), 5e-3) == ()
    assert tracking_warning(soft, replace(LIMITS, bandwidth_hz=0.8), wave(0.4, 0.9), 5e-3) == ()


def test_a_design_says_so(logged):
    joint, limits = logged
    n = joint.numbers
    heavy = replace(joint, numbers=replace(n, inertia=1.0 / (n.gain * (2.0 * np.pi * 0.6) ** 2), viscous=0.01))
    fast = replace(limits, torque=math.inf, acceleration=400.0)
    design = design_joint(heavy, fast, parse_goal("parameters"), DesignOptions(duration=10.0, starts=1, iterations=0))
    assert any("resonate" in text for text in design.sentences), design.sentences
