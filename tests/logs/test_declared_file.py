"""A rig takes what it declares from a file of another simulator; an export of a model gives its parameters back."""

import pytest
import yaml

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.effects.library import effect
from drake_tc.errors import RigError
from drake_tc.exchange.bam import to_bam
from drake_tc.exchange.mjcf import to_mjcf, with_torque_constant
from drake_tc.exchange.projection import TARGETS, project
from drake_tc.exchange.urdf import to_urdf
from drake_tc.logs.rig import load_rig, parse_rig, save_rig
from drake_tc.logs.rig_document.declared import LEAST_CYCLES, declared_terms, with_declared_file

GAIN = 2e-4
MODEL = ActuatorModel(
    "knee",
    Drive("position_servo", GAIN),
    (
        EffectValue("rotor_inertia", {"rotor_inertia": 0.31}),
        EffectValue("viscous", {"viscous": 32.5}),
        EffectValue("coulomb", {"coulomb": 6.25}),
        EffectValue("quadratic_viscous", {"quadratic_viscous": 1.5}),
        EffectValue("saturation", {"limit": 0.01}),
        EffectValue("delay.command", {"delay": 0.004}),
        EffectValue("backlash", {"backlash": 0.002}),
    ),
)
RIG = {"joint": "knee", "drive": "position_servo", "load": "torque"}


def exported(tmp_path, target, model=MODEL):
    writers = {
        "mjcf": (to_mjcf, "bench.xml"),
        "urdf": (to_urdf, "bench.urdf"),
        "drake-urdf": (lambda p: to_urdf(p, drake=True), "bench.urdf"),
        "bam": (lambda p: to_bam([with_torque_constant(each, 0.5, TARGETS["bam"]) for each in p]), "bench.json"),
    }
    write, name = writers[target]
    path = tmp_path / name
    path.write_text(write([project(model, TARGETS[target])]), encoding="utf-8")
    return path


def rig_file(folder, **more):
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(RIG | more), encoding="utf-8")
    return path


def test_a_model_in_mjcf_gives_its_parameters_back(tmp_path):
    rig = with_declared_file(parse_rig(RIG), exported(tmp_path, "mjcf"))
    declared = dict(rig.declared["knee"])
    wanted = {value.effect.id: next(iter(value.parameters.values())) for value in MODEL.effects}
    assert rig.saturation["knee"] == pytest.approx(wanted["saturation"], rel=1e-9)
    assert rig.drive_gain["knee"] == pytest.approx(GAIN, rel=1e-9)
    assert set(declared) == set(wanted)
    for name, value in wanted.items():
        assert declared[name] == pytest.approx(value, rel=1e-8), name  # ten digits in the file; delay 1 - 1e-9


@pytest.mark.parametrize(("drive", "gain"), [("voltage", 0.5), ("torque", 1.0)])
def test_drives_in_mjcf_give_their_parameters_back(tmp_path, drive, gain):
    """A drive on a voltage is a dcmotor, where its torque constant is known."""
    model = ActuatorModel("knee", Drive(drive, gain), MODEL.effects)
    path = tmp_path / "bench.xml"
    path.write_text(
        to_mjcf([with_torque_constant(project(model, TARGETS["mjcf"]), 1.5, TARGETS["mjcf"])]), encoding="utf-8"
    )
    rig = with_declared_file(parse_rig(RIG | {"drive": drive}), path)
    assert rig.drive_gain["knee"] == pytest.approx(gain, rel=1e-9)
    assert rig.saturation["knee"] == pytest.approx(0.01, rel=1e-9)
    expected = {v.effect.id: next(iter(v.parameters.values())) for v in MODEL.effects}
    assert dict(rig.declared["knee"]) == {name: pytest.approx(value, rel=1e-8) for name, value in expected.items()}


def test_a_model_in_a_urdf_for_drake_gives_inertia_and_servo_back(tmp_path):
    rig = with_declared_file(parse_rig(RIG), exported(tmp_path, "drake-urdf"))
    assert rig.declared["knee"]["rotor_inertia"] == pytest.approx(0.31, rel=1e-9)
    assert rig.drive_gain["knee"] == pytest.approx(GAIN, rel=1e-9)
    assert "quadratic_viscous" not in rig.declared["knee"] and rig.declared["knee"]["coulomb"] is None


def test_a_plain_urdf_declares_friction_alone(tmp_path):
    rig = with_declared_file(parse_rig(RIG), exported(tmp_path, "urdf"))
    assert set(rig.declared["knee"]) == {"viscous", "coulomb"} and not rig.drive_gain
    terms = project(MODEL, TARGETS["urdf"]).terms  # the quadratic part was refitted
    assert rig.declared["knee"]["coulomb"] == pytest.approx(terms.frictionloss, rel=1e-9)
    assert rig.declared["knee"]["viscous"] == pytest.approx(terms.damping, rel=1e-9)


def test_a_servo_in_bams_file_gives_its_parameters_back(tmp_path):
    kept = ("rotor_inertia", "viscous", "coulomb", "delay")
    effects = tuple(value for value in MODEL.effects if value.effect.id in kept)
    peak = EffectValue("stribeck", {"stribeck": 1.0, "stribeck_velocity": 0.2, "stribeck_exponent": 1.5})
    model = ActuatorModel("knee", Drive("voltage", 0.5), (*effects, peak))
    projection = project(model, TARGETS["bam"])
    assert [(loss.effect, loss.partly) for loss in projection.losses] == [("delay.command", True)]  # BAM delays q_d
    assert projection.refit is None
    rig = with_declared_file(parse_rig(RIG | {"drive": "voltage"}), exported(tmp_path, "bam", model))
    assert rig.drive_gain["knee"] == pytest.approx(0.5, rel=1e-9)
    declared = dict(rig.declared["knee"])
    assert declared.pop("stribeck") is None  # its values stand beside it
    assert declared == {
        "rotor_inertia": pytest.approx(0.31, rel=1e-9),
        "viscous": pytest.approx(32.5, rel=1e-9),
        "coulomb": pytest.approx(6.25, rel=1e-9),
        "delay": pytest.approx(0.004, rel=1e-9),
        "stribeck.stribeck": pytest.approx(1.0, rel=1e-9),
        "stribeck.stribeck_velocity": pytest.approx(0.2, rel=1e-9),
        "stribeck.stribeck_exponent": pytest.approx(1.5, rel=1e-9),
    }


def test_a_rig_file_names_the_file(tmp_path):
    exported(tmp_path, "mjcf")
    rig = load_rig(rig_file(tmp_path, declared="bench.xml", drive_gain=3e-4))
    assert rig.declared["knee"]["rotor_inertia"] == pytest.approx(0.31)
    assert rig.drive_gain["knee"] == 3e-4  # what the rig says itself stays
    assert load_rig(save_rig(rig, tmp_path / "again.yaml")).declared == rig.declared


def test_joints_name_files_of_their_own(tmp_path):
    exported(tmp_path, "mjcf")
    document = {"joints": ["knee", "hip"], "drive": "position_servo", "load": "torque"}
    path = tmp_path / "rig.yaml"
    path.write_text(
        yaml.safe_dump(document | {"declared": {"knee": "bench.xml", "hip": ["stribeck"]}}), encoding="utf-8"
    )
    rig = load_rig(path)
    assert rig.declared["hip"] == {"viscous": None, "coulomb": None, "stribeck": None}
    assert rig.declared["knee"]["rotor_inertia"] == pytest.approx(0.31)
    path.write_text(yaml.safe_dump(document | {"declared": "bench.xml"}), encoding="utf-8")
    with pytest.raises(RigError, match=r"bench\.xml: it has no joint hip; its joints: knee"):
        load_rig(path)


def test_the_command_line_takes_the_joints_that_the_file_has(tmp_path):
    path = exported(tmp_path, "mjcf")
    rig = parse_rig({"joints": ["knee", "hip"], "drive": "position_servo", "load": "torque"})
    assert [each.joint for each in declared_terms(rig, path)] == ["knee"]
    with pytest.raises(RigError, match="it has no joint ankle"):
        declared_terms(parse_rig(RIG | {"joint": "ankle"}), path)


def test_what_is_taken_is_told_in_one_line(tmp_path):
    rig = parse_rig(RIG | {"drive": "current"})
    (found,) = declared_terms(rig, exported(tmp_path, "mjcf"))
    assert found.line("current") == (
        "knee: declared: rotor_inertia 0.31 kg m^2, viscous 32.5 N m s/rad, coulomb 6.25 N m,"
        " quadratic_viscous 1.5 N m s^2/rad^2, delay 0.004 s, backlash 0.002 rad; not used: its drive (position_servo),"
        " its limit of the torque (50 N m)"
    )


@pytest.mark.parametrize("name", ["joint.xacro", "joint.urdf.xacro", "joint.urdf"])
@pytest.mark.parametrize(
    "text",
    [
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="a"/></robot>',
        '<robot name="r" xmlns:x="http://ros.org/wiki/xacro"><x:arg name="a"/></robot>',
        '<robot name="r"><xacro:arg name="a"/></robot>',
    ],
)
def test_a_xacro_file_that_is_not_expanded_is_refused_in_words(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(RigError, match=r"got a xacro file that is not expanded; `xacro FILE\.xacro > FILE\.urdf`"):
        load_rig(rig_file(tmp_path, declared=name))


@pytest.mark.parametrize("name", ["gone.urdf", "a\0.urdf"])
def test_a_file_that_is_not_there_is_refused(tmp_path, name):
    expected = "no such file; expected a URDF, an SDFormat file, an MJCF or a parameter file of BAM"
    with pytest.raises(RigError, match=expected):
        load_rig(rig_file(tmp_path, declared=name))


def test_a_rig_file_that_names_a_file_says_what_was_taken_and_what_not(tmp_path):
    exported(tmp_path, "mjcf")
    (line,) = load_rig(rig_file(tmp_path, declared="bench.xml", drive="current")).declared_by_files
    assert "bench.xml: knee: declared: rotor_inertia 0.31" in line and "not used: its drive (position_servo)" in line


@pytest.mark.parametrize(
    ("effect", "expected"),
    [
        (EffectValue("cable_spring", {"spring_stiffness": 12.0, "spring_preload": -3.0}), None),
        (EffectValue("torque_ripple", {"ripple_cosine": 0.5, "ripple_sine": -0.7, "cycles_per_turn": 9.0}), None),
        (EffectValue("servo_integrator", {"integral_rate": 2.5}), {"servo_integrator": 2.5}),
        (EffectValue("current_lag.command", {"lag": 0.03}), {"current_lag.command": 0.03}),
        (EffectValue("elasticity", {"compliance": 1e-4}), {"elasticity": 1e-4}),
    ],
    ids=lambda each: each.key if isinstance(each, EffectValue) else "",
)
def test_effects_in_mjcf_come_back(tmp_path, effect, expected):
    """Written, read and declared with the same numbers."""
    rest = tuple(each for each in MODEL.effects if each.effect.id not in ("saturation", "delay", "backlash"))
    model = ActuatorModel("knee", MODEL.drive, (*rest, effect))
    rig = with_declared_file(parse_rig(RIG), exported(tmp_path, "mjcf", model))
    expected = expected or {f"{effect.key}.{name}": value for name, value in effect.parameters.items()}
    for name, value in expected.items():
        assert rig.declared["knee"][name] == pytest.approx(value, rel=1e-8), name


def test_a_ripple_that_the_library_does_not_have_is_listed(tmp_path):
    path = tmp_path / "slow.xml"
    path.write_text(
        "<mujoco><worldbody><body><joint name='j'/></body></worldbody><actuator><dcmotor joint='j' motorconst='0.1'"
        " resistance='2' cogging='0.1 1 0'/></actuator></mujoco>",
        encoding="utf-8",
    )
    (found,) = declared_terms(parse_rig({"joint": "j", "drive": "voltage", "load": "unknown"}), path)
    assert "torque_ripple" not in found.declared
    assert any("a torque ripple of 1 cycles per turn" in each for each in found.unused)
    assert next(p for p in effect("torque_ripple").parameters if p.name == "cycles_per_turn").lower == LEAST_CYCLES


def test_a_limit_of_a_servo_with_damping_is_that_of_the_whole(tmp_path):
    limited = EffectValue("saturation.servo", {"limit": 0.01, "derivative_time": 2e-3})
    model = ActuatorModel("knee", MODEL.drive, (*MODEL.effects[:3], limited))
    rig = with_declared_file(parse_rig(RIG), exported(tmp_path, "mjcf", model))
    declared = rig.declared["knee"]
    assert declared["saturation.servo.limit"] == pytest.approx(0.01, rel=1e-8)
    assert declared["saturation.servo.derivative_time"] == pytest.approx(2e-3, rel=1e-8)
    assert declared["viscous"] + rig.derivative_gain["knee"] == pytest.approx(32.5, rel=1e-8)
    again = load_rig(save_rig(rig, tmp_path / "again.yaml"))
    assert again.declared == rig.declared
    stated = parse_rig(RIG | {"saturation": 0.01, "proportional_gain": 5000.0, "derivative_gain": 10.0})
    assert stated.declared["knee"]["saturation.servo.derivative_time"] == pytest.approx(2e-3)


def test_a_negative_term_is_listed_and_not_declared(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(
        "<robot><joint name='a' type='continuous'><dynamics damping='-0.1' friction='0.2'/></joint></robot>"
    )
    (terms,) = declared_terms(parse_rig({"joint": "a", "drive": "torque"}), path)
    assert terms.declared == {"coulomb": 0.2} and terms.unused == ("its negative viscous (-0.1)",)


SLIDE = (
    '<mujoco><worldbody><body><joint name="knee" type="{}" armature="3"/><geom size="1"/></body></worldbody></mujoco>',
    '<robot name="r"><joint name="knee" type="{}"><dynamics damping="3"/></joint></robot>',
    '<sdf version="1.9"><model name="m"><joint name="knee" type="{}"/></model></sdf>',
)


@pytest.mark.parametrize("text", SLIDE)
def test_a_joint_that_slides_in_the_file_and_turns_in_the_rig_is_refused(tmp_path, text):
    """3 kg are not 3 kg m^2."""
    path = tmp_path / "robot.xml"
    path.write_text(text.format("slide" if "mujoco" in text else "prismatic"))
    with pytest.raises(
        RigError, match="joint 'knee' is prismatic, but revolute in the rig file; state joint_type: pris"
    ):
        declared_terms(parse_rig(RIG), path)
    assert declared_terms(parse_rig(RIG | {"units": {"position": "mm"}}), path)
    path.write_text(text.format("hinge" if "mujoco" in text else "revolute"))
    with pytest.raises(RigError, match="joint 'knee' is revolute, but prismatic in the rig file"):
        declared_terms(parse_rig(RIG | {"joint_type": "prismatic"}), path)
