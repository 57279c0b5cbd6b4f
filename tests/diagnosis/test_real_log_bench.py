"""`bench real-logs`: its rig files can be read, stretches of logs are cut right, and false claims are noticed."""

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from drake_tc.logs.rig import load_rig
from drake_tc.robot.robot import load_robot
from tests.benchmarks.real_log_cases import RealLogCase, RealLogSet, case_files, import_set, load_set, load_sets
from tests.benchmarks.real_log_claims import CaseClaims, claims_of

SETS = load_sets()
RIGS = sorted({s.folder / case.rig for s in SETS.values() for case in s.cases if not case.rig_in_data})


@pytest.mark.parametrize("rig", RIGS, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_every_committed_rig_file_can_be_read(rig: Path) -> None:
    read = load_rig(rig)
    if read.robot is not None:
        assert set(read.joints) <= set(load_robot(read.robot).joints)


@pytest.mark.parametrize("name", sorted(name for name, s in SETS.items() if s.cases and s.importer is None))
def test_every_log_of_a_case_is_in_the_data(data: Path, tmp_path: Path, name: str) -> None:
    logs = import_set(SETS[name], data, tmp_path)
    for case in SETS[name].cases:
        for stretch in (*case.log, *case.holdout):
            assert (logs / stretch.file).is_file()


def one_case(folder: Path, text: str) -> tuple[RealLogSet, RealLogCase]:
    folder.mkdir()
    (folder / "rig.yaml").write_text("joint: j\ndrive: current\ncolumns: {time: t}\n", encoding="utf-8")
    (folder / "cases.yaml").write_text(text, encoding="utf-8")
    read = load_set(folder)
    return read, read.cases[0]


@pytest.mark.parametrize("clock", ["seconds", "stamps"])
def test_a_stretch_counts_from_the_first_sample(tmp_path: Path, clock: str) -> None:
    text = "cases: [{name: a, rig: rig.yaml, log: [{file: x.csv, until: 2}], holdout: [{file: x.csv, from: 2}]}]"
    read, case = one_case(tmp_path / "set", text)
    time = np.arange(100) * 0.05
    stamps = pd.Timestamp("2025-11-12T10:00:00Z") + pd.to_timedelta(time, unit="s")
    table = pd.DataFrame({"t": 7.0 + time if clock == "seconds" else stamps.map(lambda s: s.isoformat()), "k": time})
    table.to_csv(tmp_path / "x.csv", index=False)
    files = case_files(read, case, tmp_path, tmp_path / "scratch")
    first, second = (pd.read_parquet(paths[0])["k"].to_numpy() for paths in (files.log, files.holdout))
    assert_allclose(np.concatenate([first, second]), time, rtol=0.0, atol=1e-12)
    assert first[-1] < 2.0 <= second[0] + 1e-9


def effect(gain: float = 0.2, *, at_bound: bool = False) -> dict[str, Any]:
    value = {"value": 1.0, "unit": "N*m", "ci95": [0.9, 1.1], "at_bound": at_bound}
    return {"id": "stribeck", "parameters": {"stribeck": value}, "heldout_gain": gain, "stability": 1.0}


def report(verdict: str, after: float, *effects: dict[str, Any]) -> dict[str, Any]:
    errors = {side: {"train": 1.0, "heldout": after, "free_run_heldout": None} for side in ("before", "after")}
    joint = {
        "noise_floor": 1.0,
        "error": {"unit": "A", **errors},
        "effects": list(effects),
        "unexplained": {"fraction": 0.0, "structured": False, "depends_on": []},
    }
    return {"verdict": verdict, "joints": {"j": joint}, "shared": [], "seconds": 1.0}


def checked(whole: dict[str, Any], **alone: dict[str, Any]) -> CaseClaims:
    return claims_of("set/case", whole, alone)


def test_claims_that_hold_on_every_run_pass() -> None:
    good = report("effects_found", 1.2, effect())
    claims = checked(good, a=good, b=copy.deepcopy(good))
    assert claims.failures == ()
    assert claims.disagreements == ()
    assert [run.name for run in claims.joints[0].heldout] == ["a", "b"]


def test_the_error_inside_the_band_is_read_for_each_run() -> None:
    whole, alone, nowhere = (report("effects_found", 1.2) for _ in range(3))
    alone["joints"]["j"]["shared_band"] = {"limit_hz": 4.0, "train": 0.4, "heldout": 0.3}
    nowhere["joints"]["j"]["shared_band"] = {"limit_hz": 0.0, "train": None, "heldout": None}
    (joint,) = checked(whole, a=alone, b=nowhere).joints
    assert (joint.train.in_band, joint.train.band_hz) == (1.0, np.inf)  # no limit: the whole band of the filters
    first, second = joint.heldout
    assert (first.in_band, first.band_hz) == (0.3, 4.0)
    assert second.band_hz == 0.0
    assert np.isnan(second.in_band)
    assert second.to_json()["in_band"] is None


@pytest.mark.parametrize(
    ("bad", "said"), [(effect(-0.05), "-5.0 % on b"), (None, "not named when b"), (effect(at_bound=True), "bound")]
)
def test_a_claim_that_fails_on_one_run_is_named(bad: dict[str, Any] | None, said: str) -> None:
    good = report("effects_found", 1.2, effect())
    other = report("effects_found", 1.2, *([bad] if bad else []))
    whole = other if said == "bound" else good
    (why,) = checked(whole, a=good, b=other).failures
    assert said in why


@pytest.mark.parametrize(("verdict", "against"), [("no_missing_effect", 1), ("unexplained_structure", 0)])
def test_a_green_verdict_far_above_the_floor_is_contradicted(verdict: str, against: int) -> None:
    # together the held-out runs pass the limit; one of them does not
    whole, alone = report(verdict, 2.8), report(verdict, 5.0)
    whole["joints"]["j"]["runs"] = [
        {"run": name, "heldout": heldout, "rows": 100, "before": {"rms": after}, "after": {"rms": after}}
        for name, heldout, after in (("training", False, 9.0), ("near", True, 1.0), ("far", True, 5.0))
    ]
    assert len(checked(whole, near=alone, far=alone).disagreements) == against
