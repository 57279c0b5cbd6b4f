"""Exports of a joint that slides."""

import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import load_models, save_models
from drake_tc.cli.export_command import Target, _document
from drake_tc.diagnosis.result.applications import ExportErrors
from drake_tc.errors import ParamsError
from drake_tc.exchange.actuator_configs import to_isaaclab
from drake_tc.exchange.mjcf import to_mjcf
from drake_tc.exchange.projection import TARGETS, project
from drake_tc.exchange.trial import sentences
from drake_tc.exchange.urdf import to_sdf, to_urdf

STRIBECK = {"stribeck": 20.0, "stribeck_velocity": 0.01, "stribeck_exponent": 2.0}
AXIS = ActuatorModel(
    "z",
    Drive("current", 0.01),
    (EffectValue("coulomb", {"coulomb": 25.0}), EffectValue("stribeck", STRIBECK)),
    "prismatic",
)


def projected(target):
    return [project(AXIS, TARGETS[target])]


def test_a_bench_has_a_sliding_joint():
    assert '<joint name="z" type="slide" axis="1 0 0"' in to_mjcf(projected("mjcf"))
    assert '<joint name="z" type="prismatic">' in to_urdf(projected("urdf"))
    assert '<joint name="z" type="prismatic">' in to_sdf(projected("sdf"))


def test_what_is_lost_is_told_in_newtons_and_metres():
    said = " ".join(sentences(projected("urdf"), TARGETS["urdf"]))
    assert "m/s; the RMS error of the friction torque" in said and "100 N per A" in said
    assert "N m" not in said and "rad" not in said
    assert "# efforts are forces: 100 N for one unit" in to_isaaclab(projected("isaaclab"))


URDF = """<robot name="r"><link name="a"/><link name="b"/><joint name="z" type="{}"><parent link="a"/><child link="b"/>
<limit effort="1" velocity="1" lower="-1" upper="1"/></joint></robot>"""
SDF = '<sdf version="1.9"><model name="m"><joint name="z" type="{}"><axis/></joint></model></sdf>'
MJCF = '<mujoco>{}<worldbody><body><joint name="z"{}/></body></worldbody></mujoco>'
SLIDES = '<default><joint type="slide"/></default>'


@pytest.mark.parametrize(
    ("target", "write", "turns", "is_said", "slides", "has"),
    [
        ("urdf", to_urdf, URDF.format("revolute"), "is revolute", URDF.format("prismatic"), "<dynamics "),
        ("sdf", to_sdf, SDF.format("revolute"), "is revolute", SDF.format("prismatic"), "<friction>"),
        ("mjcf", to_mjcf, MJCF.format("", ' type="hinge"'), "is a hinge", MJCF.format(SLIDES, ""), 'gear="100"'),
        ("mjcf", to_mjcf, MJCF.format("", ""), "is a hinge", MJCF.format(SLIDES, ""), 'joint="z" gear="100"'),
    ],
)
def test_a_file_in_which_the_joint_turns_is_refused(tmp_path, target, write, turns, is_said, slides, has):
    """A joint of MuJoCo without a type is a hinge, unless a class of defaults states another one."""
    own = tmp_path / "own.xml"
    own.write_text(turns)
    with pytest.raises(ParamsError, match=f"joint 'z' {is_said}; the model has a (prismatic|slide)"):
        write(projected(target), own)
    own.write_text(slides)
    assert has in write(projected(target), own)


def test_free_runs_of_an_export_are_told_in_metres():
    errors = [ExportErrors("z", "held", 1e-3, 2e-3, None)]
    (row,) = _document(Target.mjcf, projected("mjcf"), errors, None)["free_runs"]
    assert row["unit"] == "m"


def test_a_model_file_keeps_the_type(tmp_path):
    save_models({"z": AXIS}, tmp_path / "z.yaml")
    assert load_models(tmp_path / "z.yaml")["z"] == AXIS
