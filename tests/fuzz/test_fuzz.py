"""Every command under damaged inputs: one good line or a result; no traceback, hang, warning or file that is cut."""

import json
import os
from pathlib import Path

import pytest

from .judge import outcomes
from .sound import sound
from .warm import warm

FEW = range(100)
MANY = range(1000, 21_000)
SHARES = 8
"""Of the many, so that a failure names a few thousand."""


def failures(first: int, last: int) -> list[str]:
    """What is wrong with the cases, a line each; FUZZ_OUTCOMES=FILE appends all outcomes to a file."""
    found = []
    kept = os.environ.get("FUZZ_OUTCOMES")
    for outcome in outcomes(first, last):
        if outcome["wrong"]:
            found.append(
                f"case {outcome['number']} ({outcome['kind']}): {'; '.join(outcome['wrong'])}: {outcome['err']}"
            )
        if kept:
            with Path(kept).open("a", encoding="utf-8") as file:
                file.write(json.dumps(outcome) + "\n")
    return found


@pytest.fixture(scope="module", autouse=True)
def compiled_kernels(tmp_path_factory):
    """The kernels of robust control and of the base's estimate, which take minutes to compile and are kept then.

    Cases run in processes of their own, which find them compiled; a case that compiles could run into the time limit.
    """
    warm(sound(), tmp_path_factory.mktemp("warm"))


def test_a_few_hundred_damaged_inputs():
    wrong = failures(FEW.start, FEW.stop)
    assert not wrong, "\n".join(wrong)


@pytest.mark.slow
@pytest.mark.parametrize("share", range(SHARES))
def test_twenty_thousand_damaged_inputs(share):
    step = len(MANY) // SHARES
    first = MANY.start + share * step
    wrong = failures(first, first + step)
    assert not wrong, "\n".join(wrong)


def test_what_is_wrong_with_an_outcome_is_seen(tmp_path):
    """The judge itself: good outcomes pass, each kind of bad one is named."""
    from .cases import Case
    from .worker import evaluated

    each = Case(0, "log", ("identify", "--log", "run.csv"))
    (tmp_path / "run.csv").write_text("")
    assert evaluated(each, 2, "", "drake-tc: run.csv: no rows\n", tmp_path) == []
    assert evaluated(each, 0, "{}", "", tmp_path) == []
    bad = {
        "exit code 70": (70, "", "drake-tc: unexpected error\n"),
        "lines of ours": (2, "", "drake-tc: run.csv: a\ndrake-tc: run.csv: b\n"),
        "stdout": (2, "table", "drake-tc: run.csv: no rows\n"),
        "leaks Python": (2, "", "drake-tc: run.csv: 'NoneType' object has no attribute 'x'\n"),
        "names no file": (2, "", "drake-tc: bad value\n"),
        "characters": (2, "", "drake-tc: run.csv: \u202e\n"),
        "a warning": (0, "", "x.py:3: RuntimeWarning: overflow\n"),
    }
    for what, (code, out, err) in bad.items():
        assert any(what in wrong for wrong in evaluated(each, code, out, err, tmp_path)), what
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "model.yaml").write_text("a: [1")
    assert any("cut" in wrong for wrong in evaluated(each, 0, "", "", tmp_path))
