"""Terms come back from the files; what a user wrote around them stays; what cannot be said is told."""

import json
import re

import numpy as np
import pytest
import yaml
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import save_models
from drake_tc.cli.main import run
from drake_tc.errors import ParamsError
from drake_tc.exchange.actuator_configs import to_isaaclab
from drake_tc.exchange.bam import to_bam
from drake_tc.exchange.mjcf import to_mjcf, with_torque_constant
from drake_tc.exchange.projection import TARGETS, Loss, project
from drake_tc.exchange.urdf import to_sdf, to_urdf
from drake_tc.simulator_files.read import bam_servo, read_joints

from . import isaaclab_stand_in
from .isaaclab_stand_in import actuators

MODEL = ActuatorModel(
    "knee",
    Drive("position_servo", 2e-4),
    (
        EffectValue("rotor_inertia", {"rotor_inertia": 0.31}),
        EffectValue("viscous", {"viscous": 32.5}),
        EffectValue("coulomb", {"coulomb": 6.25}),
        EffectValue("quadratic_viscous", {"quadratic_viscous": 1.5}),
        EffectValue("saturation", {"limit": 0.01}),
        EffectValue("delay.command", {"delay": 0.004}),
        EffectValue("deadzone", {"deadzone": 1e-3}),
    ),
)


def exported(target: str):
    return [project(MODEL, TARGETS[target])]


def in_drake(text, kind):
    """Drake's joint of the knee, and its actuator if it has one."""
    plant = MultibodyPlant(1e-3)
    Parser(plant).AddModelsFromString(text, kind)
    plant.Finalize()
    indices = plant.GetJointActuatorIndices()
    return plant.GetJointByName("knee"), plant.get_joint_actuator(indices[0]) if indices else None, plant


def reflected_inertia(actuator):
    return actuator.default_rotor_inertia() * actuator.default_gear_ratio() ** 2


MINE = """<mujoco model="robot">
  <!-- my robot -->
  <compiler angle="degree"/>
  <worldbody>
    <body name="thigh">
      <geom size="0.1" mass="2"/>
      <joint name="hip" axis="0 1 0" range="-90 90"/> <!-- keep -->
      <body name="shank">
        <joint name="knee" axis="0 1 0" range="0 120" damping="1"/>
        <geom size="0.1" mass="2"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="m_hip" joint="hip"/>
    <motor name="m_knee" joint="knee" ctrlrange="-1 1" gear="80"/>
  </actuator>
</mujoco>
"""


def test_an_mjcf_file_of_the_users_keeps_the_rest(tmp_path):
    mine = tmp_path / "robot.xml"
    mine.write_text(MINE)
    text = to_mjcf(exported("mjcf"), mine)
    lines, before = text.splitlines()[1:], MINE.splitlines()
    changed = [i for i, (new, old) in enumerate(zip(lines, before, strict=True)) if new.rstrip() != old]
    assert [before[i].split()[0] for i in changed] == ["<joint", "<motor"]
    assert '<position name="m_knee" joint="knee" kp="5000"' in text and "<!-- keep -->" in text
    assert 'range="0 120"' in text


def test_backlash_becomes_a_free_hinge(tmp_path):
    mine = tmp_path / "robot.xml"
    mine.write_text(MINE)
    model = ActuatorModel("knee", Drive("torque", 1.0), (EffectValue("backlash", {"backlash": 0.02}),))
    text = to_mjcf([project(model, TARGETS["mjcf"])], mine)
    half = np.rad2deg(0.01)
    assert (
        f'name="knee_backlash" type="hinge" damping="0" armature="0" frictionloss="0" range="{-half:.10g} {half:.10g}"'
        in text
    )
    mujoco = pytest.importorskip("mujoco")
    assert mujoco.MjModel.from_xml_string(text).nv == 3


def test_drake_reads_what_its_urdf_says():
    (projection,) = exported("drake-urdf")
    knee, actuator, _plant = in_drake(to_urdf([projection], drake=True), "urdf")
    assert reflected_inertia(actuator) == pytest.approx(0.31)
    assert actuator.get_controller_gains().p == pytest.approx(5000.0)
    assert knee.default_damping_vector()[0] == pytest.approx(projection.terms.damping, rel=1e-9)
    assert 32.5 < projection.terms.damping < 32.5 + 2.0 * 1.5  # the quadratic part, up to 2 rad/s
    assert actuator.effort_limit() == pytest.approx(50.0)
    assert {"coulomb", "delay.command", "deadzone"} <= {loss.effect for loss in projection.losses}


def test_drake_reads_the_sdf():
    knee, _actuator, _plant = in_drake(to_sdf(exported("sdf")), "sdf")
    assert knee.default_damping_vector()[0] > 30.0
    assert "rotor_inertia" in {loss.effect for loss in exported("sdf")[0].losses}


def test_a_urdf_of_the_users(tmp_path):
    mine = tmp_path / "robot.urdf"
    mine.write_text(
        '<?xml version="1.0"?>\n<!-- mine -->\n<robot name="r">\n  <joint name="knee" type="revolute">\n'
        '    <limit effort="1" velocity="2" lower="0" upper="1"/>\n  </joint>\n</robot>\n'
    )
    text = to_urdf(exported("urdf"), mine)
    assert "<!-- mine -->" in text and 'velocity="2"' in text and 'effort="50"' in text
    assert '<dynamics damping="' in text
    with pytest.raises(ParamsError, match=r"robot\.urdf: expected <sdf> at the top, got <robot>"):
        to_sdf(exported("sdf"), mine)


UNDECLARED = """<?xml version="1.0"?>
<robot name="r">
  <gazebo:hint a="1"/> <!-- no prefix is declared -->
  <link name="base"/>
  <link name="shank">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="knee" type="revolute">
    <parent link="base"/><child link="shank"/><axis xyz="0 1 0"/>
    <limit effort="1" velocity="2" lower="0" upper="1"/>
    <dynamics damping="1" friction="1"/>
  </joint>
  <transmission>
    <type>transmission_interface/SimpleTransmission</type>
    <joint name="knee"/>
    <actuator name="m">
      <drake:rotor_inertia value="1"/>
      <drake:gear_ratio value="2"/>
      <drake:controller_gains p="3" d="4"/>
    </actuator>
  </transmission>
</robot>
"""


@pytest.mark.parametrize(
    ("target", "declared", "changed"),
    [
        ("urdf", "", {"limit", "dynamics", "drake:controller_gains"}),
        (
            "drake-urdf",
            "",
            {"robot", "limit", "dynamics", "drake:rotor_inertia", "drake:gear_ratio", "drake:controller_gains"},
        ),
        (
            "drake-urdf",
            ' xmlns:drake="http://example.org"',
            {"limit", "dynamics", "drake:rotor_inertia", "drake:gear_ratio", "drake:controller_gains"},
        ),
    ],
)
def test_a_urdf_whose_prefixes_are_not_declared_keeps_the_rest(tmp_path, target, declared, changed):
    """Drake reads such a file. Its tags are replaced; `xmlns:drake` is added where they are written."""
    mine = tmp_path / "robot.urdf"
    before = UNDECLARED.replace('<robot name="r"', f'<robot name="r"{declared}')
    mine.write_text(before, encoding="utf-8")
    text = to_urdf(exported(target), mine, drake=target == "drake-urdf")
    pairs = list(zip(text.splitlines(), before.splitlines(), strict=True))
    assert {old.split()[0].strip("<>") for new, old in pairs if new != old} == changed
    _knee, actuator, _plant = in_drake(text, "urdf")
    reflected = reflected_inertia(actuator)
    assert reflected == pytest.approx(0.31 if target == "drake-urdf" else 4.0)
    assert actuator.effort_limit() == 50.0
    mine.write_text(text, encoding="utf-8")
    assert read_joints(mine, ParamsError)["knee"].terms.armature == pytest.approx(reflected)


OF_KNEE = "<joint name='knee'/><actuator name='m'/></transmission>"


@pytest.mark.parametrize(
    "beside",
    [
        f"<transmission name='t'><type>x/DifferentialTransmission</type>{OF_KNEE}",
        f"<ros2_control name='c' type='system'><transmission name='t'>{OF_KNEE}</ros2_control>",
    ],
)
def test_a_transmission_that_drake_ignores_is_not_that_of_the_servo(tmp_path, beside):
    mine = tmp_path / "robot.urdf"
    joint = "<joint name='knee' type='continuous'><parent link='a'/><child link='b'/></joint>"
    inertial = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
    mine.write_text(f"<robot name='r'><link name='a'/><link name='b'>{inertial}</link>{joint}{beside}</robot>")
    written = to_urdf(exported("drake-urdf"), mine, drake=True)
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(written, "urdf")
    (index,) = plant.GetJointActuatorIndices()
    actuator = plant.get_joint_actuator(index)
    assert actuator.get_controller_gains().p == 5000.0 and actuator.default_rotor_inertia() == 0.31
    (tmp_path / "written.urdf").write_text(written)
    assert read_joints(tmp_path / "written.urdf", ParamsError)["knee"].terms.armature == 0.31


def test_a_position_servo_of_isaac_lab():
    """The classes are those of isaaclab 3.0.0; fields that they do not have are refused (`isaaclab_stand_in`)."""
    knee = actuators(to_isaaclab(exported("isaaclab")))["knee"]
    assert isinstance(knee, isaaclab_stand_in.DelayedPDActuatorCfg)
    assert knee.stiffness == 5000.0 and knee.damping == 0.0 and knee.armature == 0.31
    assert knee.actuator_effort_limit == 50.0  # an explicit actuator clips its own torque
    terms = exported("isaaclab")[0].terms  # their friction is refitted: Isaac Lab has none that grows quadratically
    assert knee.friction == knee.dynamic_friction == pytest.approx(terms.frictionloss, rel=1e-9)
    assert knee.viscous_friction == pytest.approx(terms.damping, rel=1e-9)
    assert (knee.joint_effort_limit, knee.min_delay, knee.max_delay) == (None, 1, 1)
    (rounded,) = [loss for loss in exported("isaaclab")[0].losses if loss.partly]
    assert rounded == Loss("delay.command", "delays are whole physics steps, 0.005 s in place of 0.004 s", partly=True)
    at_once = ActuatorModel("knee.1", MODEL.drive, tuple(v for v in MODEL.effects if v.key != "delay.command"))
    implicit = actuators(to_isaaclab([project(at_once, TARGETS["isaaclab"])]))["knee.1"]
    assert isinstance(implicit, isaaclab_stand_in.ImplicitActuatorCfg)
    assert (implicit.actuator_effort_limit, implicit.joint_effort_limit) == (None, 50.0)
    (pattern,) = implicit.joint_names_expr
    assert re.fullmatch(pattern, "knee.1") and not re.fullmatch(pattern, "knee_1")


@pytest.mark.parametrize("delay", [0.0, 0.005])
def test_a_limit_of_the_whole_torque_of_a_servo_in_isaac_lab(delay):
    """Both classes of isaaclab 3.0.0 clip stiffness e - damping v as a whole; friction of the joint is outside."""
    limit = EffectValue("saturation.servo", {"limit": 0.01, "derivative_time": 2e-3})
    late = (EffectValue("delay.command", {"delay": delay}),) if delay else ()
    own = (EffectValue("viscous", {"viscous": 12.0}), EffectValue("coulomb", {"coulomb": 1.0}), limit, *late)
    projection = project(ActuatorModel("knee", Drive("position_servo", 2e-4), own), TARGETS["isaaclab"])
    knee = actuators(to_isaaclab([projection]))["knee"]
    assert projection.losses == () and (knee.actuator_effort_limit or knee.joint_effort_limit) == 50.0
    assert (knee.stiffness, knee.damping, knee.viscous_friction) == (5000.0, 10.0, 2.0)


def test_a_drive_on_a_voltage_is_a_dc_motor_of_isaac_lab():
    """DCMotor of isaaclab 3.0.0 clips to saturation_effort (+-1 - v/actuator_velocity_limit), +-actuator_effort_limit.

    The drive gives at most (+-U - kt v) kt/R, also where it brakes.
    """
    values = (EffectValue("viscous", {"viscous": 9.0}), EffectValue("saturation", {"limit": 12.0}))
    model = ActuatorModel("knee", Drive("voltage", 0.25), values)
    knee = actuators(
        to_isaaclab([with_torque_constant(project(model, TARGETS["isaaclab"]), 1.5, TARGETS["isaaclab"])])
    )["knee"]
    assert isinstance(knee, isaaclab_stand_in.DCMotorCfg) and knee.joint_effort_limit is None
    v = np.linspace(-8.0, 8.0, 17)  # up to the speed without load
    for sign in (-1.0, 1.0):
        line = knee.saturation_effort * (sign - v / knee.actuator_velocity_limit)
        clipped = np.clip(line, -knee.actuator_effort_limit, knee.actuator_effort_limit)
        np.testing.assert_allclose(clipped, 4.0 * (sign * 12.0 - 1.5 * v), rtol=1e-9, atol=1e-9)
    assert knee.viscous_friction == pytest.approx(9.0 - 1.5 * 4.0)
    without = actuators(to_isaaclab([project(model, TARGETS["isaaclab"])]))["knee"]
    assert isinstance(without, isaaclab_stand_in.IdealPDActuatorCfg) and without.stiffness == 0.0
    assert without.actuator_effort_limit == 48.0 and without.joint_effort_limit is None


def test_a_delayed_drive_on_a_voltage_has_the_same_torque_without_a_dc_motor():
    """DelayedPDActuator of isaaclab 3.0.0 clips the late effort to +-actuator_effort_limit at every speed."""
    values = [EffectValue("viscous", {"viscous": 9.0}), EffectValue("saturation", {"limit": 12.0})]
    model = ActuatorModel("knee", Drive("voltage", 0.25), (*values, EffectValue("delay.loop", {"delay": 0.01})))
    projection = with_torque_constant(project(model, TARGETS["isaaclab"]), 1.5, TARGETS["isaaclab"])
    knee = actuators(to_isaaclab([projection]))["knee"]
    assert isinstance(knee, isaaclab_stand_in.DelayedPDActuatorCfg) and (knee.min_delay, knee.max_delay) == (2, 2)
    voltage, v = np.meshgrid(np.linspace(-20.0, 20.0, 9), np.linspace(-8.0, 8.0, 17))
    found = np.clip(4.0 * voltage, -knee.actuator_effort_limit, knee.actuator_effort_limit) - knee.viscous_friction * v
    expected = 4.0 * (np.clip(voltage, -12.0, 12.0) - 1.5 * v) - (9.0 - 1.5 * 4.0) * v
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)  # numbers are written with ten digits
    (lost,) = [loss for loss in projection.losses if loss.effect == "torque_constant"]
    assert lost.why.startswith("a delay needs a DelayedPDActuatorCfg, which has no line of torque over speed")


@pytest.mark.parametrize("drive", [Drive("current", 0.5), Drive("voltage", 0.5), Drive("torque", 1.0)])
def test_an_effort_is_limited_by_an_actuator_that_computes_it(drive):
    """ImplicitActuator of isaaclab 3.0.0 passes an effort on as it is: its limit is that of the joint's drive."""
    viscous, limit = EffectValue("viscous", {"viscous": 9.0}), EffectValue("saturation", {"limit": 12.0})
    for effects, kind, bound in (
        ((viscous,), isaaclab_stand_in.ImplicitActuatorCfg, None),
        ((viscous, limit), isaaclab_stand_in.IdealPDActuatorCfg, 12.0 / drive.gain),
        ((viscous, EffectValue("saturation")), isaaclab_stand_in.ImplicitActuatorCfg, None),  # no limit is infinite
    ):
        knee = actuators(to_isaaclab([project(ActuatorModel("knee", drive, effects), TARGETS["isaaclab"])]))["knee"]
        assert type(knee) is kind and (knee.actuator_effort_limit, knee.joint_effort_limit) == (bound, None)


def test_an_error_of_the_drive_gain_is_in_the_drive_gain():
    gain = EffectValue("servo_gain", {"gain_error": -0.2})
    limit, delay = EffectValue("saturation", {"limit": 0.01}), EffectValue("delay.command", {"delay": 0.004})
    alone = project(ActuatorModel("knee", Drive("position_servo", 2e-4), (gain,)), TARGETS["mjcf"])
    assert alone.terms.kp == pytest.approx(4000.0) and alone.losses == ()
    for beside in (limit, delay):
        found = project(ActuatorModel("knee", Drive("position_servo", 2e-4), (gain, beside)), TARGETS["mjcf"])
        assert found.terms.kp == pytest.approx(4000.0)
        assert [(loss.effect, loss.partly) for loss in found.losses] == [("servo_gain", True)]


def test_effects_that_are_listed_twice_act_one_after_the_other():
    effects = [EffectValue("saturation", {"limit": limit}) for limit in (0.01, 0.02)]
    effects += [EffectValue("delay.command", {"delay": 0.003}), EffectValue("delay.command", {"delay": 0.004})]
    effects += [EffectValue("coulomb", {"coulomb": 1.0}), EffectValue("coulomb", {"coulomb": 2.0})]
    terms = project(ActuatorModel("knee", Drive("position_servo", 2e-4), tuple(effects)), TARGETS["mjcf"]).terms
    assert (terms.torque_limit, terms.delay, terms.frictionloss) == pytest.approx((50.0, 0.007, 3.0))


def test_the_inertia_of_a_payload_is_lost_only_in_part():
    payload = EffectValue("payload", {"payload_moment": 5.0, "payload_inertia": 0.4})
    model = ActuatorModel("knee", Drive("torque", 1.0), (payload,))
    for target, armature in (("mjcf", 0.4), ("urdf", 0.0)):
        projection = project(model, TARGETS[target])
        assert projection.terms.armature == armature
        assert [(loss.effect, loss.partly) for loss in projection.losses] == [("payload", armature > 0.0)]


@pytest.mark.parametrize(
    ("target", "drive", "lost"),
    [
        ("mjcf", Drive("current", 0.5), False),
        ("urdf", Drive("position_servo", 2e-4), True),
        ("urdf", Drive("torque", 1.0), False),
        ("sdf", Drive("voltage", 0.5), True),
        ("drake-urdf", Drive("position_servo", 2e-4), False),
        ("drake-urdf", Drive("current", 0.5), True),
        ("isaaclab", Drive("current", 0.5), True),
        ("bam", Drive("voltage", 0.5), False),
    ],
)
def test_a_gain_that_a_file_has_no_place_for_is_lost(target, drive, lost):
    model = ActuatorModel("knee", drive, (EffectValue("viscous", {"viscous": 0.8}),))
    found = [loss.why for loss in project(model, TARGETS[target]).losses if loss.effect == "drive gain"]
    unit = {"position_servo": "5000 N m per rad", "current": "2 N m per A", "voltage": "2 N m per V"}
    assert found == ([f"your controller has to apply {unit[drive.kind]}"] if lost else [])


@pytest.mark.parametrize("drive", [Drive("position_servo", 2e-4), Drive("current", 0.5), Drive("torque", 1.0)])
def test_a_torque_constant_of_a_drive_without_a_voltage_is_said_to_be_unused(drive):
    model = ActuatorModel("knee", drive, (EffectValue("viscous", {"viscous": 0.8}),))
    made = with_torque_constant(project(model, TARGETS["mjcf"]), 1.2, TARGETS["mjcf"])
    assert made.terms.torque_constant is None
    assert ["not a voltage" in loss.why for loss in made.losses if loss.effect == "torque_constant"] == [True]


def test_bam_needs_a_voltage_and_a_torque_constant():
    with pytest.raises(ParamsError, match="BAM's servo is driven by a voltage; knee has drive position_servo"):
        to_bam(exported("bam"))
    model = ActuatorModel("m", Drive("voltage", 2.0), (EffectValue("viscous", {"viscous": 0.8}),))
    projections = [project(model, TARGETS["bam"])]
    with pytest.raises(ParamsError, match="--torque-constant"):
        to_bam(projections)
    found = json.loads(to_bam([with_torque_constant(each, 1.2, TARGETS["bam"]) for each in projections]))
    # the torque for one volt, and all that grows with the speed, are the model's
    assert found["kt"] / found["R"] == pytest.approx(0.5)
    assert found["friction_viscous"] + found["kt"] ** 2 / found["R"] == pytest.approx(0.8)
    with pytest.raises(ParamsError, match="give a smaller one"):
        with_torque_constant(projections[0], 2.0, TARGETS["bam"])


def test_bam_expresses_friction_under_load(tmp_path):
    effects = (
        EffectValue("viscous", {"viscous": 3.0}),
        EffectValue("load_dependent_friction", {"load_friction": 0.12}),
    )
    projection = project(ActuatorModel("m", Drive("voltage", 0.5), effects), TARGETS["bam"])
    assert [(loss.effect, loss.partly) for loss in projection.losses] == [("load_dependent_friction", True)]
    path = tmp_path / "servo.json"
    path.write_text(to_bam([with_torque_constant(projection, 1.2, TARGETS["bam"])]), encoding="utf-8")
    document = json.loads(path.read_text(encoding="utf-8"))
    assert (document["model"], document["load_friction_external"], document["load_friction_motor"]) == ("m5", 0.12, 0.0)
    assert bam_servo(document).effects["load_dependent_friction"] == {"load_friction": 0.12}
    assert bam_servo(document | {"load_friction_motor": 0.1}).effects["load_dependent_friction"] is None


def test_bam_keeps_a_stribeck_peak_while_the_rest_is_refitted():
    peak = EffectValue("stribeck", {"stribeck": 1.0, "stribeck_velocity": 0.2, "stribeck_exponent": 1.5})
    odd = (EffectValue("viscous", {"viscous": 0.8}), EffectValue("quadratic_viscous", {"quadratic_viscous": 0.3}), peak)
    projection = project(ActuatorModel("m", Drive("voltage", 2.0), odd), TARGETS["bam"])
    assert projection.refit is not None and projection.refit.effects == ("quadratic_viscous",)
    found = json.loads(to_bam([with_torque_constant(projection, 0.1, TARGETS["bam"])]))
    assert (found["model"], found["friction_stribeck"], found["dtheta_stribeck"], found["alpha"]) == (
        "m2",
        1.0,
        0.2,
        1.5,
    )
    # the quadratic part alone: least squares of 0.3 v^2 over 0..2 rad/s by a + b v with a, b >= 0 is b v, b = 0.45
    assert projection.terms.damping == pytest.approx(0.8 + 0.3 * 1.5, rel=1e-2)


def test_the_command(tmp_path, capsys):
    path, out = tmp_path / "model.yaml", tmp_path / "out.xml"
    save_models({"knee": MODEL}, path)
    assert run(["export", str(path), "--to", "mjcf", "--out", str(out), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["joints"]["knee"]["terms"]["damping"] == 32.5 and document["file"] == str(out)
    assert [loss["effect"] for loss in document["joints"]["knee"]["losses"]] == ["deadzone"]
    assert run(["export", str(path), "--to", "urdf"]) == 0
    printed = capsys.readouterr()
    assert (
        printed.out.startswith("<?xml")
        and "URDF has no dead zone of the drive: the target's servo reacts to the smallest error" in printed.err
    )
    servo = ActuatorModel("m", Drive("voltage", 2.0), (EffectValue("viscous", {"viscous": 0.8}),))
    save_models({"m": servo}, tmp_path / "servo.yaml")
    file, mine = str(tmp_path / "servo.json"), tmp_path / "mine.json"
    mine.write_text('{"actuator": "mx106"}')
    call = ["export", str(tmp_path / "servo.yaml"), "--to", "bam", "--torque-constant", "1.2", "--out", file]
    for into, told in (([], True), (["--into", str(mine)], False)):
        assert run([*call, *into]) == 0
        assert ("add it, or give --into" in capsys.readouterr().out) is told
    assert json.loads((tmp_path / "servo.json").read_text())["actuator"] == "mx106"
    assert run(["export", str(path), "--to", "urdf", "--joint", "hip"]) == 2
    assert "no joint 'hip'; joints: knee" in capsys.readouterr().err
    assert run(["export", str(path), "--to", "urdf", "--out", str(path), "--force"]) == 2
    assert yaml.safe_load(path.read_text())["joints"]["knee"]


@pytest.mark.parametrize("to", ["isaaclab", "isaaclab-bam", "mjlab"])
def test_nothing_is_merged_into_a_program(tmp_path, capsys, to):
    save_models({"knee": MODEL}, tmp_path / "model.yaml")
    assert run(["export", str(tmp_path / "model.yaml"), "--to", to, "--into", str(tmp_path / "robot.py")]) == 2
    assert "configuration is a program; write a file and import ACTUATORS" in capsys.readouterr().err


def test_a_written_file_that_drake_refuses_is_named(tmp_path, capsys):
    save_models({"knee": MODEL}, tmp_path / "model.yaml")
    text = UNDECLARED.replace("<type>transmission_interface/SimpleTransmission</type>", "")
    (tmp_path / "mine.urdf").write_text(text, encoding="utf-8")
    command = ["export", str(tmp_path / "model.yaml"), "--to", "drake-urdf", "--into", str(tmp_path / "mine.urdf")]
    assert run(command) == 0
    told = capsys.readouterr().err
    assert "The written file cannot be loaded: Drake refuses the file:" in told and "missing a type" in told


def test_a_joint_of_an_included_model_is_not_written_into_the_world(tmp_path):
    world = tmp_path / "world.sdf"
    include = "<include><uri>arm.sdf</uri></include>"
    world.write_text(f'<sdf version="1.9"><world name="w">{include}</world></sdf>', encoding="utf-8")
    with pytest.raises(ParamsError, match=r"joints: none; it includes arm\.sdf: name the file of the model itself"):
        to_sdf(exported("sdf"), world)
