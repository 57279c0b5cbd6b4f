"""Gains: the expansion behind K6 .. K9, both ways, and what cannot be converted."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drake_tc.actuation.model import ActuatorModel, Drive
from drake_tc.control.gains import TorqueGains
from drake_tc.errors import ParamsError

from .equivalent_gains import to_equivalent


def case(seed, n, m, *, diagonal=False):
    rng = np.random.default_rng(seed)
    kf = rng.uniform(0, 2, m) if diagonal else rng.normal(size=(m, m))
    gains = TorqueGains(*rng.uniform(0.0, 5.0, (2, n)), *rng.uniform(0.0, 300.0, (2, n)), kf)
    root = rng.normal(size=(n, n))
    mass = root @ root.T + 0.1 * np.eye(n)
    return gains, rng.uniform(1e-5, 1e-2, n), mass, rng.normal(size=(m, n))


sizes = st.tuples(st.integers(0, 10**6), st.integers(1, 8)).flatmap(
    lambda sn: st.tuples(st.just(sn[0]), st.just(sn[1]), st.integers(0, sn[1]))
)


@settings(max_examples=40, deadline=None)
@given(sizes)
def test_equivalents_reproduce_the_control_law(sizes):
    gains, k_tau, mass, j = case(*sizes)
    rng = np.random.default_rng(sizes[0] + 1)
    n, m = sizes[1:]
    e, edot, eddot, qddot_d, h = rng.normal(size=(5, n))
    f_d, f = rng.normal(size=(2, m))
    tau_d = mass @ qddot_d + h - j.T @ (f_d + gains.kf @ (f_d - f)) + gains.ks * e + gains.kd * edot
    tau_hat = mass @ (qddot_d - eddot) + h - j.T @ f
    effort = k_tau * (tau_d + gains.kp * (tau_d - tau_hat))
    k = to_equivalent(gains, k_tau, mass, j)
    forward = k_tau * (mass @ qddot_d + h - j.T @ f_d)
    back = k.k6 * e + k.k7 * edot + k.k8 @ eddot + k.k9 @ (f_d - f)
    assert_allclose(forward + back, effort, rtol=1e-10, atol=1e-10 * np.abs(k_tau * tau_d).max())  # round-off


def servos(*gains: float) -> list[ActuatorModel]:
    return [ActuatorModel(f"joint{i}", Drive("position_servo", gain)) for i, gain in enumerate(gains)]


def test_gains_from_the_servos_own_are_those_whose_equivalents_they_are():
    models = servos(2e-4, 3e-5)
    k_tau = np.array([2e-4, 3e-5])
    gains = TorqueGains.from_servo(models, [1.0, 0.25], 0.02, 2.0, kf=np.ones(6))
    back = to_equivalent(gains, k_tau, np.eye(2), np.zeros((6, 2)))
    assert_allclose(back.k6, [1.0, 0.25], rtol=1e-14)
    assert_allclose(back.k7, [0.02, 0.02], rtol=1e-14)
    assert_allclose(gains.ks, [1.0 / (2e-4 * 3.0), 0.25 / (3e-5 * 3.0)], rtol=1e-14)
    assert_allclose(gains.kf, np.eye(6))
    by_joint = {model.joint: model for model in models}
    same = TorqueGains.from_servo(by_joint, {"joint1": 0.25, "joint0": 1.0}, 0.02, [2.0, 2.0])
    assert_allclose(same.ks, gains.ks)


def test_numbers_are_taken_for_all_joints():
    gains = TorqueGains(2.0, 0.0, [100.0, 50.0, 20.0], 5.0)
    assert gains.size == 3 and gains.kf.shape == (0, 0)
    assert_allclose((gains.kp, gains.ki, gains.kd), [[2.0] * 3, [0.0] * 3, [5.0] * 3])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([], 1.0), "models is empty; expected one actuator model per joint"),
        ((["knee"], 1.0), "models: expected actuator models, by joint or in a list, got 'knee'"),
        ((servos(1.0), [1.0, 2.0]), r"k6: expected a number or 1 of them, got shape \(2,\)"),
        ((servos(1.0, 1.0), {"joint0": 1.0}), "k6: no value of joint 'joint1'; joints: joint0, joint1"),
        ((servos(1.0), {"joint0": 1.0, "hip": 1.0}), "k6: no joint 'hip'; joints: joint0"),
        ((servos(1.0), "stiff"), "k6: expected a number or 1 of them, got 'stiff'"),
        ((servos(1.0), -1.0), "k6: expected finite numbers >= 0"),
        ((servos(1.0), 1.0, 0.0, np.nan), "kp: expected finite numbers >= 0"),
    ],
)
def test_from_servo_refuses(arguments, message):
    with pytest.raises(ParamsError, match=message):
        TorqueGains.from_servo(*arguments)


def test_refusals():
    gains = case(0, 4, 3)[0]
    with pytest.raises(ParamsError, match="kp: expected finite numbers >= 0"):
        TorqueGains(-gains.kp, gains.ki, gains.ks, gains.kd, gains.kf)
    with pytest.raises(ParamsError, match="kf"):
        TorqueGains(gains.kp, gains.ki, gains.ks, gains.kd, np.ones((2, 3)))
    with pytest.raises(ParamsError, match="ks: expected shape"):
        TorqueGains(gains.kp, gains.ki, np.ones(3), gains.kd, gains.kf)
