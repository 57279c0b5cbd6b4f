"""Every robot file that cannot be used is refused in one line that names file and field."""

import pytest

from drake_tc.errors import ParamsError
from drake_tc.robot.robot import load_robot

from .robots import ARM, robot_file

FT = {"tip": {"joint": "mark_joint"}}

REFUSED = {
    "unknown key": ({"jonts": []}, "unknown key 'jonts'; did you mean 'joints'"),
    "missing key": ({"base": None}, "base is missing; expected the name of a link \\(`drake-tc schema robot"),
    "no such base": ({"base": "waist"}, "base: no link 'waist'"),
    "fixed_base": ({"fixed_base": "yes"}, "fixed_base: expected true or false, got 'yes'"),
    "missing joint": ({"joints": ["elbow"]}, "no joint 'elbow' in the URDF; movable joints: shoulder, slide"),
    "fixed joint": ({"joints": ["mark_joint"]}, "joint 'mark_joint' is fixed, not movable"),
    "joint twice": ({"joints": ["wrist", "wrist"]}, "'wrist' is listed twice"),
    "no joints": ({"joints": []}, r"joints: expected at least 1 entry, got \[\]"),
    "urdf missing": ({"urdf": "leg.urdf"}, "leg.urdf: no such file"),
    "actuators missing": ({"actuators": "servo.yaml"}, "servo.yaml: no such file"),
    "package": ({"urdf": "package://no_such_package/a.urdf"}, r'pip install "drake-tc\[robots\]"'),
    "locked and listed": ({"locked": {"wrist": 0.1}}, "locked: unknown key 'wrist'; allowed: slide, spin"),
    "locked text": ({"locked": {"spin": "far"}}, "locked.spin: expected a finite number, got 'far'"),
    "posture out of range": ({"posture": {"shoulder": 2.5}}, "posture.shoulder: expected -1 to 2, got 2.5"),
    "posture of no joint": ({"posture": {"spin": 0.0}}, "posture: unknown key 'spin'"),
    "limit key": ({"limits": {"wrist": {"torque": 3}}}, "limits.wrist: unknown key 'torque'"),
    "limit sign": ({"limits": {"wrist": {"effort": 0}}}, "limits.wrist.effort: expected a positive number"),
    "limit order": ({"limits": {"wrist": {"lower": 3}}}, "limits.wrist: expected lower < upper"),
    "rotor": ({"rotor_inertia": {"wrist": -1}}, "rotor_inertia.wrist: expected a number >= 0"),
    "rotor of no joint": ({"rotor_inertia": {"spin": 1}}, "rotor_inertia: unknown key 'spin'"),
    "rotor and file": ({"rotor_inertia": {"wrist": 1}, "actuators": "arm.urdf"}, "a robot without `actuators`"),
    "imu link": ({"imu": {"head": {"link": "head"}}}, "imu.head.link: no link 'head'"),
    "imu pose": (
        {"imu": {"head": {"link": "hand", "xyz": [0, 1]}}},
        "imu.head.xyz: expected a list of 3 numbers, got \\[0, 1\\]",
    ),
    "imu without link": (
        {"imu": {"head": {"xyz": [0, 1, 0]}}},
        "imu.head: expected one of the keys 'joint' and 'link', got neither",
    ),
    "ft joint moves": (
        {"force_torque": {"tip": {"joint": "wrist"}}},
        "expected a joint that does not move, got 'wrist'",
    ),
    "ft no joint": ({"force_torque": {"tip": {"joint": "ankle"}}}, "got 'ankle'; possible: slide, spin, mark_joint"),
    "ft above base": ({"base": "hand", "force_torque": FT}, "the base 'hand' hangs from 'mark_joint'"),
    "contact inside": (
        {"force_torque": {"tip": {"joint": "mark_joint", "contact": {"link": "upper"}}}},
        "force_torque.tip.contact.link: expected a link beyond the sensor \\(hand, mark\\), got 'upper'",
    ),
    "floating above": (
        {"fixed_base": False, "base": "slider"},
        "no driven joint between a floating base and the URDF's root; 'shoulder' is above 'slider'",
    ),
    "pose key": ({"base_pose": {"x": 0}}, "base_pose: unknown key 'x'"),
}


@pytest.mark.parametrize(("changes", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_refused_with_file_and_field(tmp_path, changes, message):
    path = robot_file(tmp_path, **changes)
    with pytest.raises(ParamsError, match=message) as caught:
        load_robot(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("urdf", "message"),
    [
        ("<robot", "not valid XML"),
        ("<sdf/>", "expected a URDF .<robot>., got <sdf>"),
        (ARM.replace('child link="hand"', 'child link="nowhere"'), "joint 'wrist': no link 'nowhere'"),
        (ARM.replace('axis xyz="1 0 0"', 'axis xyz="0 0 0"'), "joint 'wrist' axis: expected a vector of some length"),
        (ARM.replace('axis xyz="1 0 0"', 'axis xyz="1 0"'), "joint 'wrist' axis: expected 3 finite numbers, got '1 0'"),
        (ARM.replace('<parent link="mark"/>', ""), "joint 'wrist': expected <parent link=...>"),
        (ARM.replace('effort="9"', 'effort="big"'), "joint 'wrist' effort: expected a finite number, got 'big'"),
    ],
)
def test_a_broken_urdf_is_refused(tmp_path, urdf, message):
    with pytest.raises(ParamsError, match=message):
        load_robot(robot_file(tmp_path, urdf))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\na: 2\n", "line 2: key 'a' is given twice"),
        ("a: [", "not valid YAML"),
        ("- 1\n", "expected a mapping with name, urdf, base"),
    ],
)
def test_a_broken_file_is_refused(tmp_path, text, message):
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    with pytest.raises(ParamsError, match=message):
        load_robot(path)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(ParamsError, match="no such robot file"):
        load_robot(tmp_path / "none.yaml")


def test_packages_are_found_in_ros_package_path(tmp_path, monkeypatch):
    folder = tmp_path / "share" / "arm_description" / "urdf"
    folder.mkdir(parents=True)
    (folder / "arm.urdf").write_text(ARM)
    path = robot_file(tmp_path, urdf="package://arm_description/urdf/arm.urdf")
    with pytest.raises(ParamsError, match="ROS_PACKAGE_PATH"):
        load_robot(path)
    for root in (tmp_path / "share", tmp_path / "share" / "arm_description"):
        monkeypatch.setenv("ROS_PACKAGE_PATH", str(root))
        assert load_robot(path).urdf == folder / "arm.urdf"
    (folder / "arm.urdf").unlink()
    with pytest.raises(ParamsError, match=r"has no file 'urdf/arm\.urdf'"):
        load_robot(path)
