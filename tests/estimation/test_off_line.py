"""Torques from logs: the kernel on a perfect log, no delay against a simulated motion's truth, and what is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import LogError, ParamsError
from drake_tc.estimation.off_line import OffLineFilter, SensorLog, estimate_log, torques_of_motion, wrench_bias
from drake_tc.estimation.torque_model import MeasuredMotion, TorqueModel
from drake_tc.loops.torque.running import TorqueRecording, simulate_scenario
from drake_tc.registry import diagram_entry

from .machines import Truth, random_robot

DT = 1e-3
FILTER = OffLineFilter.of(21)


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """(model, truth, rng): a floating tree with two F/T sensors."""
    rng = np.random.default_rng(11)
    robot = random_robot(tmp_path_factory.mktemp("robot"), rng, fixed_base=False)
    return TorqueModel(robot), Truth(robot), rng


def polynomial_log(instant, samples=61):
    """Joints on parabolas and IMU and F/T on lines through an instant at the middle: the filters bend none of them."""
    t = DT * (np.arange(samples) - samples // 2)[:, None]
    position = instant.q + instant.v * t + 0.5 * instant.vdot * t**2
    imu = instant.imu + np.concatenate([instant.gyro_dot, np.zeros(3)]) * t
    return SensorLog(position, imu, instant.readings + 100.0 * t, DT)


def test_every_sample_is_the_kernel_at_its_own_time(tree):
    model, truth, rng = tree
    instant = truth.instant(rng)
    log = polynomial_log(instant)
    found = estimate_log(model, log, FILTER)
    assert found.torque.shape == (61, model.size)
    assert found.unknown_wrench.shape == (61, 6) and found.contact_wrench.shape == (61, 12)
    scale = max(np.abs(instant.readings).max(), np.abs(instant.torque).max())
    for k in (0, 17, 30, 60):  # the ends too, where windows are one-sided
        t = DT * (k - 30)
        velocity = instant.v + instant.vdot * t
        motion = MeasuredMotion(log.position[k], velocity, instant.vdot, log.imu[k], instant.gyro_dot)
        wanted = model.estimate(motion, log.wrench[k])
        for name in ("torque", "unknown_wrench", "contact_wrench"):
            # round-off of second derivatives over 1 ms: 1e-16 / 1e-6 of the numbers, once more at the ends
            assert_allclose(getattr(found, name)[k], getattr(wanted, name), rtol=1e-6, atol=1e-6 * scale)
    # and the middle is the truth of the plant that made the instant
    assert_allclose(found.torque[30], instant.torque, rtol=1e-6, atol=1e-6 * np.abs(instant.torque).max())


def test_torques_of_a_motion_are_those_of_the_kernel_without_sensors(tmp_path):
    rng = np.random.default_rng(12)
    model = TorqueModel(random_robot(tmp_path, rng, fixed_base=True, sensors=0), base="fixed")
    q, v, vdot = rng.normal(size=(3, 20, model.size))
    nothing = np.zeros((20, 6))
    expected = model.estimate_log(q, v, vdot, nothing, nothing[:, :3], np.zeros((20, 0)))[:, : model.size]
    # two recursions over the same bodies: round-off
    assert_allclose(torques_of_motion(model, q, v, vdot), expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_a_bias_is_found_and_taken_off(tree):
    model, truth, rng = tree
    instant = truth.instant(rng)
    log = polynomial_log(instant)
    bias = rng.uniform(-5.0, 5.0, 12)
    middle = slice(30, 31)  # only there are the readings those of a robot that nothing touches
    scale = np.abs(instant.readings).max()
    assert_allclose(wrench_bias(model, log, middle, FILTER), np.zeros(12), atol=1e-6 * scale)
    shifted = SensorLog(log.position, log.imu, log.wrench + bias, DT)
    assert_allclose(wrench_bias(model, shifted, middle, FILTER), bias, atol=1e-6 * scale)
    one, two = estimate_log(model, log, FILTER), estimate_log(model, shifted, FILTER, bias)
    assert_allclose(two.torque, one.torque, rtol=1e-9, atol=1e-9 * np.abs(one.torque).max())
    assert not np.allclose(estimate_log(model, shifted, FILTER).torque, one.torque, rtol=1e-2)


@pytest.fixture(scope="module")
def swing() -> TorqueRecording:
    """A fast motion of the leg under the servo, perfect sensors, with the plant's own reaction torques."""
    text = "{sensors: perfect, log_truth: true, duration: 1.7}"
    return simulate_scenario(diagram_entry("hrp2_leg").scenario("stairs_swing_servo", text=text))


def test_torques_of_a_simulated_motion_have_no_delay(swing):
    model = TorqueModel(swing.robot, angular_acceleration="zero")
    log = SensorLog(swing["encoder"], swing["imu"], swing["force_torque"], DT)
    found, truth = estimate_log(model, log, FILTER).torque, swing["joint_torque"]
    inside = slice(820, 1650)  # the swing

    def error(shift):
        return np.sqrt(np.mean((found[820 + shift : 1650 + shift] - truth[inside]) ** 2, axis=0))

    errors = {shift: error(shift) for shift in (-40, -10, -5, -2, 0, 2, 5, 10, 40)}
    width = np.ptp(truth[inside], axis=0)
    # what is left are the reversals, where friction turns within a window of 20 ms
    assert (errors[0] < 0.05 * width).all(), errors[0] / width
    for joint in range(swing.size):
        best = min(errors, key=lambda shift: errors[shift][joint])
        assert abs(best) <= 2, swing.robot.joints[joint]
    assert (errors[40] > 2.0 * errors[0]).all() and (errors[-40] > 2.0 * errors[0]).all()


def test_a_welded_base_needs_no_imu(swing):
    robot = swing.robot
    log = SensorLog(swing["encoder"], None, swing["force_torque"], DT)
    with_imu = SensorLog(swing["encoder"], swing["imu"], swing["force_torque"], DT)
    without = estimate_log(TorqueModel(robot, base="fixed"), log, FILTER).torque
    assert_allclose(without, estimate_log(TorqueModel(robot, base="fixed"), with_imu, FILTER).torque, atol=1e-12)
    seen = estimate_log(TorqueModel(robot, angular_acceleration="zero"), with_imu, FILTER).torque
    assert_allclose(without, seen, atol=1e-6)  # a perfect IMU on a base at rest says nothing else
    with pytest.raises(LogError, match="imu: expected readings, as the model of hrp2_like_leg"):
        estimate_log(TorqueModel(robot), log, FILTER)


def changed(log, **fields):
    return SensorLog(**{name: fields.get(name, getattr(log, name)) for name in ("position", "imu", "wrench", "dt")})


def spoilt(values, row, number):
    values = values.copy()
    values[row, -1] = number
    return values


def test_logs_that_cannot_be_used_are_refused(tree):
    model, truth, rng = tree
    log = polynomial_log(truth.instant(rng))
    cases = [
        (changed(log, position=spoilt(log.position, 7, np.nan)), "position: expected finite readings; sample 7 is not"),
        (changed(log, imu=spoilt(log.imu, 60, np.inf)), "imu: expected finite readings; sample 60 is not"),
        (changed(log, wrench=spoilt(log.wrench, 0, np.nan)), "wrench: expected finite readings; sample 0 is not"),
        (changed(log, position=log.position[:, 1:]), r"position: expected shape \(61, \d+\) for tree, got \(61, \d+\)"),
        (changed(log, imu=log.imu[:60]), r"imu: expected shape \(61, 6\) for tree, got \(60, 6\)"),
        (changed(log, wrench=log.wrench[:, :6]), r"wrench: expected shape \(61, 12\) for tree, got \(61, 6\)"),
        (changed(log, imu=None), "imu: expected readings, as the model of tree"),
        (polynomial_log(truth.instant(rng), 20), "expected at least 21 samples, one window; the log has 20"),
    ]
    for broken, message in cases:
        with pytest.raises(LogError, match=message):
            estimate_log(model, broken, FILTER)
        with pytest.raises(LogError, match=message):
            wrench_bias(model, broken, slice(0, 10), FILTER)
    with pytest.raises(LogError, match=r"bias: expected shape \(12,\) for tree, got \(6,\)"):
        estimate_log(model, log, FILTER, np.zeros(6))
    with pytest.raises(LogError, match="wrench bias: expected samples within 0 to 61"):
        wrench_bias(model, log, slice(61, 80), FILTER)
    with pytest.raises(ParamsError, match="window of at least order"):
        estimate_log(model, log, OffLineFilter.of(2))
