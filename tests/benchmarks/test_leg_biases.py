"""Residual biases of the blind leg's sensors: drawn within tolerances, declared in the rig file, scored."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose
from scipy.stats import truncnorm

from drake_tc.robot.robot import load_robot
from tests.benchmarks.blind_leg import cases
from tests.benchmarks.blind_leg.biases import LIMIT, SensorBiases, Tolerances, declared_sensors
from tests.benchmarks.blind_leg.cases import ROBOT, ROUND, leg_case, record_case, zeroed_suite


def test_draws_are_normal_within_the_limit() -> None:
    """Standard deviation of a normal that is cut off at 3 sigma: 0.9866 sigma; means of zero; no draw beyond."""
    rng = np.random.default_rng(0)
    draws = [Tolerances().draw(rng) for _ in range(3000)]
    for name, sigma in (("force", 0.1), ("torque", 0.005), ("accel", 0.01), ("gyro", 5e-4)):
        values = np.array([getattr(draw, name) for draw in draws]).ravel() / sigma
        assert np.abs(values).max() <= LIMIT
        # standard errors over 9000 values: 1 % of the mean, 0.75 % of the standard deviation
        assert_allclose(values.mean(), 0.0, atol=0.04)
        assert_allclose(values.std(), truncnorm(-LIMIT, LIMIT).std(), rtol=0.03)


@pytest.mark.parametrize("scale", [1.0, 3.0])
def test_every_case_has_its_own_biases_and_only_the_wrong_one_is_beyond_them(scale: float) -> None:
    tolerances = Tolerances().scaled(scale)
    for number in range(2 * len(ROUND)):
        case = leg_case(number, 5, scale)
        biases = SensorBiases(**case.truth["biases"])
        assert case.suite == biases.applied(zeroed_suite())
        assert case.truth["tolerances"] == {n: getattr(tolerances, n) for n in ("force", "torque", "accel", "gyro")}
        beyond = {
            name: np.abs(getattr(biases, name)).max() > LIMIT * getattr(tolerances, name)
            for name in ("force", "torque", "accel", "gyro")
        }
        wrong = case.truth["id"]
        assert beyond["force"] == beyond["torque"] == (wrong == "ft_bias")
        assert beyond["accel"] == (wrong == "imu_bias") and not beyond["gyro"]
        assert (biases.scale != 1.0) == (wrong == "ft_gain")
        assert np.abs(biases.force).min() > 0.0
    assert leg_case(3, 5, scale).truth == leg_case(3, 5, scale).truth
    assert leg_case(3, 5, scale).truth["biases"] != leg_case(4, 5, scale).truth["biases"]


def test_three_times_the_tolerance_changes_nothing_else() -> None:
    one, three = leg_case(0, 9), leg_case(0, 9, 3.0)
    assert one.truth["parameters"] == three.truth["parameters"] and one.seed == three.seed
    assert_allclose(three.truth["biases"]["force"], 3.0 * np.array(one.truth["biases"]["force"]), rtol=1e-12)


def test_truth_has_the_values_that_a_report_estimates() -> None:
    by_id = {}
    for number in range(len(ROUND)):
        truth = leg_case(number, 2).truth
        by_id[truth["id"]] = truth
    ft = by_id["ft_bias"]
    assert list(ft["estimated"]) == ["force_x", "force_y", "force_z", "torque_x", "torque_y", "torque_z"]
    # the sensor's whole error: what zeroing left, and the case's own
    assert_allclose([ft["estimated"][f"force_{a}"] for a in "xyz"], ft["biases"]["force"], rtol=1e-12)
    assert np.linalg.norm(np.subtract(ft["biases"]["force"], ft["parameters"]["force"])) < 3.0 * 0.1 * np.sqrt(3.0)
    assert_allclose(by_id["ft_gain"]["estimated"]["force"], by_id["ft_gain"]["parameters"]["scale"] - 1.0, rtol=1e-12)
    assert by_id["link_mass"]["estimated"] == {"mass": by_id["link_mass"]["parameters"]["mass"]}
    assert [*by_id["link_com"]["estimated"].values()] == by_id["link_com"]["parameters"]["com"]
    assert [by_id["imu_bias"]["estimated"][f"accel_{a}"] for a in "xyz"] == list(by_id["imu_bias"]["biases"]["accel"])
    assert set(by_id[""]["friction"]) == set(load_robot(ROBOT).joints)
    assert set(by_id[""]["friction"]["r_knee"]) == {"viscous", "coulomb"}


def test_rig_file_declares_tolerances_and_not_biases(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cases, "RUNS", (("run_rest", "rest", 0.0),))
    monkeypatch.setattr(cases, "SECONDS", 0.3)
    case = leg_case(ROUND.index(""), 1, 3.0)
    record_case(case, tmp_path)
    rig = yaml.safe_load((tmp_path / "rig.yaml").read_text(encoding="utf-8"))
    robot = load_robot(ROBOT)
    assert rig["sensors"] == declared_sensors(robot, case.tolerances)
    foot, trunk = f"ft_{robot.force_torque[0].name}", f"imu_{robot.imu[0].name}"
    assert set(rig["sensors"]) == {foot, trunk}
    assert_allclose(rig["sensors"][foot]["bias"], [0.3, 0.015], rtol=1e-12)
    assert_allclose(rig["sensors"][trunk]["bias"], [0.03, 0.0015], rtol=1e-12)
    log = np.load(tmp_path / "run_rest.npz")
    # the leg hangs still: the gyro reads its bias; noise 5e-3 rad/s over 300 samples leaves 3e-4
    gyro = np.stack([log[f"{trunk}/gyro_{axis}"] for axis in "xyz"], axis=1).mean(axis=0)
    assert_allclose(gyro, case.truth["biases"]["gyro"], atol=1.2e-3)
