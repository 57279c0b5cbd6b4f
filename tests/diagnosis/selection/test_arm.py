"""Several joints as one regression, on motions whose torques are computed in closed form."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.bench.real_arm import looked_for
from drake_tc.bench.real_double_pendulum import planar_tree
from drake_tc.diagnosis.arm import declare, declared_friction, every_other_block, hold_out_arm
from drake_tc.diagnosis.problem.arm.fit import fit_arm
from drake_tc.diagnosis.problem.arm.rows import JointLog, arm_rows
from drake_tc.diagnosis.problem.arm.shafts import joint_axes, motor_axes
from drake_tc.diagnosis.selection.arm import ArmProblem
from drake_tc.errors import IdentificationError
from drake_tc.robot.rigid_regressor import regressor

TREE = planar_tree(0.3)
PERIOD = 0.002
TURNS = np.array([[1.0, 0.0], [1.0, 1.0]])
MOTORS = motor_axes(("motor_1", "motor_2"), TURNS)
EFFECTS = looked_for(("viscous_power", "load_dependent_friction", "torque_ripple", "cable_spring"))


def motion(duration=16.0):
    """(q, v, vdot), each (T, 2)."""
    t = np.arange(0.0, duration, PERIOD)
    q, v, a = np.zeros((3, t.size, 2))
    for joint, tones in enumerate((((0.9, 2.1, 0.0), (0.4, 5.3, 1.0)), ((0.8, 3.3, 0.5), (0.5, 1.7, 2.0)))):
        for size, w, phase in tones:
            q[:, joint] += size * np.sin(w * t + phase)
            v[:, joint] += size * w * np.cos(w * t + phase)
            a[:, joint] -= size * w * w * np.sin(w * t + phase)
    return q, v, a


def torque(extra, noise=0.02):
    """Link torques, viscous and Coulomb friction on both motors, and `extra(motor angle, speed)` on the second."""
    q, v, a = motion()
    pi = np.zeros(20)
    pi[[0, 3, 7, 10, 13, 17]] = 0.56, -0.14, 0.053, 0.6, -0.11, 0.024
    tau = regressor(TREE, q, v, a) @ pi
    turned, speed = q @ TURNS.T, v @ TURNS.T
    loss = 0.2 * speed + 0.3 * np.sign(speed)
    loss[:, 1] += extra(turned[:, 1], speed[:, 1])
    return q, tau + loss @ TURNS + np.random.default_rng(0).normal(scale=noise, size=q.shape)


def held_out(extra, axes=MOTORS, effects=EFFECTS):
    q, y = torque(extra)
    log = JointLog("run", PERIOD, q, y)
    rows, raw = arm_rows([log], axes, lambda *x: regressor(TREE, *x), (0.03, 0.03), 0.05)
    rows, raw, declared = declare(rows, raw, declared_friction(2, 2, inertia=False))
    return hold_out_arm(rows, raw, declared, every_other_block(rows, 1.0, 4, 1), effects)


def rms(x):
    return np.sqrt(np.mean(x**2, axis=0))


@pytest.mark.parametrize(
    ("key", "extra"),
    [
        ("torque_ripple", lambda q, v: 0.3 * np.cos(20.0 * q)),
        ("viscous_power", lambda q, v: 0.8 * np.sign(v) * np.abs(v) ** 0.4),
    ],
)
def test_right_effect_on_the_right_motor_of_a_coupled_transmission(key, extra):
    result = held_out(extra)
    first = result.found[0]
    assert (MOTORS[first.axis].name, first.term.effect.key) == ("motor_2", key)
    assert np.all(rms(result.after) < 0.6 * rms(result.before))
    if key == "torque_ripple":
        assert_allclose(first.term.shape["cycles_per_turn"], 20.0, rtol=0.005)
    else:
        assert_allclose(first.term.shape["viscous_exponent"], 0.4, atol=0.1)


def test_nothing_is_found_where_nothing_is_missing():
    result = held_out(lambda q, v: 0.0 * q)
    assert result.found == ()
    # white noise of 0.02 through two kernels of 30 ms at 2 ms: well below it, and nothing else is left
    assert np.all(rms(result.before) < 0.02)


def test_friction_of_motors_is_not_friction_of_joints():
    coupled = held_out(lambda q, v: 0.0 * q, effects=())
    apart = held_out(lambda q, v: 0.0 * q, axes=joint_axes(("a", "b")), effects=())
    assert np.all(rms(coupled.before) < 0.5 * rms(apart.before))


def test_coupled_transmission_conserves_power():
    rng = np.random.default_rng(1)
    turns = rng.normal(size=(3, 3))
    axes = motor_axes(("a", "b", "c"), turns)
    v, tau = rng.normal(size=(2, 3))
    motor_speeds = np.array([axis.turns for axis in axes]) @ v
    motor_torques = np.array([axis.carries for axis in axes]) @ tau
    assert_allclose(motor_speeds @ motor_torques, v @ tau, rtol=1e-10)  # rounding
    with pytest.raises(IdentificationError, match=r"invertible \(2, 2\)"):
        motor_axes(("a", "b"), np.ones((2, 2)))


def test_no_training_row_shares_a_sample_with_a_held_out_one():
    q, y = torque(lambda q, v: 0.0 * q)
    rows, raw = arm_rows([JointLog("run", PERIOD, q, y)], MOTORS, lambda *x: regressor(TREE, *x), (0.03, 0.06), 0.05)
    test = every_other_block(rows, 1.0, 4, 1)
    rows, raw, declared = declare(rows, raw, declared_friction(2, 2, inertia=False))
    train = hold_out_arm(rows, raw, declared, test, ()).baseline.rows
    gap = np.min(np.abs(train.rows[:, None] - rows.rows[test][None, :]))
    assert gap >= 2 * 2 * rows.light.margin  # two passes on either side


def test_too_little_motion_is_refused():
    still = JointLog("still", PERIOD, np.zeros((500, 2)), np.zeros((500, 2)))
    with pytest.raises(IdentificationError, match=r"faster than 0\.05"):
        arm_rows([still], MOTORS, lambda *x: regressor(TREE, *x), (0.03, 0.03), 0.05)


def test_a_fit_is_offered_without_each_of_its_new_effects():
    chosen = held_out(lambda q, v: 0.3 * np.cos(20.0 * q) + 0.8 * np.sign(v) * np.abs(v) ** 0.4).chosen
    declared = fit_arm(chosen.rows, chosen.shaft_effects[:-2], chosen.sigma)
    rest = list(ArmProblem(declared, EFFECTS).without_each(chosen, declared))
    assert [f.shaft_effects for f in rest] == [
        (*declared.shaft_effects, chosen.shaft_effects[-1]),
        (*declared.shaft_effects, chosen.shaft_effects[-2]),
    ]
    assert all(np.sum(f.residual**2) > np.sum(chosen.residual**2) for f in rest)
