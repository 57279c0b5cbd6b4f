"""What Drake's parser takes from a URDF or SDF file without its own tags, and the runs of such exports."""

import json
import logging
import re
from functools import partial

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.recorded_run import Link
from drake_tc.cli.main import run as drake_tc
from drake_tc.exchange.drake_run import simulate_file_in_drake, simulate_in_drake, simulate_plain_in_drake
from drake_tc.exchange.projection import TARGETS, project
from drake_tc.exchange.target_run import RunInput, WrittenFile
from drake_tc.exchange.trial import changes, try_export
from drake_tc.exchange.urdf import to_sdf, to_urdf
from drake_tc.simulator_files.terms import Terms

from .test_target_runs import COULOMB, SERVO, T, alone, command_into_the_users_file, recorded

INERTIA = 0.3
URDF = """<robot name="r">
  <link name="base"/>
  <link name="rotor">
    <inertial><mass value="1e-3"/><inertia ixx="0.3" iyy="0.3" izz="0.3" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="joint" type="continuous">
    <parent link="base"/><child link="rotor"/><axis xyz="0 1 0"/><limit effort="0.6" velocity="9"/>{dynamics}
  </joint>
  <transmission name="t">
    <type>transmission_interface/SimpleTransmission</type><joint name="joint"/><actuator name="joint"/>
  </transmission>
</robot>
"""
SDF = """<sdf version="1.9">
  <model name="r">
    <link name="base"/>
    <link name="rotor">
      <inertial><mass>1e-3</mass><inertia><ixx>0.3</ixx><iyy>0.3</iyy><izz>0.3</izz></inertia></inertial>
    </link>
    <joint name="joint" type="revolute">
      <parent>base</parent><child>rotor</child>
      <axis><xyz>0 1 0</xyz><limit><effort>0.6</effort></limit>{dynamics}</axis>
    </joint>
  </model>
</sdf>
"""
DYNAMICS = {
    "urdf": '<dynamics damping="{damping}" friction="{friction}"/>',
    "sdf": "<dynamics><damping>{damping}</damping><friction>{friction}</friction></dynamics>",
}
FORMATS = pytest.mark.parametrize("kind", ["urdf", "sdf"])
PLAIN = [partial(simulate_plain_in_drake, write) for write in (to_urdf, to_sdf)]
BOTH = pytest.mark.parametrize("simulate", PLAIN, ids=["urdf", "sdf"])
PENDULUM = Link(0.4, 9.0, 0.3)


def drakes(kind: str, damping: float, friction: float) -> MultibodyPlant:
    plant = MultibodyPlant(1e-4)
    text = {"urdf": URDF, "sdf": SDF}[kind].format(dynamics=DYNAMICS[kind].format(damping=damping, friction=friction))
    Parser(plant).AddModelsFromString(text, kind)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    return plant


@FORMATS
@pytest.mark.parametrize("damping", [0.0, 0.6])
@pytest.mark.parametrize("friction", [0.0, 2.0])
def test_drake_takes_the_damping_of_a_joint_and_not_its_friction(kind, damping, friction):
    """Friction of 2 N m would stop 0.3 kg m^2 from 1 rad/s within 0.15 s."""
    plant = drakes(kind, damping, friction)
    simulator = Simulator(plant)
    plant.SetVelocities(simulator.get_mutable_context(), np.ones(1))
    simulator.AdvanceTo(0.5)
    (velocity,) = plant.GetVelocities(simulator.get_context())
    assert velocity == pytest.approx(np.exp(-damping * 0.5 / INERTIA), rel=1e-4)  # the first-order rule of 0.1 ms


@FORMATS
def test_drake_warns_of_friction_in_a_urdf_alone(kind, caplog):
    with caplog.at_level(logging.WARNING, "drake"):
        drakes(kind, 0.6, 2.0)
    assert any("friction" in record.getMessage() for record in caplog.records) is (kind == "urdf")


def test_drake_makes_no_actuator_of_a_urdf_joint_without_a_transmission():
    plant = MultibodyPlant(1e-4)
    Parser(plant).AddModelsFromString(
        re.sub("<transmission.*</transmission>", "", URDF, flags=re.S).format(dynamics=""), "urdf"
    )
    assert plant.num_actuators() == 0


@FORMATS
def test_drake_has_no_rotor_inertia_and_no_servo_in_a_plain_file(kind):
    plant = drakes(kind, 0.6, 2.0)
    (index,) = plant.GetJointActuatorIndices()
    actuator = plant.get_joint_actuator(index)
    assert actuator.default_rotor_inertia() == 0.0 and not actuator.has_controller()
    assert actuator.effort_limit() == 0.6


@BOTH
def test_friction_in_the_file_is_not_in_the_run_and_drake_does_not_warn(simulate, caplog):
    started = alone(start=(0.31, 1.0))
    with caplog.at_level(logging.WARNING, "drake"):
        without, stuck = (
            simulate(Terms("torque", 1.0, damping=0.2, frictionloss=loss), PENDULUM, started) for loss in (0.0, 50.0)
        )
    np.testing.assert_array_equal(stuck, without)
    assert not caplog.records and not np.isnan(stuck).any()


@BOTH
def test_with_the_inertia_of_drakes_tags_the_run_is_that_of_such_a_file(simulate):
    terms = Terms("position_servo", 500.0, armature=0.3, damping=20.0)
    given = alone(0.3 * np.sin(4.0 * T))
    np.testing.assert_allclose(
        simulate(terms, PENDULUM, given), simulate_in_drake(terms, PENDULUM, given), rtol=0, atol=1e-9
    )


@BOTH
def test_a_joint_without_inertia_and_damping_is_unstable(simulate):
    assert np.isnan(simulate(Terms("torque", 1.0), None, alone(np.ones(T.size)))[-1])


def test_the_error_is_that_of_what_the_format_lacks():
    """The rotor of 0.3 kg m^2, then the dry friction too, which the format has and Drake does not use."""
    errors = []
    for effects in (SERVO, (*SERVO, COULOMB)):
        model = ActuatorModel("joint", Drive("position_servo", 2e-3), effects)
        assert {loss.effect for loss in project(model, TARGETS["sdf"]).losses} == {"drive gain", "rotor_inertia"}
        rig, run = recorded(model)
        trial = try_export({"joint": model}, "model_after.yaml", "sdf", rig, ([run], [run]), None)
        (row,) = trial.rows
        errors.append(row.export)
        assert row.export > 5.0 * row.model and row.original is None and trial.runner == "Drake's plant"
        assert any("the run of the export has no inertia" in loss for loss in trial.losses)
        ignored = "joint: Drake's parser does not use the friction of a joint: the runs are without it."
        assert (ignored in trial.losses) is (COULOMB in effects)
    assert errors[1] > 1.3 * errors[0]


@pytest.mark.slow
def test_the_command_runs_the_export_beside_the_users_own_file(tmp_path, capsys):
    """The rotor inertia in Drake's tags of the user's file stays as it is."""
    command = [*command_into_the_users_file(tmp_path, capsys, "urdf"), "--force", "--json"]
    assert drake_tc(command) == 0
    document = json.loads(capsys.readouterr().out)
    (light,) = document["free_runs"]
    assert light["original"] > 3.0 * light["export"] > 9.0 * light["model"]
    assert any("has no inertia" in note for note in document["notes"])
    assert "has no inertia" in (tmp_path / "export.html").read_text(encoding="utf-8")

    mine, place = tmp_path / "mine.urdf", '<actuator name="joint"/>'
    tags = '<actuator name="joint"><drake:rotor_inertia value="3e-3"/><drake:gear_ratio value="10"/></actuator>'
    text = mine.read_text(encoding="utf-8").replace("<robot ", '<robot xmlns:drake="http://drake.mit.edu" ', 1)
    assert place in text
    mine.write_text(text.replace(place, tags, 1), encoding="utf-8")
    assert drake_tc(command) == 0
    document = json.loads(capsys.readouterr().out)
    (geared,) = document["free_runs"]
    assert geared["original"] > 3.0 * geared["export"] and geared["export"] < 0.5 * light["export"]
    assert not any("has no inertia" in note for note in document["notes"])


def test_the_damping_of_a_servo_stands_once_in_a_urdf_with_drakes_tags():
    """The part that the servo has is its gain D; the joint has the rest."""
    limit = EffectValue("saturation.servo", {"limit": 0.02, "derivative_time": 1e-3})
    model = ActuatorModel("joint", Drive("position_servo", 2e-4), (EffectValue("viscous", {"viscous": 40.0}), limit))
    projections = [project(model, TARGETS["drake-urdf"])]
    plant = MultibodyPlant(1e-4)
    Parser(plant).AddModelsFromString(to_urdf(projections, drake=True), "urdf")
    gains = plant.GetJointActuatorByName("joint").get_controller_gains()
    assert gains.d == pytest.approx(5.0)
    assert plant.GetJointByName("joint").default_damping_vector()[0] + gains.d == pytest.approx(40.0)


def test_a_servo_of_the_file_goes_where_the_models_drive_is_none(tmp_path):
    """The written file then moves by the torque alone, and the sentence says so."""
    gains = '<drake:controller_gains p="9" d="2"/>'
    texts = {
        "urdf": URDF.replace('<actuator name="joint"/>', f'<actuator name="joint">{gains}</actuator>'),
        "sdf": SDF.replace("{dynamics}</axis>", f"</axis>{gains}"),
    }
    model = ActuatorModel("joint", Drive("current", 0.5), (EffectValue("viscous", {"viscous": 4.0}),))
    for kind, write in (("urdf", to_urdf), ("sdf", to_sdf)):
        path, projections = tmp_path / f"mine.{kind}", [project(model, TARGETS[kind])]
        path.write_text(texts[kind].format(dynamics=""), encoding="utf-8")
        written = write(projections, path)
        assert "controller_gains" not in written
        assert any("removed from your file" in told for told in changes(written, projections, path))


@FORMATS
def test_a_joint_moves_alike_whether_other_joints_of_the_file_are_driven(kind):
    """Drake's port of the desired state has a place for each actuator of the model, with gains or without."""
    other = {
        "urdf": URDF.split("<link", 2)[2]
        .replace('"joint"', '"other"')
        .replace('"rotor"', '"rotor2"')
        .replace('"t"', '"u"'),
        "sdf": SDF.split('<link name="base"/>')[1].replace('"joint"', '"other"').replace("rotor", "rotor2"),
    }[kind]
    other = f"<link{other}" if kind == "urdf" else other
    alone_text = {"urdf": URDF, "sdf": SDF}[kind].format(dynamics="")
    both = alone_text.replace("</robot>", other.format(dynamics=""))
    if kind == "sdf":
        both = alone_text.replace("</model>\n</sdf>\n", other.format(dynamics=""))
    given = RunInput(0.3 * np.sin(6.0 * T[:300]), np.zeros(300), (0.0, 0.0), 1e-3)
    runs = [
        simulate_file_in_drake(WrittenFile(text, "joint", servo=(2.0, 0.0)), None, given) for text in (alone_text, both)
    ]
    np.testing.assert_allclose(runs[1], runs[0], atol=1e-12)
    assert np.ptp(runs[0]) > 0.01


@FORMATS
def test_a_limit_of_0_does_not_cost_the_servo_its_actuator(tmp_path, kind):
    """Tools that export robots write 0 where they know none."""
    gains = '<drake:controller_gains p="9" d="2"/>'
    text = {"urdf": URDF, "sdf": SDF.replace("{dynamics}</axis>", f"</axis>{gains}")}[kind]
    path = tmp_path / f"mine.{kind}"
    path.write_text(text.format(dynamics="").replace("0.6", "0"), encoding="utf-8")
    model = ActuatorModel("joint", Drive("position_servo", 0.5), (EffectValue("viscous", {"viscous": 4.0}),))
    projections = [project(model, TARGETS["drake-urdf" if kind == "urdf" else "sdf"])]
    written = to_urdf(projections, path, drake=True) if kind == "urdf" else to_sdf(projections, path)
    plant = MultibodyPlant(1e-3)
    Parser(plant).AddModelsFromString(written, kind)
    assert plant.GetJointActuatorByName("joint").get_controller_gains().p == pytest.approx(2.0)
