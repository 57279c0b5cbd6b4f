"""Terms merged into an MJCF file push as they do alone, whatever the file's default classes hand on; MuJoCo decides."""

import numpy as np
import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import save_models
from drake_tc.cli.main import run as drake_tc
from drake_tc.errors import ParamsError
from drake_tc.exchange.mjcf import to_mjcf, with_torque_constant
from drake_tc.exchange.mujoco_run import file_notes
from drake_tc.exchange.projection import TARGETS, project
from drake_tc.exchange.trial import changes
from drake_tc.simulator_files.read import read_joints

mujoco = pytest.importorskip("mujoco")

SERVO, MOTOR = Drive("position_servo", 2e-4), Drive("current", 0.5)
FRICTION = (
    EffectValue("rotor_inertia", {"rotor_inertia": 0.31}),
    EffectValue("viscous", {"viscous": 32.5}),
    EffectValue("coulomb", {"coulomb": 6.25}),
)
FILE = """<mujoco model="mine">
  <compiler angle="radian"/>
  <default>
    <default class="arm">
      <joint damping="1 2 3" armature="0.5" frictionloss="0.7" stiffness="4"/>
      {default}
    </default>
  </default>
  <worldbody>
    <body name="link" childclass="arm">
      <joint name="knee" axis="0 1 0" stiffness="0"/>
      <geom size="0.1" mass="1" pos="0 0 0"/>
    </body>
  </worldbody>
  <actuator/>
  <actuator>
    {actuator}
  </actuator>
</mujoco>
"""
FILES = {
    "servo": ('<position kp="100" kv="50" gear="3" forcerange="-500 500" ctrlrange="-6 6"/>', "position"),
    "servo with a damping ratio": ('<position kp="100" dampratio="1" gear="3"/>', "position"),
    "general servo": (
        '<general gainprm="7" biastype="affine" biasprm="0 -7 -1" gear="2" ctrlrange="-4 4"/>',
        "general",
    ),
    "motor": ('<motor gear="80" forcerange="-1 1" ctrlrange="-1 1"/>', "motor"),
    "delayed": ('<motor gear="80" delay="0.01" nsample="6"/>', "motor"),
}


SERVO_OF_THE_KNEE = [project(ActuatorModel("knee", SERVO, FRICTION), TARGETS["mjcf"])]


def own_file(tmp_path, actuator, default="", before=""):
    """A file of the user's, with `before` in front of its world."""
    path = tmp_path / "robot.xml"
    path.write_text(FILE.format(default=default, actuator=actuator).replace("<worldbody>", f"{before}<worldbody>", 1))
    return path


def with_class(tmp_path, kind):
    default, tag = FILES[kind]
    return own_file(tmp_path, f'<{tag} class="arm" name="k" joint="knee"/>', default)


def merged(tmp_path, kind, model):
    path = with_class(tmp_path, kind)
    return to_mjcf([project(model, TARGETS["mjcf"])], path), path


def forward(text, command=(), position=0.0, velocity=0.0):
    """MuJoCo's model and its forces without gravity; the numbers are of the first joint."""
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    data.ctrl[: len(command)] = command
    data.qpos[0], data.qvel[0] = position, velocity
    mujoco.mj_forward(model, data)
    return model, data


def torques(text, command, position, velocity):
    """Torque of the actuator, and of everything passive but gravity, at the joint [N m]."""
    data = forward(text, [command], position, velocity)[1]
    return data.qfrc_actuator[0], data.qfrc_passive[0]


@pytest.mark.parametrize("drive", [SERVO, MOTOR], ids=lambda drive: drive.kind)
@pytest.mark.parametrize("kind", FILES)
def test_default_classes_change_nothing(tmp_path, kind, drive):
    text, _ = merged(tmp_path, kind, ActuatorModel("knee", drive, FRICTION))
    kp = 1.0 / drive.gain
    error = 0.02 - 0.01 if drive is SERVO else 0.02
    found = torques(text, 0.02, 0.01, 0.5)
    np.testing.assert_allclose(found, [kp * error, -32.5 * 0.5], rtol=1e-9)
    model = mujoco.MjModel.from_xml_string(text)
    assert model.dof_armature[0] == 0.31 and model.dof_frictionloss[0] == 6.25


def test_limits_of_the_file_stay_limits_at_the_joint(tmp_path):
    """3 * 500 N m and 6/3 rad of the servo; 80 * 1 N m of the motor, also as a command in A."""
    text, _ = merged(tmp_path, "servo", ActuatorModel("knee", SERVO, FRICTION))
    model = mujoco.MjModel.from_xml_string(text)
    np.testing.assert_allclose(model.actuator_forcerange[0], [-1500.0, 1500.0], rtol=1e-9)
    np.testing.assert_allclose(model.actuator_ctrlrange[0], [-2.0, 2.0], rtol=1e-9)
    text, _ = merged(tmp_path, "motor", ActuatorModel("knee", MOTOR, FRICTION))
    assert torques(text, 1e6, 0.0, 0.0)[0] == pytest.approx(80.0, rel=1e-9)
    model = mujoco.MjModel.from_xml_string(text)
    np.testing.assert_allclose(model.actuator_ctrlrange[0], [-40.0, 40.0], rtol=1e-9)
    text, _ = merged(tmp_path, "motor", ActuatorModel("knee", SERVO, FRICTION))  # a torque is no angle
    assert torques(text, 1e6, 0.0, 0.0)[0] == pytest.approx(80.0, rel=1e-9)


def test_an_identified_limit_takes_the_place_of_the_files(tmp_path):
    limited = ActuatorModel("knee", SERVO, (*FRICTION, EffectValue("saturation", {"limit": 0.01})))
    text, _ = merged(tmp_path, "servo", limited)
    assert torques(text, 2.0, 0.0, 0.0)[0] == pytest.approx(50.0, rel=1e-9)


def test_digits_that_a_file_does_not_have_are_no_damping_beside_the_model(tmp_path):
    gain, damping = 58.217701234567, 0.62374405651234
    limit = EffectValue("saturation.servo", {"limit": 1.0 / gain, "derivative_time": damping / gain})
    own = (EffectValue("viscous", {"viscous": 0.7}), EffectValue("coulomb", {"coulomb": 0.17}), limit)
    written = [project(ActuatorModel("knee", Drive("position_servo", 1.0 / gain), own), TARGETS["mjcf"])]
    path = with_class(tmp_path, "servo")
    text = to_mjcf(written, path)
    assert not any("servo damping" in line for line in changes(text, written, path))
    pushed, passive = torques(text, 0.01, 0.0, 0.3)
    assert pushed == pytest.approx(0.01 * gain - 0.3 * damping, rel=1e-8)
    assert passive == pytest.approx(-0.3 * (0.7 - damping), rel=1e-7)


def test_what_is_merged_is_read_again(tmp_path):
    text, path = merged(tmp_path, "servo", ActuatorModel("knee", SERVO, FRICTION))
    path.write_text(text)
    found = read_joints(path, ParamsError)["knee"]
    assert found.terms.kp == pytest.approx(5000.0, rel=1e-9) and found.derivative_gain == 0.0
    assert (found.terms.damping, found.terms.quadratic, found.terms.frictionloss) == (32.5, 0.0, 6.25)
    assert found.terms.torque_limit == pytest.approx(1500.0, rel=1e-9)


def test_the_play_of_a_gear_is_free(tmp_path):
    text, _ = merged(tmp_path, "motor", ActuatorModel("knee", MOTOR, (EffectValue("backlash", {"backlash": 0.02}),)))
    model, data = forward(text)
    play = model.joint("knee_backlash")
    dof = play.dofadr[0]
    assert model.dof_frictionloss[dof] == model.dof_armature[dof] == model.jnt_stiffness[play.id] == 0.0
    data.qvel[dof] = 1.0
    mujoco.mj_forward(model, data)
    assert data.qfrc_passive[dof] == 0.0


@pytest.mark.parametrize("kind", ["servo with a damping ratio", "general servo", "motor"])
def test_a_drive_on_a_voltage_is_a_dc_motor(tmp_path, kind):
    """1.25 V on 4 N m/V, 32.5 N m s/rad of which 1.5 N m/A make 6; with a limit of force in the file it is a motor."""
    limited = (*FRICTION, EffectValue("saturation", {"limit": 2.0}))
    model = ActuatorModel("knee", Drive("voltage", 0.25), limited)
    projection = with_torque_constant(project(model, TARGETS["mjcf"]), 1.5, TARGETS["mjcf"])
    text = to_mjcf([projection], with_class(tmp_path, kind))
    back_emf = 0.0 if kind == "motor" else 6.0
    assert ("<dcmotor " in text) is (kind != "motor")
    np.testing.assert_allclose(
        torques(text, 1.25, 0.0, 0.5), [5.0 - back_emf * 0.5, -(32.5 - back_emf) * 0.5], rtol=1e-9
    )
    assert torques(text, 1e3, 0.0, 0.0)[0] == pytest.approx(8.0, rel=1e-9)


def test_a_second_actuator_that_brakes_is_switched_off(tmp_path):
    """It would act beside the identified model; one that only takes a command of its own stays."""
    both = '<position name="a" joint="knee"/> <velocity name="b" joint="knee"/> <motor name="c" joint="knee"/>'
    path = own_file(tmp_path, both)
    text = to_mjcf(SERVO_OF_THE_KNEE, path)
    assert forward(text, [0.0, 5.0, 2.0], velocity=1.0)[1].qfrc_actuator[0] == 2.0
    (removed, kept) = changes(text, SERVO_OF_THE_KNEE, path)
    assert "the command of <velocity name='b'>" in removed and "its actuator <motor name='c'>" in kept


@pytest.mark.parametrize("group", ["", "group='3'"])
def test_damping_and_inertia_of_a_second_actuator_are_not_added_to_the_models(tmp_path, group):
    """In MuJoCo they act at the joint whatever drives the actuator, also in a group that is switched off."""
    first = '<position name="a" joint="knee"/>'
    second = f"<motor name='b' joint='knee' gear='5' damping='0.9' armature='0.01' {group}/>"
    accelerations = []
    for actuators, option in ((first + second, "<option actuatorgroupdisable='3'/>"), (first, "")):
        written = to_mjcf(SERVO_OF_THE_KNEE, own_file(tmp_path, actuators, before=option))
        accelerations.append(forward(written, [0.5], velocity=1.0)[1].qacc[0])
    assert accelerations[0] == pytest.approx(accelerations[1], rel=1e-12)


@pytest.mark.parametrize("group", [0, 2])
def test_a_drive_whose_group_is_switched_off_is_switched_on(tmp_path, group):
    option = f"<option actuatorgroupdisable='{group}'/>"
    path = own_file(tmp_path, f'<position name="a" joint="knee" group="{group}"/>', before=option)
    assert torques(to_mjcf(SERVO_OF_THE_KNEE, path), 0.5, 0.0, 0.0)[0] == pytest.approx(0.5 / SERVO.gain, rel=1e-9)


def test_where_every_group_is_switched_off_there_is_one_line(tmp_path):
    option = f"<option actuatorgroupdisable='{' '.join(map(str, range(31)))}'/>"
    path = own_file(tmp_path, '<position name="a" joint="knee"/>', before=option)
    with pytest.raises(ParamsError, match="knee: expected a group of actuators that is switched on"):
        to_mjcf(SERVO_OF_THE_KNEE, path)


def test_an_actuator_that_names_its_joint_in_the_parents_frame_is_the_drive(tmp_path):
    written = to_mjcf(SERVO_OF_THE_KNEE, own_file(tmp_path, '<position name="a" jointinparent="knee" kp="3"/>'))
    model = mujoco.MjModel.from_xml_string(written)
    assert model.nu == 1
    assert model.actuator_gainprm[0][0] == pytest.approx(1.0 / SERVO.gain)


def test_forces_that_the_file_disables_are_named(tmp_path):
    flag = "<option><flag damper='disable'/></option>"
    path = own_file(tmp_path, '<position name="a" joint="knee"/>', before=flag)
    told = changes(to_mjcf(SERVO_OF_THE_KNEE, path), SERVO_OF_THE_KNEE, path)
    assert any("its damping, which <flag> disables" in each for each in told)


LEFT = {
    "spring": ('stiffness="1.5" springref="0.2"', "<position joint='knee' kp='5'/>", "a spring of 1.5 N m/rad"),
    "filter": ("", "<position joint='knee' kp='5' timeconst='0.02'/>", "a filter of the command of 0.02 s"),
    "general filter": (
        "",
        "<general joint='knee' gainprm='5' biastype='affine' biasprm='0 -5 0' dyntype='filter' dynprm='0.1'/>",
        "a filter of the command of 0.1 s",
    ),
    "constant force": (
        "",
        "<general joint='knee' gainprm='5' biastype='affine' biasprm='0.5 -5 0'/>",
        "the constant force of <general>",
    ),
    "gear": ("", "<position joint='knee' kp='5' gear='4'/>", "is 4 times the joint's (gear)"),
    "another drive": ("", "<motor joint='knee' gear='3'/>", "a drive whose command is a torque"),
    "integral": ("", "<pid joint='knee' kp='5' ki='10'/>", "integral action of 2 1/s"),
    "cogging": (
        "",
        "<position joint='knee'/><dcmotor joint='knee' motorconst='0.1' resistance='1' input='none' cogging='1 5 0'/>",
        "a torque ripple",
    ),
}


@pytest.mark.parametrize(
    ("own", "handed_on"), [('solimpfriction="0.1 0.2 0.5"', ""), ("", 'solimpfriction="0.1 0.2 0.5"')]
)
def test_dry_friction_holds_although_the_file_had_made_it_soft(tmp_path, own, handed_on):
    """Under four fifths of its friction the joint creeps no further than in a file that says nothing of it."""
    crept = []
    for soft in (True, False):
        path = own_file(tmp_path, "<motor name='a' joint='knee'/>")
        text = path.read_text().replace("<joint name", f"<joint {own if soft else ''} name")
        path.write_text(text.replace("<joint damping", f"<joint {handed_on if soft else ''} damping"))
        model = mujoco.MjModel.from_xml_string(to_mjcf(SERVO_OF_THE_KNEE, path))
        model.opt.gravity[:], model.actuator_gainprm[:], model.actuator_biasprm[:] = 0.0, 0.0, 0.0
        data = mujoco.MjData(model)
        data.qfrc_applied[0] = 5.0
        mujoco.mj_step(model, data, 1000)
        crept.append(data.qpos[0])
    assert 0.0 < crept[1] < 0.01 and crept[0] == pytest.approx(crept[1], rel=1e-9)


@pytest.mark.parametrize("kind", LEFT)
def test_what_the_model_lacks_goes_and_is_named(tmp_path, kind):
    """The file that was written moves as a file that never had it."""
    joint, actuator, told = LEFT[kind]
    moved = []
    for has in (joint, ""), ("", "<position joint='knee' kp='5'/>"):
        path = own_file(tmp_path, actuator if has[0] or not has[1] else has[1])
        path.write_text(path.read_text().replace('stiffness="0"', has[0] or 'stiffness="0"'))
        written = to_mjcf(SERVO_OF_THE_KNEE, path)
        compiled = mujoco.MjModel.from_xml_string(written)
        data = mujoco.MjData(compiled)
        data.ctrl[:1] = 0.3
        mujoco.mj_step(compiled, data, 300)
        moved.append(data.qpos[0])
        if not has[1]:
            (line,) = changes(written, SERVO_OF_THE_KNEE, path)
            assert told in line and "removed from your file" in line
    assert moved[0] == moved[1] != 0.0


PLAY_OF_THE_KNEE = [
    project(ActuatorModel("knee", SERVO, (*FRICTION, EffectValue("backlash", {"backlash": 0.02}))), TARGETS["mjcf"])
]
SERVO_FILE = '<position name="a" joint="knee" kp="5" timeconst="0.1"/>'
HINGE = '<joint name="knee_backlash" axis="0 1 0" range="-0.01 0.01" stiffness="0"/>'
WHEEL = '<body name="base"><freejoint/><geom size="1"/></body>'
POSE = "<keyframe><key qpos='{}' act='0.1' ctrl='0.3'/></keyframe>"


def test_keyframes_and_sensors_follow_the_hinge_of_a_gear_that_comes_and_goes(tmp_path):
    """A wheel of another joint stands behind it, and a body that floats before it."""
    last = '<body><joint name="wheel"/><geom size="0.1"/></body></worldbody>'
    path = own_file(tmp_path, SERVO_FILE)
    text = path.read_text().replace("<worldbody>", f"<worldbody>{WHEEL}").replace("</worldbody>", last)
    path.write_text(text.replace("</mujoco>", f"{POSE.format('1 2 3 1 0 0 0 0.2 0.4')}</mujoco>"))
    with_play = to_mjcf(PLAY_OF_THE_KNEE, path)
    model = mujoco.MjModel.from_xml_string(with_play)
    np.testing.assert_allclose(model.key_qpos[0], [1, 2, 3, 1, 0, 0, 0, 0.2, 0.0, 0.4])
    assert model.key_ctrl[0] == 0.3 and "act=" not in with_play
    told = changes(with_play, PLAY_OF_THE_KNEE, path)
    assert "The actuator states (act) were removed from the keyframes, because the drive has other states now." in told
    path.write_text(with_play.replace("</mujoco>", "<sensor><jointpos joint='knee_backlash'/></sensor></mujoco>"))
    without = to_mjcf(SERVO_OF_THE_KNEE, path)
    model = mujoco.MjModel.from_xml_string(without)
    np.testing.assert_allclose(model.key_qpos[0], [1, 2, 3, 1, 0, 0, 0, 0.2, 0.4])
    told = changes(without, SERVO_OF_THE_KNEE, path)
    assert "<jointpos> was removed from your file, because it refers to the removed joint knee_backlash." in told


def test_a_new_drive_stands_behind_the_others_whose_controls_keep_their_places(tmp_path):
    last = '<body><joint name="wheel" class="main"/><geom size="0.1"/></body></worldbody>'
    path = own_file(tmp_path, '<motor name="w" joint="wheel"/>')
    text = path.read_text().replace("</worldbody>", last)
    path.write_text(text.replace("</mujoco>", "<keyframe><key ctrl='0.7'/></keyframe></mujoco>"))
    model = mujoco.MjModel.from_xml_string(to_mjcf(SERVO_OF_THE_KNEE, path))
    assert model.actuator("w").id == 0 and model.key_ctrl[0].tolist() == [0.7, 0.0]


def test_a_coupling_of_the_same_name_is_not_the_joint(tmp_path):
    path = own_file(tmp_path, SERVO_FILE)
    path.write_text(
        path.read_text().replace("</mujoco>", "<equality><joint name='knee' joint1='knee'/></equality></mujoco>")
    )
    model = mujoco.MjModel.from_xml_string(to_mjcf(SERVO_OF_THE_KNEE, path))
    assert model.dof_armature[0] == 0.31 and model.neq == 1


def test_axis_and_type_of_a_joint_may_be_those_of_its_class(tmp_path):
    path = own_file(tmp_path, SERVO_FILE)
    text = path.read_text().replace('axis="0 1 0"', 'class="arm"').replace(' childclass="arm"', "")
    path.write_text(text.replace("<joint damping", '<joint axis="0 1 0" ref="0.3" springdamper="0.1 1" damping'))
    model, data = forward(to_mjcf(PLAY_OF_THE_KNEE, path))
    np.testing.assert_allclose(model.jnt_axis, [[0, 1, 0]] * 2)
    assert model.qpos0[1] == 0.0 and model.jnt_stiffness[1] == 0.0
    path.write_text(text.replace("<joint damping", '<joint type="slide" damping').replace("radian", "degree"))
    spring = EffectValue("cable_spring", {"spring_stiffness": 2.0, "spring_preload": 0.4})
    model = ActuatorModel("knee", SERVO, (spring,), joint_type="prismatic")
    data = forward(to_mjcf([project(model, TARGETS["mjcf"])], path))[1]
    assert data.qfrc_passive[0] == pytest.approx(-0.4)
    with pytest.raises(ParamsError, match="joint 'knee' is a slide; the model has a hinge"):
        to_mjcf(SERVO_OF_THE_KNEE, path)
    wheel = '<body><joint name="wheel" type="hinge"/><geom size="1"/></body></worldbody>'
    path.write_text(text.replace("<joint damping", '<joint type="ball" damping').replace("</worldbody>", wheel))
    with pytest.raises(ParamsError, match="no hinge or slide <joint name='knee'>; joints: wheel"):
        to_mjcf(SERVO_OF_THE_KNEE, path)


DC = '<dcmotor name="a" joint="knee" motorconst="0.1" resistance="2" gear="10" ctrlrange="-12 12"/>'


@pytest.mark.parametrize(
    ("actuator", "kind", "largest"),
    [
        ('<general name="a" joint="knee" gainprm="10" gear="2" ctrlrange="-1 1"/>', "current", 20.0),
        ('<motor name="a" joint="knee" gear="-4" ctrlrange="-1 2"/>', "current", 8.0),
        (DC, "voltage", 6.0),
        ('<velocity name="a" joint="knee" kv="10" ctrlrange="-1 1"/>', "current", 2e6),
        ('<damper name="a" joint="knee" kv="10" ctrlrange="0 1"/>', "current", 2e6),
    ],
)
def test_a_limit_of_the_command_is_that_of_the_same_torque_or_goes(tmp_path, actuator, kind, largest):
    model = ActuatorModel("knee", Drive(kind, 0.5), FRICTION)
    text = to_mjcf([project(model, TARGETS["mjcf"])], own_file(tmp_path, actuator))
    assert max(abs(torques(text, command, 0.0, 0.0)[0]) for command in (-1e6, 1e6)) == pytest.approx(largest, rel=1e-9)


@pytest.mark.parametrize("place", ["<joint damping", "<joint name"])
def test_a_limit_of_the_joint_gives_way_to_an_identified_one_and_one_of_the_command_is_told(tmp_path, place):
    limited = ActuatorModel("knee", MOTOR, (*FRICTION, EffectValue("saturation", {"limit": 10.0})))
    projections = [project(limited, TARGETS["mjcf"])]
    path = own_file(tmp_path, '<motor name="a" joint="knee" gear="4"/>')
    path.write_text(path.read_text().replace(place, place.replace(" ", ' actuatorfrcrange="-3 3" ')))
    assert torques(to_mjcf(projections, path), 1e6, 0.0, 0.0)[0] == pytest.approx(20.0, rel=1e-9)
    path = own_file(tmp_path, '<motor name="a" joint="knee" gear="4" ctrlrange="-1 1"/>')
    kept = changes(to_mjcf(projections, path), projections, path)[-1]
    assert "kept from your file" in kept and "a limit of the torque of 4 N m" in kept


@pytest.mark.parametrize(
    ("actuator", "told"),
    [
        ('gear="x"', "robot.xml: <motor> in line 17: gear: expected finite numbers, got 'x'"),
        ('delay="a"', "robot.xml: <motor> in line 17: delay: expected finite numbers, got 'a'"),
        ('class="leg"', "robot.xml: <motor> in line 17: no default class 'leg'; classes here: main, arm"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused_in_one_line(tmp_path, actuator, told):
    with pytest.raises(ParamsError, match=told):
        to_mjcf(SERVO_OF_THE_KNEE, own_file(tmp_path, f'<motor joint="knee" {actuator}/>'))


@pytest.mark.parametrize("actuator", ['general name="a" biastype="affine" biasprm="0 -1 0"', 'velocity name="a"'])
def test_limits_that_stay_are_told_although_the_drive_has_another_tag(tmp_path, actuator):
    path = own_file(tmp_path, f'<{actuator} joint="knee" forcerange="-1 2" ctrlrange="-1 1"/>')
    (*_, kept) = changes(to_mjcf(SERVO_OF_THE_KNEE, path), SERVO_OF_THE_KNEE, path)
    assert "kept from your file" in kept and "forcerange of <position name='a'>, which is not symmetric" in kept
    assert ("ctrlrange of <position name='a'>" in kept) == ("general" in actuator)


def test_a_limit_that_goes_is_told(tmp_path):
    path = own_file(tmp_path, "<position joint='knee' kp='5' inheritrange='1'/>")
    path.write_text(path.read_text().replace('stiffness="0"', 'range="-9 9"'))
    removed, _kept = changes(to_mjcf(SERVO_OF_THE_KNEE, path), SERVO_OF_THE_KNEE, path)
    assert "removed from your file" in removed and "inheritrange of <position>" in removed


def test_a_written_file_that_mujoco_refuses_is_named(tmp_path):
    default = '<general dyntype="filter" dynprm="0.1" actlimited="true" actrange="-1 1"/>'
    path = own_file(tmp_path, '<general class="arm" name="a" joint="knee"/>', default)
    told = file_notes(to_mjcf(SERVO_OF_THE_KNEE, path), SERVO_OF_THE_KNEE, path)[-1]
    assert told.startswith("The written file cannot be loaded: MuJoCo refuses the file: Error: actrange specified")


def test_the_content_of_includes_is_written_with_the_rest(tmp_path):
    (tmp_path / "drives.xml").write_text(
        "<mujoco><actuator><position name='k' class='arm' joint='knee'/></actuator></mujoco>"
    )
    path = own_file(tmp_path, "", FILES["servo"][0])
    path.write_text(path.read_text().replace("</mujoco>", "<include file='drives.xml'/></mujoco>"))
    written = to_mjcf(SERVO_OF_THE_KNEE, path)
    compiled = mujoco.MjModel.from_xml_string(written)
    assert compiled.nu == 1 and compiled.actuator_gear[0][0] == 1.0 and compiled.actuator_biasprm[0][2] == 0.0
    assert compiled.actuator_gainprm[0][0] == pytest.approx(1.0 / 2e-4)
    told = "The files that your file includes were merged into the written file: drives.xml."
    assert told in changes(written, SERVO_OF_THE_KNEE, path)


def test_a_file_that_mujoco_does_not_load_is_written_and_its_run_named(tmp_path, capsys):
    time = np.arange(400) * 2e-3
    wave = np.sin(9.0 * time)
    table = np.column_stack([time, 0.1 * wave, 0.11 * wave + 0.01, 2.0 * np.cos(9.0 * time)])
    names = "time,knee/position,knee/position_command,knee/torque"
    np.savetxt(tmp_path / "held.csv", table, delimiter=",", header=names, comments="")
    (tmp_path / "rig.yaml").write_text("{joint: knee, drive: position_servo, load: torque}\n")
    save_models({"knee": ActuatorModel("knee", SERVO, FRICTION)}, tmp_path / "model.yaml")
    mesh = "<asset><mesh name='gone' file='gone.stl'/></asset>"
    path = own_file(tmp_path, "<position joint='knee'/>", before=mesh)
    path.write_text(path.read_text().replace('<geom size="0.1"', '<geom type="mesh" mesh="gone"'))
    command = ["export", str(tmp_path / "model.yaml"), "--to", "mjcf", "--into", str(tmp_path / "robot.xml")]
    command += ["--rig", str(tmp_path / "rig.yaml"), "--holdout", str(tmp_path / "held.csv")]
    assert drake_tc([*command, "--out", str(tmp_path / "out.xml")]) == 0
    told = capsys.readouterr().out
    assert "knee: the export was not run: MuJoCo refuses" in told and "gone.stl" in told
    assert (tmp_path / "out.xml").is_file()
