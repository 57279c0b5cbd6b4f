"""The export says what its numbers belong to: a model whose torques are not in N m, and links that were fitted too."""

import json

import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import TORQUE_AS_EFFORT, ModelFile, load_model_file, save_models
from drake_tc.cli.main import run as drake_tc

MODELS = {
    name: ActuatorModel(name, Drive("current", 1.0), (EffectValue("viscous", {"viscous": 0.3}),))
    for name in ("hip", "knee")
}


@pytest.mark.parametrize("named", [["knee"], []])
def test_the_command_says_which_joints_are_not_in_newton_metres(tmp_path, capsys, named):
    save_models(MODELS, tmp_path / "model.yaml", provenance={TORQUE_AS_EFFORT: named})
    assert load_model_file(tmp_path / "model.yaml").torque_as_effort == tuple(named)
    command = ["export", str(tmp_path / "model.yaml"), "--to", "urdf", "--out", str(tmp_path / "out.urdf"), "--force"]
    assert drake_tc([*command, "--json"]) == 0
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert [note.partition(":")[0] for note in notes] == named
    assert all("not in N m but in the unit of the effort (A)" in note and "drive_gain" in note for note in notes)
    assert drake_tc(command) == 0
    assert all(note in capsys.readouterr().out.splitlines() for note in notes)


@pytest.mark.parametrize("links", [None, {"thigh": {"m": 4.0, "mx": 0.1}, "shin": {"m": 1.5}}])
def test_fitted_links_that_are_not_written_are_pointed_out(tmp_path, capsys, links):
    ModelFile(MODELS, links=links or {}).save(tmp_path / "model.yaml")
    assert load_model_file(tmp_path / "model.yaml").links == (links or {})
    command = ["export", str(tmp_path / "model.yaml"), "--to", "urdf", "--out", str(tmp_path / "out.urdf"), "--json"]
    assert drake_tc(command) == 0
    told = [note for note in json.loads(capsys.readouterr().out)["notes"] if "are not written" in note]
    assert [note.partition(" are not")[0] for note in told] == (
        ["thigh: its fitted inertial parameters", "shin: its fitted inertial parameters"] if links else []
    )
