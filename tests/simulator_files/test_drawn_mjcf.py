"""Terms of drawn MJCF files push as hard as MuJoCo's own actuators and joints, or say what they leave out."""

import random

import numpy as np
import pytest

from drake_tc.errors import RigError
from drake_tc.simulator_files.read import read_joints

from .drawn_mjcf import drawn_mjcf

FILES = 60


def expected_torque(joint, gear, position, velocity, command):
    """Of actuator and joint by the terms; the command of a servo is the actuator's length."""
    terms = joint.terms
    driving = 0.0
    if joint.driven:
        effort = command / gear - position if terms.drive == "position_servo" else command
        driving = terms.kp * effort - (joint.derivative_gain + terms.derivative_gain) * velocity
        limit = np.inf if terms.torque_limit is None else terms.torque_limit
        driving = np.clip(driving, -limit, limit) + terms.derivative_gain * velocity
    braking = terms.damping * velocity + terms.quadratic * velocity * abs(velocity)
    return driving - braking - terms.stiffness * position - terms.preload


@pytest.mark.parametrize("seed", range(FILES))
def test_terms_of_a_drawn_file_push_as_hard_as_in_mujoco(tmp_path, seed):
    mujoco = pytest.importorskip("mujoco", minversion="3.12")
    text, path = drawn_mjcf(seed), tmp_path / "drawn.xml"
    path.write_text(text, encoding="utf-8")
    model = mujoco.MjModel.from_xml_path(str(path))
    joint = read_joints(path, RigError)["j"]
    data, r = mujoco.MjData(model), random.Random(seed)
    assert joint.driven or any("its actuator <" in each for each in joint.unused)
    if "name='v'" in str(joint.unused) and ("its actuator" in str(joint.unused) or "actuatorfrcrange" in text):
        pytest.skip("a second limited actuator, which is listed as not used")
    for _ in range(8):
        position, velocity, command = r.uniform(-1.0, 1.0), r.uniform(-2.0, 2.0), r.uniform(-1.0, 1.0)
        data.qpos[0], data.qvel[0], data.ctrl[:] = position, velocity, 0.0
        data.ctrl[0] = command
        if model.na:
            data.act[:] = command if joint.terms.lag else 0.0  # the filter has settled
        mujoco.mj_forward(model, data)
        found = data.qfrc_passive[0] + (data.qfrc_actuator[0] if joint.driven else 0.0)
        expected = expected_torque(joint, model.actuator_gear[0][0], position, velocity, command)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert joint.terms.frictionloss == pytest.approx(model.dof_frictionloss[0])


ONE = (
    '<mujoco><compiler angle="radian"/>{options}<worldbody><body><joint name="a" axis="0 1 0" {joint}/>{more}'
    '<geom size="0.1" mass="1"/></body></worldbody><actuator>{actuators}</actuator>{rest}</mujoco>'
)


def read_one(tmp_path, **parts):
    path = tmp_path / "one.xml"
    parts = {"options": "", "joint": "", "more": "", "actuators": "", "rest": ""} | parts
    path.write_text(ONE.format(**parts), encoding="utf-8")
    return read_joints(path, RigError)["a"]


def test_what_is_not_used_is_listed_with_its_line(tmp_path):
    joint = read_one(
        tmp_path,
        joint='range="-1 1" actuatorfrcrange="-1 2" damping="1 0 2" stiffness="1 2"',
        actuators='<position joint="a" kp="2" ctrlrange="-1 1"/><motor name="push" joint="a"/>',
        rest='<tendon><fixed name="t" stiffness="3"><joint joint="a" coef="1"/></fixed></tendon>',
    )
    told = "; ".join(joint.unused)
    expected = ("third number of its damping", "depends on the deflection", "range", "actuatorfrcrange", "ctrlrange of")
    for words in (*expected, "its actuator <motor name='push'> in line 1", "its tendon <fixed name='t'> in line 1"):
        assert words in told, words


def test_what_acts_on_bodies_is_listed_at_their_joints(tmp_path):
    """MuJoCo applies drag, closed loops and tendons; an actuator may pull at a tendon of the joint."""
    joint = read_one(
        tmp_path,
        options='<option density="1.2" viscosity="0"/>',
        more='<site name="s"/>',
        actuators='<motor name="pull" tendon="t"/>',
        rest='<worldbody><site name="w"/></worldbody><tendon><fixed name="t"><joint joint="a" coef="1"/></fixed>'
        '<spatial name="rope" stiffness="2"><site site="s"/><site site="w"/></spatial></tendon>'
        '<equality><connect site1="s" site2="w"/></equality>',
    )
    mujoco = pytest.importorskip("mujoco", minversion="3.12")
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "one.xml")).opt.density == 1.2
    told = "; ".join(joint.unused)
    for words in (
        "density of <option>",
        "<connect> in line 1",
        "<spatial name='rope'>",
        "its actuator <motor name='pull'>",
    ):
        assert words in told, words
    assert "viscosity" not in told


BODY = '<body name="x" {}><site name="s"/><geom size="0.1"/></body>'


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        ({"more": BODY.format(""), "actuators": '<adhesion body="x" ctrlrange="0 1"/>'}, "the actuator <adhesion>"),
        ({"more": BODY.format(""), "actuators": '<motor site="s" gear="0 0 0 0 1 0"/>'}, "the actuator <motor>"),
        ({"more": BODY.format('gravcomp="1"')}, "gravcomp of <body name='x'>"),
        ({"actuators": '<damper joint="a" kv="2" ctrlrange="0 1"/>'}, "its actuator <damper>"),
        (
            {"actuators": '<dcmotor joint="a" motorconst="0.1" resistance="2" nominal="9 1 20"/>'},
            "its actuator <dcmotor>",
        ),
    ],
)
def test_what_acts_on_a_joint_and_is_no_drive_is_listed(tmp_path, parts, told):
    joint = read_one(tmp_path, **parts)
    assert any(told in each for each in joint.unused)
    assert not joint.driven


def test_a_group_that_is_switched_off_does_not_drive_and_its_damping_acts(tmp_path):
    mujoco = pytest.importorskip("mujoco", minversion="3.12")
    actuators = '<position joint="a" kp="5" group="2"/><motor joint="a" gear="3" damping="0.5" group="4"/>'
    joint = read_one(tmp_path, options='<option actuatorgroupdisable="2 4"/>', actuators=actuators)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "one.xml"))
    data = mujoco.MjData(model)
    data.ctrl[:], data.qvel[0] = 1.0, 1.0
    mujoco.mj_forward(model, data)
    assert not joint.driven
    assert data.qfrc_actuator[0] + data.qfrc_passive[0] == pytest.approx(-joint.terms.damping)


DRY = {"joint": 'frictionloss="0.5" damping="1" stiffness="2" springref="30"', "actuators": '<position joint="a"/>'}


@pytest.mark.parametrize(
    ("options", "frictionloss"),
    [
        ('<option><flag constraint="disable"/></option>', 0.0),
        ('<option><flag damper="disable"/></option><option><flag damper="enable"/></option>', 0.5),
        ('<compiler angle="degree"/>', 0.5),
    ],
)
def test_of_options_that_a_file_has_twice_the_last_one_counts_as_in_mujoco(tmp_path, options, frictionloss):
    """The file begins with radians."""
    mujoco = pytest.importorskip("mujoco", minversion="3.12")
    joint = read_one(tmp_path, options=options, **DRY)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "one.xml"))
    data = mujoco.MjData(model)
    data.qvel[0] = 1.0
    mujoco.mj_forward(model, data)
    assert data.qfrc_passive[0] == pytest.approx(-joint.terms.damping - joint.terms.preload)
    assert joint.terms.frictionloss == frictionloss
    assert (data.nefc == 0) == (frictionloss == 0.0)


BRAKED = '<general joint="a" gainprm="10" ctrlrange="-.5 .5" biastype="affine" biasprm="0 0 -1"/>'


@pytest.mark.parametrize("limit", [3.0, 8.0])
def test_a_limit_of_the_joint_is_that_of_the_drive_with_its_damping(tmp_path, limit):
    """Where it is the smaller one; that of the command is one without the damping."""
    mujoco = pytest.importorskip("mujoco", minversion="3.12")
    joint = read_one(tmp_path, joint=f'actuatorfrcrange="-{limit} {limit}"', actuators=BRAKED)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "one.xml"))
    data = mujoco.MjData(model)
    for speed in (-2.0, 1.0, 2.0):
        data.qvel[0], data.ctrl[0] = speed, 0.4
        mujoco.mj_forward(model, data)
        expected = expected_torque(joint, 1.0, 0.0, speed, 0.4)
        assert data.qfrc_actuator[0] + data.qfrc_passive[0] == pytest.approx(expected, rel=1e-9)
    assert ["larger limit of <general>" in each for each in joint.unused] == [True]
    assert joint.terms.torque_limit == min(limit, 5.0)


PULLED = '<motor joint="a" gear="3"/><velocity joint="a" kv="2"/>'
SERVO = '<position joint="a"/>'


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        ({"joint": 'actuatorfrcrange="-5 5"', "actuators": PULLED}, "which limits several actuators together"),
        ({"more": '<joint name="a_backlash" axis="0 1 0"/>', "actuators": SERVO}, "too wide or does not act"),
        ({"more": '<joint name="a_backlash" axis="1 0 0"/>', "actuators": SERVO}, "not on the same body and axis"),
    ],
)
def test_limits_and_plays_that_are_not_taken_are_listed(tmp_path, parts, told):
    assert any(told in each for each in read_one(tmp_path, **parts).unused)


def test_a_damping_ratio_is_that_of_the_actuator_itself(tmp_path):
    """Neither of two actuators of the joint has a name."""
    mujoco = pytest.importorskip("mujoco", minversion="3.12")
    drives = '<motor joint="a"/><position joint="a" kp="9" dampratio="0.7"/>'
    joint = read_one(tmp_path, actuators=drives)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "one.xml"))
    assert joint.derivative_gain == pytest.approx(-model.actuator_biasprm[1][2]) != 0.0


def test_soft_dry_friction_and_a_drive_that_is_switched_off_are_listed(tmp_path):
    joint = 'frictionloss="0.5" solreffriction="0.2 1"'
    drive = {"options": '<option actuatorgroupdisable="1"/>', "actuators": '<position joint="a" group="1"/>'}
    assert read_one(tmp_path, joint=joint, **drive).unused == (
        "its solreffriction (0.2)",
        "<position> in line 1, whose group <option> disables",
    )


def test_an_include_is_followed_and_one_that_is_missing_is_named(tmp_path):
    (tmp_path / "drives.xml").write_text(
        '<mujoco><actuator><position joint="a" kp="7"/></actuator></mujoco>', encoding="utf-8"
    )
    assert read_one(tmp_path, rest='\n<include file="drives.xml"/>').terms.kp == 7.0
    with pytest.raises(RigError, match=r"<include> in line 2: file 'gone.xml': no such file"):
        read_one(tmp_path, rest='\n<include file="gone.xml"/>')
    (tmp_path / "drives.xml").write_text('<mujoco><include file="drives.xml"/></mujoco>', encoding="utf-8")
    with pytest.raises(RigError, match="includes itself"):
        read_one(tmp_path, rest='<include file="drives.xml"/>')


@pytest.mark.parametrize("name", ["a_backlash", "play"])
def test_a_free_hinge_beside_the_driven_one_is_the_play_of_its_gear(tmp_path, name):
    more = f'<joint name="{name}" axis="0 1 0" range="-0.01 0.01"/>'
    joint = read_one(tmp_path, more=more, actuators='<position joint="a"/>')
    assert joint.terms.backlash == pytest.approx(0.02)


def test_a_spring_hinge_beside_the_driven_one_is_the_compliance_of_its_gear(tmp_path):
    more = '<joint name="flex" axis="0 1 0" stiffness="200"/>'
    joint = read_one(tmp_path, more=more, actuators='<position joint="a"/>')
    assert joint.terms.compliance == pytest.approx(1.0 / 200.0)


def test_friction_and_cogging_of_a_motor_are_those_of_mujoco(tmp_path):
    """Sliding at a steady speed, a passive dcmotor brakes as the terms say."""
    mujoco = pytest.importorskip("mujoco", minversion="3.12")
    motor = '<dcmotor joint="a" motorconst="0.1" resistance="2" input="none" lugre="1000 5 0.1 0.25 0.3" gear="2"'
    joint = read_one(tmp_path, options='<option gravity="0 0 0" timestep="0.0005"/>', actuators=f"{motor}/>")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "one.xml"))
    data, terms = mujoco.MjData(model), joint.terms
    for speed in (0.02, 0.1, 0.4):
        mujoco.mj_resetData(model, data)
        for _ in range(3000):
            data.qvel[0] = speed
            mujoco.mj_step(model, data)
        data.qvel[0] = speed
        mujoco.mj_forward(model, data)
        peak = terms.stribeck.height * np.exp(-((speed / terms.stribeck.velocity) ** terms.stribeck.exponent))
        expected = -(terms.frictionloss + peak + terms.damping * speed)
        assert data.qfrc_actuator[0] == pytest.approx(expected, rel=1e-4)
    joint = read_one(
        tmp_path,
        options='<option gravity="0 0 0"/>',
        actuators='<dcmotor joint="a" motorconst="0.1" resistance="2" cogging="0.3 5 0.4" gear="3"/>',
    )
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "one.xml"))
    data = mujoco.MjData(model)
    for position in (0.0, 0.2, 0.5):
        data.qpos[0], angle = position, joint.terms.ripple.cycles * position
        mujoco.mj_forward(model, data)
        expected = -joint.terms.ripple.cosine * np.cos(angle) - joint.terms.ripple.sine * np.sin(angle)
        assert data.qfrc_actuator[0] == pytest.approx(expected, rel=1e-9)


def test_a_plain_transmission_reflects_its_motor(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(
        '<robot name="r"><link name="b"/><link name="l"/><joint name="a" type="revolute"><parent link="b"/>'
        '<child link="l"/><mimic joint="z"/></joint><transmission name="t"><type>x/SimpleTransmission</type>'
        '<joint name="a"/><actuator name="m"><mechanicalReduction>100</mechanicalReduction><motorInertia>2e-5'
        "</motorInertia></actuator></transmission></robot>",
        encoding="utf-8",
    )
    joint = read_joints(path, RigError)["a"]
    assert joint.terms.armature == pytest.approx(0.2)
    assert joint.unused == ("that it follows 'z' (mimic)",)


def test_a_default_class_that_is_not_there_is_refused_as_mujoco_does(tmp_path):
    joint = "<body><joint name='a' class='servo'/><geom size='.1'/></body>"
    path = tmp_path / "arm.xml"
    path.write_text(f"<mujoco><default><default class='arm'/></default><worldbody>{joint}</worldbody></mujoco>")
    with pytest.raises(RigError, match="<joint name='a'> in line 1: no default class 'servo'; classes here: main, arm"):
        read_joints(path, RigError)


def test_an_attribute_that_is_no_number_is_refused_with_its_line(tmp_path):
    with pytest.raises(RigError, match=r"<joint name='a'> in line 1: stiffness: expected finite numbers, got 'soft'"):
        read_one(tmp_path, joint='stiffness="soft"')
