"""`drake-tc estimate-torque --links`: torques of links that close-loop fitted, against Drake's of the true arm."""

import numpy as np
import pandas as pd
import pytest
import yaml
from fitted_arm import JOINTS, URDF, record, rig_file, torques
from robot_files import write_robot

from drake_tc.cli.main import run
from drake_tc.robot.rigid_regressor import LINK_PARAMETERS, link_model
from drake_tc.robot.robot import load_robot

HEAVIER = URDF.replace('mass value="1.2"', 'mass value="1.5"')


@pytest.fixture
def arm(tmp_path):
    """Folder with the file's robot, its rig, a log of a heavier one, and a model file with the links of that."""
    (tmp_path / "true").mkdir()
    true = load_robot(write_robot(tmp_path / "true", HEAVIER, JOINTS))
    write_robot(tmp_path, URDF, JOINTS)
    record(tmp_path, true, "run", 1)
    rig_file(tmp_path)
    links = link_model(true)
    values = {
        name: dict(zip(LINK_PARAMETERS, links.nominal[10 * k : 10 * k + 10].tolist(), strict=True))
        for k, name in enumerate(links.tree.links)
    }
    models = {joint: {"drive": {"kind": "current", "gain": 0.1}, "effects": []} for joint in JOINTS}
    document = {"joints": models, "links": values}
    (tmp_path / "model_after.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
    return tmp_path, true, document


def estimated(folder, *more):
    out = folder / "out"
    status = run(
        ["estimate-torque", f"--rig={folder / 'rig.yaml'}", f"--log={folder / 'run.npz'}", f"--out={out}", *more]
    )
    return status, out / "run_torque.csv"


def test_the_torques_are_those_of_the_true_arm(arm):
    folder, true, _ = arm
    status, path = estimated(folder, f"--links={folder / 'model_after.yaml'}")
    assert status == 0
    table = pd.read_csv(path)
    log = np.load(folder / "run.npz")
    q = np.stack([log[f"{joint}/position"] for joint in JOINTS], axis=1)
    v = np.gradient(q, log["time"], axis=0)
    vdot = np.gradient(v, log["time"], axis=0)
    ours = table[[f"{joint}/torque" for joint in JOINTS]].to_numpy()
    inner = slice(100, -100)
    truth = torques(true, q, v, vdot, 0.0)[inner]
    wrong = torques(load_robot(folder / "arm.yaml"), q, v, vdot, 0.0)[inner]
    error = np.sqrt(np.mean((ours[inner] - truth) ** 2, axis=0))
    assert np.all(error < 0.02 * np.ptp(truth, axis=0))  # differences of an encoder of 10 urad at 100 Hz
    assert np.all(error[1:] < 0.1 * np.sqrt(np.mean((wrong - truth) ** 2, axis=0))[1:])


def test_what_does_not_belong_together_is_refused(arm, capsys):
    folder, _, document = arm
    assert estimated(folder)[0] == 2
    assert "requires --links with the model_after.yaml" in capsys.readouterr().err.splitlines()[-1]
    rig_file(folder, load={"robot": "inverse_dynamics"})
    assert estimated(folder, f"--links={folder / 'model_after.yaml'}")[0] == 2
    assert "expected a rig file with `load: {robot: fitted}`" in capsys.readouterr().err.splitlines()[-1]
    rig_file(folder)
    for change, said in [
        (lambda links: links.clear(), "links: expected the links' parameters, got none"),
        (lambda links: links.pop("boom"), "links: no link 'boom'; links there: column, fore"),
        (lambda links: links["fore"].pop("Ixx"), "links: fore: Ixx: expected a number, got None"),
        (lambda links: links["fore"].update(m="heavy"), "links: fore: m: expected a number, got 'heavy'"),
    ]:
        changed = yaml.safe_load(yaml.safe_dump(document))
        change(changed["links"])
        (folder / "model_after.yaml").write_text(yaml.safe_dump(changed), encoding="utf-8")
        assert estimated(folder, f"--links={folder / 'model_after.yaml'}")[0] == 2
        assert said in capsys.readouterr().err.splitlines()[-1]
