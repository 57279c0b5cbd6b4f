"""The whole blind benchmark (`bench diagnosis --scale full`) in two parts: no goal is missed.

`DRAKE_TC_BLIND` names a folder that `bench diagnosis --scale full --seed SEED --out FOLDER` has filled with this code:
its reports are then scored again, and nothing is simulated.
"""

import json
import os
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import pytest

from tests.benchmarks.blind.catalogue import catalogue
from tests.benchmarks.blind.generate import generate
from tests.benchmarks.blind.outcome import read_outcome
from tests.benchmarks.blind.score import score_outcomes, score_reports
from tests.benchmarks.blind.scoreboard import print_score
from tests.benchmarks.blind_rigs import diagnose_folder

SEED = 220
"""Untouched while the diagnosis was developed."""
PARTS = {"middle": 100, "rest": 244}
"""Rigs whose effects are of middle strength, pairs among them; all others."""


def part_of(spec):
    return "middle" if spec.strength == "middle" else "rest"


@pytest.mark.parametrize("part", PARTS)
def test_parts_have_their_rigs(part):
    assert sum(part_of(spec) == part for spec in catalogue("full", SEED)) == PARTS[part]


def score_of(part, scratch):
    """What the diagnosis of a part's rigs is worth: made here, or of the folder that holds all of them."""
    specs = [spec for spec in catalogue("full", SEED) if part_of(spec) == part]
    if made := os.environ.get("DRAKE_TC_BLIND"):
        assert json.loads((Path(made) / "catalogue.json").read_text())["seed"] == SEED
        places = [(Path(made) / "truth" / s.name, Path(made) / "reports" / s.name) for s in specs]
        return score_outcomes([read_outcome(t / "truth.json", r / "report.json") for t, r in places])
    folders = generate(specs, scratch)
    with ProcessPoolExecutor(os.cpu_count() or 1, mp_context=get_context("spawn")) as pool:
        list(pool.map(partial(diagnose_folder, reports=scratch / "reports"), folders))
    return score_reports(scratch / "truth", scratch / "reports")


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
def test_no_goal_is_missed(part, tmp_path):
    score = score_of(part, tmp_path)
    print_score(score)
    assert len(score.outcomes) == PARTS[part]
    assert [row.name for row in score.rows if row.met is False] == []
