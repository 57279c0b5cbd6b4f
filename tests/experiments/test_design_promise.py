"""What a design states of a motion: with the friction and rows of a diagnosis, beside a sinusoid within all limits."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.effects.base import Context, JointNumbers
from drake_tc.effects.library import effect
from drake_tc.experiments.design import known
from drake_tc.experiments.design.goal import parse_goal
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.lead import default_motion
from drake_tc.experiments.design.motions import JointLimits
from drake_tc.experiments.design.next_log import PlannedRun, rough_log
from drake_tc.experiments.design.run import DesignOptions, design_joint
from drake_tc.experiments.fitted import fitted_joint
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig

LIMITS = JointLimits((-0.6, 0.4), 1.5, 8.0, jerk=200.0, torque=25.0)
STEP = 5e-3


@pytest.fixture(scope="module")
def joint() -> DesignJoint:
    numbers = JointNumbers(
        gain=0.01, viscous=1.0, coulomb=1.5, inertia=0.5, torque=25.0, effort=0.25, speed=2.5, span=1.6
    )
    context = Context(
        drive="position_servo",
        load="torque",
        recorded=frozenset(),
        declared={"rotor_inertia": 0.2},
        max_speed=2.5,
        position_span=(-0.8, 0.8),
        effort_span=(-0.25, 0.25),
        period=2e-3,
        torque_span=(-10.0, 10.0),
        duration=30.0,
    )
    declared = (Term(effect("viscous")), Term(effect("coulomb")))
    return DesignJoint("joint", numbers, context, 0.2, 0.3, 7.0, 0.0, 0.0, declared, 0.01, 40.0, 5e-3)


def balance(motion):
    """Torque of the motor (T,) of `joint` [N m]."""
    q, v, a, _ = motion
    return 0.5 * a + 1.0 * v + 1.5 * np.tanh(v / 0.1) + 7.0 * np.sin(q)


@pytest.mark.parametrize(("torque", "jerk"), [(3.5, 200.0), (25.0, 4.0)])
def test_the_sinusoid_beside_a_design_keeps_torque_and_jerk_and_is_not_much_smaller(joint, torque, jerk):
    limits = replace(LIMITS, torque=torque, jerk=jerk)
    motion, free = (default_motion(joint, each, 30.0, STEP) for each in (limits, LIMITS))
    used = max(np.abs(balance(motion)).max() / torque, np.abs(np.gradient(motion[2], STEP)).max() / jerk)
    assert 0.9 < used <= 1.0
    assert np.ptp(motion[0]) < np.ptp(free[0])
    assert_allclose(np.abs(free[0] + 0.1).max(), 0.5, rtol=0.05)  # about the middle, up to the limits


def test_the_damping_of_a_servo_is_no_torque_of_its_motor(joint):
    damped = replace(joint, numbers=replace(joint.numbers, viscous=21.0), servo_damping=20.0)
    q = 0.3 * np.sin(np.arange(0.0, 10.0, STEP))
    motion = np.stack([q, np.gradient(q, STEP), np.gradient(np.gradient(q, STEP), STEP), 0.0 * q])
    assert_allclose(damped.motor_torque(motion, STEP), balance(motion), atol=1e-12)
    # Without the declaration the motor would have to push against 20 N m s/rad within 10 N m.
    limits = replace(LIMITS, torque=10.0)
    options = DesignOptions(duration=10.0, starts=1, iterations=12)
    known, unknown = (
        design_joint(each, limits, parse_goal("parameters"), options)
        for each in (damped, replace(damped, servo_damping=0.0))
    )
    speeds = [np.abs(d.basis.motion(d.x)[1]).max() for d in (known, unknown)]
    assert speeds[0] > 1.5 * speeds[1]
    assert np.abs(balance(known.basis.motion(known.x))).max() <= 10.0


def test_the_damping_that_a_rig_declares_is_that_of_the_fitted_gain(demo, logged, monkeypatch):
    """Of a fit that looks for no effects."""
    monkeypatch.setattr(known, "fitted_joint", partial(fitted_joint, effects=()))
    rig = load_rig(demo[0])
    (name,) = rig.joints
    stated = replace(rig, drive_gain={name: 2e-4}, derivative_gain={name: 15.0})
    runs = load_runs(demo[1], stated)
    found, limits, _ = known.joint_from_logs(stated, runs, name)
    assert_allclose(found.servo_damping, 2e-4 * 15.0 / found.numbers.gain, rtol=1e-12)
    assert 0.5 * logged[1].torque < limits.torque < 1.1 * logged[1].torque


def test_a_rough_log_has_the_rows_the_friction_and_the_numbers_of_a_diagnosis(joint):
    """Without noise, least squares of the balance gives the joint's own numbers back."""
    time = np.arange(0.0, 10.0, STEP)
    w, size = 2.0 * np.pi * 0.1, 0.06
    motion = size * np.stack([np.sin(w * time), w * np.cos(w * time), -(w**2) * np.sin(w * time), 0.0 * time])
    fitted = rough_log([PlannedRun("run", joint, motion, STEP)])
    columns = fitted.prepared.train
    v = size * w * np.cos(w * columns.samples.signals.time)[columns.samples.rows]
    found, *_ = np.linalg.lstsq(columns.design(joint.declared), columns.target, rcond=None)
    assert_allclose(found, [100.0, 1.0, 1.5], rtol=1e-3)  # the filters curve the load by (w t)^2/2 = 8e-5
    shape = {"stribeck_velocity": 0.02, "stribeck_exponent": 2.0}
    exact = np.exp(-((v / 0.02) ** 2)) * np.sign(v)
    assert_allclose(columns.of(Term(effect("stribeck"), shape))[:, 0], exact, atol=5e-3)
    assert v.size > 50 and np.abs(v).min() >= 4.9e-3  # the slowest speed that counts
    twice = rough_log([PlannedRun("run", joint, motion, STEP)], 2)
    once, again = (np.diag(each.best.posterior.covariance)[0] for each in (fitted, twice))
    assert_allclose(again, 0.5 * once, rtol=0.02)  # of the drive gain, about which priors say little


def test_a_motion_for_friction_at_small_speeds_is_slow_and_tells_it(joint):
    goal = parse_goal("tell:stribeck,load_dependent_friction")
    noisy = replace(joint, noise=0.1)
    design = design_joint(noisy, LIMITS, goal, DesignOptions(duration=30.0, starts=1, iterations=40))
    chance = design.expected[0]
    assert chance.after > 0.95 and chance.after > chance.default
    assert np.mean(np.abs(design.basis.motion(design.x)[1]) < 0.1) > 0.1


def test_a_design_is_never_worse_than_its_sinusoid(joint):
    """Without a search the best random motion is the worse one for Coulomb friction: the sinusoid is the design."""
    design = design_joint(joint, LIMITS, parse_goal("all"), DesignOptions(duration=10.0, starts=1, iterations=0))
    worse = [row for row in design.expected if row.after > row.default]
    assert design.sinusoid is None or not worse
    time, motion = replace(design, sinusoid=default_motion(joint, LIMITS, 10.0, 1e-3)).motion(200.0)
    assert_allclose(motion[1:3, [0, -1]], 0.0, atol=1e-6)
    assert time[-1] > 10.0 and np.abs(motion[1]).max() <= LIMITS.velocity * (1.0 + 1e-6)
    assert np.abs(np.diff(motion[0])).max() <= LIMITS.velocity / 200.0 * (1.0 + 1e-6)
