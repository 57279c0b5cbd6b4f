"""Columns that are misspelt or forgotten are pointed out, each in one sentence; ordinary other columns are not."""

import numpy as np
import pandas as pd
import pytest
import yaml

from drake_tc.errors import LogError, RigError
from drake_tc.logs.columns import column_hints, same_but_misspelt
from drake_tc.logs.prepare import load_run
from drake_tc.logs.rig import load_rig, parse_rig

from .conftest import bench, servo_rig, write

ROBOT = "{joints: [hip, knee], force_torque: {right: {joint: a}, left: {joint: b}}, imu: {trunk: {link: base}}}"


@pytest.fixture
def leg(tmp_path):
    (tmp_path / "leg.yaml").write_text(ROBOT, encoding="utf-8")
    document = {"robot": "leg.yaml", "drive": "current"}
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
    return load_rig(tmp_path / "rig.yaml")


def hints(rig, names, **found):
    return column_hints(names, found, rig, [])


@pytest.mark.parametrize(
    ("name", "known", "alike"),
    [
        ("ft_rigth/fx", "ft_right/fx", True),
        ("knee.velocty", "knee/velocity", True),
        ("Knee/Velocity", "knee/velocity", True),
        ("kneeVelocity", "knee/velocity", True),
        ("ft_left/fx", "ft_right/fx", False),
        ("l_knee/velocity", "r_knee/velocity", False),
        ("joint1/velocity", "joint2/velocity", False),
        ("hip_roll/velocity", "hip_yaw/velocity", False),
        ("knee/velocity/raw", "knee/velocity", False),
    ],
)
def test_a_typo_is_told_from_another_name(name, known, alike):
    assert same_but_misspelt(name, known) is alike


def test_a_misspelt_sensor_of_the_log(leg):
    (note,) = column_hints(["ft_rigth/fx"], {"ft_rigth/fx": "ft_rigth/fx"}, leg, [])
    assert note == "Column 'ft_rigth/fx' is not used: the robot has no sensor 'ft_rigth'; did you mean 'ft_right'?"
    (note,) = column_hints(["ft_right/fxx", "imu_trunck/gyro_x"], {"ft_right/fx": "ft_right/fx"}, leg, [])
    assert note == "Column 'imu_trunck/gyro_x' is not used; did you mean 'imu_trunk/gyro_x'?"


def test_a_misspelt_sensor_of_the_rig_file_is_refused(tmp_path, leg):
    document = {"robot": "leg.yaml", "drive": "current", "columns": {"ft_rigth/fy": "side"}}
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
    with pytest.raises(RigError, match="columns: ft_rigth: the robot has no such sensor; did you mean 'ft_right'"):
        load_rig(tmp_path / "rig.yaml")


def test_columns_of_other_sensors_and_joints_are_named_in_one_sentence(leg):
    names = ["ft_hand/fx", "ft_hand/fy", "imu_head/gyro_x", "hp/position", "status", "seq", "rig/notes"]
    (note,) = column_hints(names, {name: name for name in names[:3]}, leg, [])
    assert note == (
        "Columns of ft_hand, imu_head, hp are not used: the rig has hip, knee, imu_trunk, ft_right, ft_left."
    )
    many = [f"joint{n}/velocity" for n in range(30)]
    (note,) = column_hints(many, {}, leg, [])
    assert note.startswith("Columns of joint0, joint1, joint2, joint3, joint4, joint5 and 24 more are not used")


def test_a_column_of_another_owner_that_the_rig_file_maps_is_used(leg):
    mapped = {"hip/motor_position": "motor_hip/position", "knee/position": "knee/position"}
    assert column_hints(list(mapped.values()), mapped, leg, []) == ()
    (note,) = column_hints([*mapped.values(), "motor_knee/position"], mapped, leg, [])
    assert note.startswith("Columns of motor_knee are not used")


def test_a_misspelt_column_of_a_sensor_that_is_needed_is_refused_with_the_nearest(tmp_path, leg):
    columns = [f"{j}/{s}" for j in ("hip", "knee") for s in ("position", "current")]
    wrench = [f"ft_{side}/{axis}" for side in ("right", "left") for axis in ("fx", "fy", "fz", "tx", "ty", "tz")]
    names = ["time", *columns, *wrench]
    table = pd.DataFrame({name: np.sin(np.arange(300) * 0.03 + k) for k, name in enumerate(names)})
    table["time"] = np.arange(300) * 0.01
    table = table.rename(columns={"ft_right/fx": "ft_rigth/fx"})
    with pytest.raises(LogError, match="no column 'ft_right/fx'; near matches: 'ft_rigth/fx'"):
        load_run(write(table, tmp_path / "run.csv"), leg)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("temp", "looks like a temperature and is not used; `columns: {joint/temperature: temp}`"),
        ("input_volts", "looks like a supply voltage and is not used; `columns: {joint/supply_voltage: input_volts}`"),
        ("torque_enable", "looks like a switch of the drive and is not used; `enabled: torque_enable`"),
        ("joint/motor_temp", "`columns: {joint/temperature: joint/motor_temp}`"),
    ],
)
def test_what_looks_like_something_useful_is_pointed_out(tmp_path, name, says):
    table = bench().drop(columns="joint/temperature").assign(**{name: 1.0})
    run = load_run(write(table, tmp_path / "run.csv"), servo_rig())
    (note,) = run.notes
    assert says in note and note.endswith(".")
    assert run.hints == run.notes


def test_what_is_used_is_not_pointed_out(tmp_path):
    table = bench().assign(temp=20.0, input_volts=24.0, torque_enable=1)
    columns = {"supply_voltage": "input_volts"}
    rig = servo_rig(columns=columns, enabled="torque_enable")  # joint/temperature is in the log
    assert load_run(write(table, tmp_path / "run.csv"), rig).notes == ()


def test_the_switch_of_one_of_several_joints():
    rig = parse_rig({"joints": ["hip", "knee"], "drive": "current"})
    (note,) = hints(rig, ["knee_torque_enable"])
    assert "`columns: {knee/enabled: knee_torque_enable}`" in note
