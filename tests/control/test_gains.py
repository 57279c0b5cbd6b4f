"""Gains from those of a servo, and what cannot be converted."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.model import ActuatorModel, Drive
from drake_tc.control.gains import TorqueGains
from drake_tc.errors import ParamsError


def servos(*gains: float) -> list[ActuatorModel]:
    return [ActuatorModel(f"joint{i}", Drive("position_servo", gain)) for i, gain in enumerate(gains)]


def test_gains_from_the_servos_own_are_those_whose_equivalents_they_are():
    models = servos(2e-4, 3e-5)
    k_tau = np.array([2e-4, 3e-5])
    gains = TorqueGains.from_servo(models, [1.0, 0.25], 0.02, 2.0, kf=np.ones(6))
    assert_allclose(k_tau * (1.0 + gains.kp) * gains.kd, [0.02, 0.02], rtol=1e-14)
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
    gains = TorqueGains(np.ones(4), np.ones(4), np.ones(4), np.ones(4), np.ones(3))
    with pytest.raises(ParamsError, match="kp: expected finite numbers >= 0"):
        TorqueGains(-gains.kp, gains.ki, gains.ks, gains.kd, gains.kf)
    with pytest.raises(ParamsError, match="kf"):
        TorqueGains(gains.kp, gains.ki, gains.ks, gains.kd, np.ones((2, 3)))
    with pytest.raises(ParamsError, match="ks: expected shape"):
        TorqueGains(gains.kp, gains.ki, np.ones(3), gains.kd, gains.kf)
