"""The whole blind benchmark (`bench diagnosis --scale full`) in two parts: the figures that its README quotes."""

import os
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

import pytest
from readme_tables import assert_quoted, row

from drake_tc.benchmarks.blind.catalogue import catalogue
from drake_tc.benchmarks.blind.generate import generate
from drake_tc.benchmarks.blind.score import score_reports
from drake_tc.benchmarks.blind.scoreboard import print_score
from drake_tc.benchmarks.blind_rigs import diagnose_folder

SEED = 213
"""Untouched until the thresholds were frozen (drake_tc/diagnosis/README.md says on which seeds they were set)."""
PARTS = {"middle": 100, "rest": 244}
"""Rigs whose effects are of middle strength, pairs among them; all others."""
DIAGNOSIS = "drake_tc/diagnosis/README.md"


def part_of(spec):
    return "middle" if spec.strength == "middle" else "rest"


@pytest.mark.parametrize("part", PARTS)
def test_parts_have_their_rigs(part):
    assert sum(part_of(spec) == part for spec in catalogue("full", SEED)) == PARTS[part]


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
def test_the_readme_quotes_what_is_computed(part, tmp_path):
    """Its row on other rigs that are flagged has a figure of each part."""
    folders = generate([spec for spec in catalogue("full", SEED) if part_of(spec) == part], tmp_path)
    with ProcessPoolExecutor(os.cpu_count() or 1, mp_context=get_context("spawn")) as pool:
        list(pool.map(partial(diagnose_folder, reports=tmp_path / "reports"), folders))
    score = score_reports(tmp_path / "truth", tmp_path / "reports")
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
