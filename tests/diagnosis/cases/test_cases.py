"""Every row of the table, by the public entry `close_loop`."""

from pathlib import Path

import pytest

from .case import Case, run_case
from .table import CASES, QUICK, WRONG

ROWS = [
    pytest.param(
        case,
        seed,
        id=f"{case.name}[{seed}]",
        marks=[] if case.name in QUICK and seed == case.seeds[0] else [pytest.mark.slow],
    )
    for case in CASES
    for seed in case.seeds
]


@pytest.mark.parametrize(("case", "seed"), ROWS)
def test_the_answer_is_right(case: Case, seed: int, tmp_path: Path) -> None:
    outcome = run_case(case, seed, tmp_path)
    if not outcome.is_right and case.name in WRONG:
        pytest.xfail("; ".join(outcome.problems))
    assert outcome.is_right, "\n".join([outcome.case, str(outcome.answer), *outcome.problems])


def test_names_are_unique_and_those_of_quick_rows_and_expected_failures_exist() -> None:
    names = {case.name for case in CASES}
    assert len(names) == len(CASES)
    assert names >= QUICK | WRONG
