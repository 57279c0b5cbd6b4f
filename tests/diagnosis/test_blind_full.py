"""The whole blind benchmark (`bench diagnosis --scale full`) in two parts: the figures that its README quotes.

`DRAKE_TC_BLIND` names a folder that `bench diagnosis --scale full --seed SEED --out FOLDER` has filled with this code:
its reports are then scored again and compared with the README, and nothing is simulated.
"""

import json
import os
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import pytest
from readme_tables import assert_quoted, row

from tests.benchmarks.blind.catalogue import catalogue
from tests.benchmarks.blind.generate import generate
from tests.benchmarks.blind.outcome import read_outcome
from tests.benchmarks.blind.score import score_outcomes, score_reports
from tests.benchmarks.blind.scoreboard import print_score
from tests.benchmarks.blind_rigs import diagnose_folder

SEED = 220
"""Untouched until the thresholds were frozen (drake_tc/diagnosis/README.md says on which seeds they were set)."""
PARTS = {"middle": 100, "rest": 244}
"""Rigs whose effects are of middle strength, pairs among them; all others."""
DIAGNOSIS = "drake_tc/diagnosis/README.md"


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
def test_the_readme_quotes_what_is_computed(part, tmp_path):
    """Its row on other rigs that are flagged has a figure of each part."""
    score = score_of(part, tmp_path)
    print_score(score)
    assert len(score.outcomes) == PARTS[part]
    figures = {one.name: one for one in score.rows}

    def percent(*names):
        return [100.0 * figures[name].value for name in names]

    if part == "middle":
        expected = {
            "right effect first, middle strength": percent("right effect first, middle"),
            "exactly that effect and no other, middle strength": percent("exact, middle"),
            "both effects of a pair named": percent("both effects of a pair"),
            "other rigs flagged: of middle": [*percent("other rigs flagged"), None],
            "held-out error over an oracle's": [figures["held-out error over oracle, middle"].value, None],
        }
    else:
        expected = {
            "right effect first / exact, weak": percent("right effect first, weak", "exact, weak"),
            "right effect first / exact, strong": percent("right effect first, strong", "exact, strong"),
            "false alarms on rigs": percent("false alarms on nulls"),
            "causes outside the library flagged by": percent("outside causes flagged"),
            "other rigs flagged: of middle": [None, *percent("other rigs flagged")],
            "held-out error over an oracle's": [None, figures["held-out error over oracle, nulls"].value],
        }
    for begin, values in expected.items():
        assert_quoted(row(DIAGNOSIS, begin)[1], values, begin)
