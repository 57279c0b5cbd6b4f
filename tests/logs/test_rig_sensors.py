"""The rig file's key `sensors`: units, defaults, what each joint and sensor gets, round trip, refusals."""

from dataclasses import asdict

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from drake_tc.config.keys import RATIO, quantity
from drake_tc.errors import RigError
from drake_tc.logs.loads import (
    FORCE_TORQUE_PARTS,
    IMU_PARTS,
    ForceTorqueTolerance,
    ImuTolerance,
    JointSensors,
)
from drake_tc.logs.rig import load_rig, parse_rig, rig_document, save_rig
from drake_tc.logs.units import allowed_units

BASE = {"joint": "knee", "drive": "position_servo"}
ROBOT = "{joints: [hip, knee], imu: {trunk: {link: base}}, force_torque: {foot: {joint: ankle}}}"


def robot_rig(folder, sensors, **more):
    (folder / "leg.yaml").write_text(ROBOT, encoding="utf-8")
    path = folder / "rig.yaml"
    document = {"robot": "leg.yaml", "drive": "current", "sensors": sensors, **more}
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return load_rig(path)


def test_nothing_is_declared_by_default():
    rig = parse_rig(BASE)
    assert rig.joint_sensors("knee") == JointSensors()
    assert rig.force_torque_tolerance("foot") == FORCE_TORQUE_PARTS["typical"]
    assert rig.imu_tolerance("trunk") == IMU_PARTS["typical"]


def test_plain_numbers_are_si_and_texts_name_their_unit():
    plain = {"torque_noise": 0.25, "correlation_time": 0.02, "encoder_step": np.deg2rad(0.09).item()}
    texts = {"torque_noise": "250 mN*m", "correlation_time": "20 ms", "encoder_step": "0.09 deg"}
    for sensors in (plain, texts):
        found = parse_rig({**BASE, "sensors": sensors}).joint_sensors("knee")
        assert_allclose(found.torque_noise, 0.25, rtol=1e-12)  # factors are exact but for rounding
        assert_allclose(found.torque_correlation_time, 0.02, rtol=1e-12)
        assert_allclose(found.encoder_step, np.pi / 2000, rtol=1e-12)
        assert found.position_noise is None


def test_a_joint_of_its_own_keeps_what_all_joints_have():
    sensors = {"torque_noise": 0.2, "encoder_step": 0.001, "knee": {"encoder_step": 0.002}}
    rig = parse_rig({"joints": ["hip", "knee"], "drive": "current", "sensors": sensors})
    assert rig.joint_sensors("hip") == JointSensors(torque_noise=0.2, encoder_step=0.001)
    assert rig.joint_sensors("knee") == JointSensors(torque_noise=0.2, encoder_step=0.002)


def test_tolerances_of_joints_are_those_of_all_joints_unless_a_joint_has_its_own():
    sensors = {
        "torque": {"bias": "200 mN*m", "gain": "1 %"},
        "hip": {"torque": {"bias": 0.5}, "encoder": {"offset": 0.001}},
    }
    rig = parse_rig({"joints": ["hip", "knee"], "drive": "current", "sensors": sensors})
    assert rig.joint_sensors("hip") == JointSensors(torque_bias=0.5, torque_gain=0.01, encoder_offset=0.001)
    assert rig.joint_sensors("knee").tolerances("current", 1.0) == {
        "torque_sensor_bias": 0.2,
        "torque_sensor_gain": 0.01,
    }
    exact = parse_rig({**BASE, "sensors": {"torque": {"bias": 0.0}}})
    assert exact.joint_sensors("knee").tolerances("current", 1.0) == {}
    assert parse_rig(rig_document(rig)) == rig


@pytest.mark.parametrize(
    ("drive", "key", "bias", "torque"),
    [
        ("current", "current", "20 mA", 0.02 / 4.0),
        ("voltage", "voltage", "0.2 V", 0.2 / 4.0),
        ("torque", "torque_command", "100 mN*m", 0.1 / 4.0),
    ],
)
def test_the_tolerance_of_an_effort_is_one_of_a_torque_by_the_drive_s_gain(drive, key, bias, torque):
    rig = parse_rig({"joints": ["hip", "knee"], "drive": drive, "sensors": {"hip": {key: {"bias": bias}}}})
    assert_allclose(rig.joint_sensors("hip").tolerances(drive, 4.0)["effort_bias"], torque, rtol=1e-12)
    assert rig.joint_sensors("knee").tolerances(drive, 4.0) == {}
    assert rig.joint_sensors("hip").tolerances("position_servo", 4.0) == {}
    assert parse_rig(rig_document(rig)) == rig


@pytest.mark.parametrize("owner", [None, "knee"])
def test_the_tolerance_of_an_effort_goes_with_its_drive(owner):
    entry = {"current": {"bias": "20 mA"}}
    drives = {"hip": "current" if owner else "voltage", "knee": "voltage"}
    with pytest.raises(RigError, match=r"current: this tolerance goes with drive: current; got drive: voltage$"):
        parse_rig({"joints": ["hip", "knee"], "drive": drives, "sensors": {owner: entry} if owner else entry})
    with pytest.raises(RigError, match="bias: "):
        parse_rig({"joint": "knee", "drive": "current", "sensors": {"current": {"bias": "20 mV"}}})


def test_tolerances_fill_up_from_the_part_or_a_typical_one(tmp_path):
    sensors = {"ft_foot": {"bias": ["2 N", "50 mN*m"], "gain": "1 %"}, "imu_trunk": {"part": "MPU-6050", "gain": 0.0}}
    rig = robot_rig(tmp_path, sensors)
    usual = FORCE_TORQUE_PARTS["typical"]
    assert rig.force_torque_tolerance("foot") == ForceTorqueTolerance(2.0, 0.05, 0.01, usual.alignment)
    part = IMU_PARTS["mpu_6050"]
    assert rig.imu_tolerance("trunk") == ImuTolerance(part.accel_bias, part.gyro_bias, 0.0, part.alignment)


def test_every_part_is_a_plausible_sensor():
    for part in (*FORCE_TORQUE_PARTS.values(), *IMU_PARTS.values()):
        assert all(0.0 < value < 1.0 for value in asdict(part).values())
    assert_allclose(IMU_PARTS["mpu_6050"].gyro_bias, 0.349, atol=1e-3)  # 20 degrees a second


@pytest.mark.parametrize(
    "sensors",
    [
        {"torque_noise": 0.2, "correlation_time": 0.0},
        {"hip": {"encoder_step": 0.001}, "ft_foot": {"part": "typical"}},
        {"hip": {"encoder": {"offset": 0.001}}, "torque": {"gain": 0.01}},
        {"current": {"bias": 0.02}, "knee": {"current": {"bias": 0.05}}},
        {"position_noise": 1e-4, "knee": {"torque_noise": 1.0}, "imu_trunk": {"bias": [0.02, 0.002]}},
        {},
    ],
)
def test_round_trip(tmp_path, sensors):
    rig = robot_rig(tmp_path, sensors)
    again = load_rig(save_rig(rig, tmp_path / "again.yaml"))
    assert again.sensors == rig.sensors
    assert again.tolerances == rig.tolerances


@pytest.mark.parametrize(
    ("sensors", "says"),
    [
        (3, "sensors: expected a mapping"),
        ({"torque_nois": 1.0}, "did you mean 'torque_noise'"),
        ({"knee": {"encoder_steps": 1.0}}, "did you mean 'encoder_step'"),
        ({"knee": 0.1}, "sensors.knee: expected a mapping"),
        ({"torque_noise": "1 rad"}, "units: N*m"),
        ({"torque_noise": "much"}, "such as '0.1 N*m'"),
        ({"torque_noise": True}, "got true"),
        ({"encoder_step": -0.1}, "encoder_step: expected a value >= 0"),
        ({"ft_food": {"gain": 0.01}}, "did you mean 'ft_foot'"),
        ({"imu_trunk": {"biases": [1, 1]}}, "did you mean 'bias'"),
        ({"imu_trunk": {"bias": 0.1}}, "two values, accel bias and gyro bias"),
        ({"ft_foot": {"bias": ["1 N"]}}, "two values, force bias and torque bias"),
        ({"ft_foot": {"bias": ["1 N*m", "1 N*m"]}}, "units: N, mN"),
        ({"ft_foot": {"gain": "1 N"}}, "units: %"),
        ({"torque": 0.2}, "sensors.torque: expected a mapping"),
        ({"torque": {"bais": 0.2}}, "did you mean 'bias'"),
        ({"torque": {"bias": "0.2 rad"}}, "units: N*m"),
        ({"knee": {"encoder": {"offset": -0.1}}}, "offset: expected a value >= 0"),
        ({"knee": {"torque": {"bias": 0.2}}}, "sensors: knee: torque: the joint has no torque sensor"),
        ({"ft_foot": {"part": "mini54"}}, "unknown part 'mini54'"),
        ({"imu_trunk": {"part": "MPU-6000"}}, "did you mean 'mpu_6050'"),
    ],
)
def test_refusals(tmp_path, sensors, says):
    with pytest.raises(RigError) as caught:
        robot_rig(tmp_path, sensors)
    assert says in str(caught.value)
    assert "rig.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_sensor_needs_a_robot():
    with pytest.raises(RigError, match="a sensor needs `robot: FILE`"):
        parse_rig({**BASE, "sensors": {"ft_foot": {"gain": 0.01}}})


def test_ratios_and_units_of_quantities():
    assert quantity(RATIO, "1.5 %") == pytest.approx(0.015)
    assert quantity(allowed_units("accel_x"), "2 g") == pytest.approx(19.6133)
    with pytest.raises(ValueError, match="expected a number"):
        quantity(allowed_units("time"), float("nan"))
