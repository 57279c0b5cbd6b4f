"""One wrong drive gain of simulated arms of several makers: named wherever the declared model leaves it to be seen."""

import numpy as np
import pytest
import yaml

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.robot import whole
from drake_tc.diagnosis.run import close_loop
from drake_tc.diagnosis.set_up.search import check_set_up
from tests.benchmarks.blind_arm.cases import arm_case, record_case

SEED = 901
WITHOUT_AN_EFFECT = (15, 46, 47)
"""Cases of `bench arms` with current drives in which nothing is missing: a UR10, a Panda and a Kinova arm."""
FACTORS = (0.6, 1.7)


class Looked(Exception):
    """Ends a diagnosis once the set-up has been looked at."""


@pytest.fixture
def look(monkeypatch):
    """The declared models' shares by joint and the errors that are named, of the logs in a folder."""
    seen = []

    def spy(logs, links, train, held, rig, left):
        seen.append((left, check_set_up(logs, links, train, held, rig, left)))
        raise Looked

    monkeypatch.setattr(whole, "check_set_up", spy)

    def of(folder, rig):
        (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
        runs = sorted(folder.glob("run_*"))
        held = [run for run in runs if "held" in run.name]
        with pytest.raises(Looked):
            close_loop(folder / "rig.yaml", [run for run in runs if run not in held], held, DiagnosisOptions())
        left, check = seen.pop()
        return left, [] if check is None else list(check.errors)

    return of


@pytest.mark.slow
@pytest.mark.parametrize("number", WITHOUT_AN_EFFECT)
def test_one_wrong_drive_gain_is_named_where_it_shows(number, look, tmp_path):
    """It shows where the declared model leaves twice as much of some joint's effort; of each arm at most two miss."""
    record_case(arm_case(number, SEED), tmp_path)
    right = yaml.safe_load((tmp_path / "rig.yaml").read_text())
    usual, named = look(tmp_path, right)
    assert named == []
    shows = missed = 0
    for factor in FACTORS:
        for joint in right["drive_gain"]:
            left, named = look(tmp_path, right | {"drive_gain": _changed(right["drive_gain"], joint, factor)})
            visible = max(left[name] / usual[name] for name in usual) > 2.0
            shows += visible
            missed += visible and not named
            if named:
                assert visible
                assert [(error.kind, error.joints) for error in named] == [("drive_gain", (joint,))]
                fitted, declared = named[0].gains[joint]
                np.testing.assert_allclose(fitted / declared, 1.0 / factor, rtol=0.02)
    assert shows >= 4
    assert missed <= 2


def _changed(gains, joint, factor):
    return gains | {joint: factor * gains[joint]}


@pytest.mark.slow
@pytest.mark.parametrize("number", range(16))
def test_an_effect_of_one_joint_is_no_wrong_drive_gain(number, look, tmp_path):
    record_case(arm_case(number, SEED), tmp_path)
    assert look(tmp_path, yaml.safe_load((tmp_path / "rig.yaml").read_text()))[1] == []
