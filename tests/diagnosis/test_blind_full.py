"""The whole blind benchmark (`bench diagnosis --scale full`) in two parts: the figures that README.md quotes."""

import os
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

import numpy as np
import pytest
from readme_tables import assert_quoted, row

from drake_tc.benchmarks.blind.catalogue import catalogue
from drake_tc.benchmarks.blind.generate import generate
from drake_tc.benchmarks.blind.score import score_reports
from drake_tc.benchmarks.blind.scoreboard import print_score
from drake_tc.benchmarks.blind_rigs import diagnose_folder

SEED = 204
"""Untouched until the thresholds were frozen; they were set on seed 100."""
PARTS = {"middle": 100, "rest": 244}
"""Rigs whose effects are of middle strength, pairs among them; all others."""
GOALS = {"right effect": 0.95, "exactly that": 0.92, "both effects": 0.90, "causes that are not": 0.95}
"""At least; by the beginning of the README's row."""
DIAGNOSIS = "drake_tc/diagnosis/README.md"
MISSED: dict[str, set[str]] = {"middle": set(), "rest": set()}
"""Goals that the README says are missed, by part: one that is met after all has to be told too."""
LIMITS = {"false alarms": 0.02, "other rigs flagged": 0.04}
"""At most."""


def part_of(spec):
    return "middle" if spec.strength == "middle" else "rest"


@pytest.mark.parametrize("part", PARTS)
def test_parts_have_their_rigs(part):
    assert sum(part_of(spec) == part for spec in catalogue("full", SEED)) == PARTS[part]


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
def test_figures(part, tmp_path):
    """Goals are met, and the README quotes what is computed; its row on other rigs has a figure of each part."""
    folders = generate([spec for spec in catalogue("full", SEED) if part_of(spec) == part], tmp_path)
    with ProcessPoolExecutor(os.cpu_count() or 1, mp_context=get_context("spawn")) as pool:
        list(pool.map(partial(diagnose_folder, reports=tmp_path / "reports"), folders))
    score = score_reports(tmp_path / "truth", tmp_path / "reports")
    print_score(score)
    found = score.outcomes
    assert len(found) == PARTS[part]
    flagged = share([o for o in found if o.truth and o.acts], lambda o: o.flagged)
    if part == "middle":
        singles, pairs = ([o for o in found if o.group == group and o.acts] for group in ("single", "pair"))
        shares = {
            "right effect": share(singles, lambda o: o.first_right),
            "exactly that": share(singles, lambda o: o.exact),
            "both effects": share(pairs, lambda o: o.all_found),
        }
        in_detail = {
            "right effect first, middle strength": [100.0 * shares["right effect"]],
            "exactly that effect and no other, middle strength": [100.0 * shares["exactly that"]],
            "both effects of a pair named": [100.0 * shares["both effects"]],
        }
        ratios = [over_oracle(score, "middle"), None]
        assert_quoted(row("README.md", "held-out error over that")[1], ratios[:1], "error over oracle")
    else:
        nulls, outside = ([o for o in found if o.group == group] for group in ("null", "outside"))
        shares = {
            "false alarms": share(nulls, lambda o: o.false_alarm),
            "causes that are not": share(outside, lambda o: o.flagged_rightly),
        }
        in_detail = {
            "false alarms on nulls": [100.0 * shares["false alarms"]],
            "causes outside the library flagged by": [100.0 * shares["causes that are not"]],
        }
        for strength in ("weak", "strong"):
            singles = [o for o in found if o.group == "single" and o.strength == strength and o.acts]
            in_detail[f"right effect first / exact, {strength}"] = [
                100.0 * share(singles, lambda o: o.first_right),
                100.0 * share(singles, lambda o: o.exact),
            ]
        ratios = [None, over_oracle(score, "nulls")]
    quoted = {begin: [100.0 * value] for begin, value in shares.items()}
    both = [100.0 * flagged, None] if part == "middle" else [None, 100.0 * flagged]
    for begin, values in (quoted | {"other rigs flagged": both}).items():
        assert_quoted(row("README.md", begin)[1], values, begin)
    in_detail |= {"other rigs flagged: of middle": both, "held-out error over an oracle's": ratios}
    for begin, values in in_detail.items():
        assert_quoted(row(DIAGNOSIS, begin)[1], values, f"{DIAGNOSIS}: {begin}")
    shares |= {"other rigs flagged": flagged}
    assert {begin for begin, value in shares.items() if value < GOALS.get(begin, 0.0)} == MISSED[part]
    assert {begin: value for begin, value in shares.items() if value > LIMITS.get(begin, 1.0)} == {}


def over_oracle(score, which):
    """Median of the held-out error over the oracle's."""
    return next(one.value for one in score.rows if one.name == f"held-out error over oracle, {which}")


def share(outcomes, test):
    return float(np.mean([test(outcome) for outcome in outcomes]))
