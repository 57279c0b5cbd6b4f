"""Joints that slide: what says so, and what contradicts it."""

import re

import numpy as np
import pandas as pd
import pytest

from drake_tc.errors import LogError, RigError
from drake_tc.logs.columns import map_columns
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig, parse_rig, rig_document
from drake_tc.logs.units import allowed_units

URDF = """<robot name="gantry"><link name="base"/><link name="carriage"/><link name="wrist"/>
<joint name="x" type="prismatic"><parent link="base"/><child link="carriage"/><axis xyz="1 0 0"/></joint>
<joint name="w" type="continuous"><parent link="carriage"/><child link="wrist"/><axis xyz="0 1 0"/></joint></robot>"""
AXIS = {"joint": "z", "drive": "current", "load": "torque"}


@pytest.fixture
def gantry(tmp_path):
    (tmp_path / "gantry.urdf").write_text(URDF)
    (tmp_path / "robot.yaml").write_text("{name: g, urdf: gantry.urdf, base: base, fixed_base: true, joints: [x, w]}")

    def rig(more=""):
        path = tmp_path / "rig.yaml"
        path.write_text(f"robot: robot.yaml\ndrive: current\nload: {{robot: fitted}}\n{more}\n")
        return load_rig(path)

    return rig


SLIDES = AXIS | {"joint_type": "prismatic"}


@pytest.mark.parametrize(
    ("document", "says"),
    [
        (AXIS | {"joint_type": "linear"}, "joint_type"),
        (SLIDES | {"load": {"pendulum": {"mass": 1.0, "length": 0.3}}}, "load: z slides (joint_type: prismatic), and"),
        (
            AXIS | {"joint_type": "revolute", "units": {"torque": "N"}},
            "units: torque: 'N' is a unit of a joint that slides, and z turns",
        ),
    ],
)
def test_contradictions_are_refused(document, says):
    with pytest.raises(RigError, match=re.escape(says)):
        parse_rig(document)


@pytest.mark.parametrize("units", [{"position": "mm"}, {"z/velocity": "-mm/s"}, {"torque": "N"}, {"position": "m"}])
def test_a_unit_of_length_or_force_says_that_the_joint_slides(units):
    rig = parse_rig(AXIS | {"units": units})
    assert rig.joint_type("z") == "prismatic"
    assert rig.units_of("z").torque == "N"


def test_the_urdf_says_which_joints_slide(gantry):
    assert dict(gantry().joint_types) == {"x": "prismatic", "w": "revolute"}
    with pytest.raises(RigError, match=r"units: position: 'deg' is a unit of a joint that turns, and x slides"):
        gantry("units: {position: deg}")
    with pytest.raises(RigError, match=r"joint_type: x is prismatic in the URDF of .*robot.yaml, got revolute"):
        gantry("joint_type: {x: revolute}")
    assert gantry("units: {w/position: deg}").joint_type("w") == "revolute"


def test_a_unit_of_all_joints_that_turn_leaves_out_those_that_slide(gantry, tmp_path):
    """A speed in rpm is that of w alone; one of x is refused only if it is recorded."""
    rig = gantry("units: {velocity: rpm}")
    table = pd.DataFrame(
        {"time": 0.01 * np.arange(5), "x/position": 0.1 * np.arange(5), "x/current": 0.2 * np.arange(5)}
    )
    table = table.assign(**{"w/position": np.arange(5.0), "w/current": np.arange(5.0), "w/velocity": np.arange(5.0)})
    turned = map_columns(table, rig, tmp_path / "run.csv").columns["w/velocity"]
    np.testing.assert_allclose(turned, np.arange(5.0) * 2.0 * np.pi / 60.0, rtol=1e-12)  # rounding
    sliding = table.assign(**{"x/velocity": np.arange(5.0)})
    with pytest.raises(
        LogError, match=r"run.csv: units: velocity: 'rpm' is a unit of a joint that turns, and x slides"
    ):
        map_columns(sliding, rig, tmp_path / "run.csv")
    both = map_columns(sliding, gantry("units: {velocity: rpm, x/velocity: mm/s}"), tmp_path / "run.csv").columns
    np.testing.assert_allclose(both["x/velocity"], 1e-3 * np.arange(5.0), rtol=1e-12)


def test_a_written_rig_keeps_the_type():
    rig = parse_rig(SLIDES)
    assert rig.joint_type("z") == rig_document(rig)["joint_type"] == "prismatic"
    assert parse_rig(rig_document(rig)).joint_types == rig.joint_types
    assert parse_rig(AXIS).joint_type("z") == "revolute" and "joint_type" not in rig_document(parse_rig(AXIS))


def test_gyros_have_no_lengths_and_torques_of_sensors_no_forces():
    assert "m/s" not in allowed_units("imu_a/gyro_x")
    assert "N" not in allowed_units("ft_a/tx")


def log_of(tmp_path, factor=1.0, turn=False):
    rows = ["time,z/position,z/current,z/torque"]
    for k in range(600):
        q = 0.1 * k / 600 if not turn or k < 300 else 0.1 * k / 600 + 6.283185
        rows.append(f"{0.01 * k},{factor * q},{0.5 + 0.001 * (k % 7)},{1.0 + 0.01 * (k % 5)}")
    path = tmp_path / "run.csv"
    path.write_text("\n".join(rows))
    return path


def test_millimetres_that_are_taken_for_metres_are_refused(tmp_path):
    path = log_of(tmp_path, factor=1000.0)
    with pytest.raises(LogError, match=re.escape("it looks like mm; set units: {position: mm}")):
        load_runs([path], parse_rig(SLIDES))
    read = load_runs([path], parse_rig(AXIS | {"units": {"position": "mm"}}))[0]
    assert read.columns["z/position"].max() == pytest.approx(0.1, rel=0.01)


def test_a_joint_that_slides_has_no_turns_to_undo(tmp_path):
    path = log_of(tmp_path, turn=True)
    turned = load_runs([path], parse_rig(AXIS))[0]
    slid = load_runs([path], parse_rig(SLIDES))[0]
    assert any("whole turns" in note for note in turned.notes)
    assert not any("whole turns" in note for note in slid.notes)
    assert any("jumps by 6.28 m " in note for note in slid.notes)
