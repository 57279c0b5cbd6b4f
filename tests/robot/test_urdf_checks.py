"""A URDF that no robot can have is refused in one line, with file, link or joint, and the value."""

import pytest
from robot_files import joint_tag, link_tag, urdf, write_robot

from drake_tc.errors import ParamsError
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot
from drake_tc.simulator_files.urdf import resolve

UPPER, LOWER = (link_tag(name, (0, 0, -0.1), 1.5, (0.02, 0.02, 0.002)) for name in ("upper", "lower"))
HIP = joint_tag("hip", "base", "upper", axis=(0, 1, 0))
KNEE = joint_tag("knee", "upper", "lower", axis=(0, 1, 0))
SOUND = urdf(UPPER, LOWER, HIP, KNEE)
OTHER = joint_tag("other", "lower", "upper", axis=(0, 1, 0))

REFUSED = {
    "mass is text": (SOUND.replace('mass value="1.5"', 'mass value="abc"', 1), "'upper' mass: .* got 'abc'"),
    "mass is nan": (SOUND.replace('mass value="1.5"', 'mass value="nan"', 1), "'upper' mass: expected a finite"),
    "mass below 0": (SOUND.replace('mass value="1.5"', 'mass value="-3.2"', 1), "mass: expected a number from 0 to"),
    "mass too large": (SOUND.replace('mass value="1.5"', 'mass value="1e308"', 1), "mass: .* 1e.09 .*got 1e.308"),
    "inertia too large": (SOUND.replace('ixx="0.02"', 'ixx="1e200"', 1), "inertia: expected moments below 1e.09"),
    "mass missing": (SOUND.replace('mass value="1.5"', "mass", 1), "mass: expected a finite number, got none"),
    "inertia below 0": (SOUND.replace('ixx="0.02"', 'ixx="-1"', 1), "'upper' inertia: expected moments of inertia"),
    "inertia is text": (SOUND.replace('iyy="0.02"', 'iyy=""', 1), "'upper' iyy: expected a finite number, got ''"),
    "products too large": (SOUND.replace('ixy="0"', 'ixy="0.5"', 1), "'upper' inertia: expected moments"),
    "centre of mass": (SOUND.replace('xyz="0 0 -0.1"', 'xyz="0 nan 1"', 1), "inertial xyz: expected 3 finite"),
    "loop": (urdf(UPPER, LOWER, KNEE, OTHER), "closes a loop"),
    "two joints above": (urdf(UPPER, LOWER, HIP, KNEE, OTHER), "'upper' hangs on two joints, 'hip' and 'other'"),
    "not connected": (urdf(UPPER, LOWER, HIP), "no joint connects 'base' and 'lower'"),
    "link twice": (urdf(UPPER, UPPER, LOWER, HIP, KNEE), "link 'upper' is there twice"),
    "joint twice": (urdf(UPPER, LOWER, HIP, KNEE, KNEE), "joint 'knee' is there twice"),
    "effort below 0": (SOUND.replace('effort="50"', 'effort="-5"', 1), "'hip': limit effort: .* got -5"),
    "velocity below 0": (SOUND.replace('velocity="5"', 'velocity="-5"', 1), "'hip': limit velocity: .* got -5"),
    "lower above upper": (SOUND.replace('lower="-3"', 'lower="4"', 1), "'hip': limit: expected lower <= upper, got 4"),
    "type": (SOUND.replace('type="revolute"', 'type="ball"', 1), "'hip': type 'ball' cannot be simulated"),
    "floating": (SOUND.replace('type="revolute"', 'type="floating"', 1), "expected one of revolute, continuous"),
    "no type": (SOUND.replace(' type="revolute"', "", 1), "'hip': type '' cannot be simulated"),
    "deep": (SOUND.replace("</robot>", "<a>" * 90 + "</a>" * 90 + "</robot>"), "levels deep, got 91"),
    "bomb": (
        '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">'
        + "".join(f'<!ENTITY {b} "{f"&{a};" * 20}">' for a, b in zip("abcdefg", "bcdefgh", strict=True))
        + "]><robot>&h;</robot>",
        "not valid XML",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_with_file_and_element(tmp_path, case):
    text, message = REFUSED[case]
    path = write_robot(tmp_path, text, ["hip", "knee"])
    with pytest.raises(ParamsError, match=message) as caught:
        load_robot(path)
    assert str(caught.value).startswith(f"{path}: {tmp_path / 'arm.urdf'}: ") and len(str(caught.value)) < 600


def test_the_sound_one_is_read_and_placeholders_are_no_limits(tmp_path):
    text = SOUND.replace('lower="-3" upper="3"', 'lower="0" upper="0"').replace('effort="50"', 'effort="0"')
    assert make_plant(load_robot(write_robot(tmp_path, text, ["hip", "knee"])), 0.0).num_positions() == 2


def test_what_drake_refuses_is_told_with_the_file(tmp_path, monkeypatch):
    robot = load_robot(write_robot(tmp_path, SOUND, ["hip", "knee"]))
    monkeypatch.setattr("drake_tc.robot.plant.reduced_urdf", lambda *args, **more: "<robot name='x'><link/></robot>")
    with pytest.raises(ParamsError, match=r"arm\.urdf: Drake refuses the robot: "):
        make_plant(robot, 0.0)


@pytest.mark.parametrize("rest", ["../secret.urdf", "a/../../secret.urdf", "/etc/hostname"])
def test_a_package_s_file_stays_inside_it(tmp_path, monkeypatch, rest):
    (tmp_path / "mine").mkdir()
    (tmp_path / "secret.urdf").write_text(SOUND)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    with pytest.raises(ParamsError, match="expected a path that stays inside the package 'mine'"):
        resolve(f"package://mine/{rest}", tmp_path)


@pytest.mark.parametrize("reference", ["package://../secret.urdf", "package:///etc/hostname", "a\0b", "x" * 5000])
def test_a_reference_that_names_no_file(tmp_path, reference):
    (tmp_path.parent / "secret.urdf").write_text(SOUND)
    with pytest.raises(ParamsError):
        resolve(reference, tmp_path)
