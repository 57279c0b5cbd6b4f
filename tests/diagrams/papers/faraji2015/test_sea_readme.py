"""What diagrams/sea_joint.md says: its tables of laws against the record, its rule of tuning against margins."""

from pathlib import Path

import pytest
from numpy.testing import assert_allclose
from readme_tables import assert_quoted

from drake_tc.diagrams.papers.expected_values import on_record
from drake_tc.diagrams.papers.faraji2015 import sea_bode, sea_held
from drake_tc.diagrams.papers.faraji2015.sea_laws import (
    BESIDE,
    LARGEST_PEAK,
    LAWS,
    LEAST_DELAY_MARGIN,
    NO_GAIN,
    margins_of,
)

README = (Path(sea_bode.__file__).parents[2] / "sea_joint.md").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in LAWS if name != NO_GAIN])
def test_every_law_with_a_gain_keeps_the_rule_and_uses_it(name):
    """Within the rule; and with a tenth more gain no longer, as its margins are computed anew."""
    found, more = margins_of(name), margins_of(name, 1.1)
    assert found.sensitivity_peak <= LARGEST_PEAK
    assert found.delay_margin >= LEAST_DELAY_MARGIN
    assert more.sensitivity_peak > LARGEST_PEAK or more.delay_margin < LEAST_DELAY_MARGIN


@pytest.mark.slow
def test_the_law_without_a_gain_breaks_the_rule_as_the_readme_says():
    """It has none of GAINS; what it has of feedback is the measured speed."""
    assert set(LAWS[NO_GAIN]) == {"mode"}
    found = margins_of(NO_GAIN)
    assert_allclose(found.sensitivity_peak, 3.84, atol=0.02)
    assert "3.84" in README


def readme_table(first):
    """Cells of the README's table whose first heading is `first`, row by row."""
    lines = README.splitlines()
    begin = next(i for i, line in enumerate(lines) if line.startswith(f"| {first} |"))
    rows = []
    for line in lines[begin + 2 :]:
        if not line.startswith("|"):
            return rows
        rows.append([cell.strip() for cell in line.strip("|").split("|")])
    return rows


def test_the_readme_has_a_row_for_every_law():
    assert [row[0] for row in readme_table("law")] == list(LAWS)
    assert [row[0] for row in readme_table("law, beside")] == list(BESIDE)
    assert all(len(row) == 6 for row in readme_table("law"))


def test_the_readme_quotes_what_is_on_record_of_c_held():
    """A slow test compares the record with what is computed; C.bode is in `tests/test_readme_figures.py`."""
    values = {name: item.reached for name, item in on_record("c_held").items()}
    keys = ("torque RMSE [N m]", "torque RMSE but for the delay [N m]", *sea_held.BY_HAND)
    for heading in ("law", "law, beside"):
        for name, *cells in readme_table(heading):
            for cell, key in zip(cells, keys, strict=False):
                what = f"{name}: {key}"
                assert (cell == "-") == (what not in values), what
                if cell != "-":
                    assert_quoted(cell, [values[what]], what)
    for name, cell in readme_table("caught, speed_bandwidth [rad/s]"):
        assert_quoted(cell, [values[f"caught, speed_bandwidth {name}: RMSE [N m]"]], name)
