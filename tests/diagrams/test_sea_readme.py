"""What diagrams/sea/README.md says: its tables against what the commands print, its rule of tuning against margins."""

import re
from pathlib import Path

import pytest
from drake_tc.diagrams.papers import sea_bode, sea_held
from drake_tc.diagrams.papers.sea_laws import (
    BESIDE,
    LARGEST_PEAK,
    LAWS,
    LEAST_DELAY_MARGIN,
    MOMENTUM,
    NO_GAIN,
    OBSERVER,
    PI,
    PREDICTED,
    margins_of,
)
from numpy.testing import assert_allclose

README = (Path(sea_bode.__file__).parents[1] / "sea" / "README.md").read_text(encoding="utf-8")


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
    assert "3.84" in " ".join(sea_bode.NOTES)


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


def numbers(text):
    return [float(found) for found in re.findall(r"-?\d+(?:\.\d+)?", text)]


def agrees(cell, value, what):
    """A cell's number is the value, rounded to the cell's digits."""
    digits = len(cell.partition(".")[2])
    assert_allclose(float(cell), value, atol=0.5001 * 10.0**-digits, err_msg=what)


def test_the_readme_has_a_row_for_every_law_and_every_figure_a_place_in_it():
    """Without running anything: names of laws, and as many numbers as the slow test compares."""
    assert [row[0] for row in readme_table("law")] == list(LAWS)
    assert [row[0] for row in readme_table("law, beside")] == list(BESIDE)
    assert all(len(row) == 6 for row in readme_table("law"))
    assert [len(numbers(row[1])) for row in readme_table("figure of C.bode")] == [2, 3, 2, 2, 4, 2]


@pytest.mark.slow
def test_c_bode_is_what_the_readme_says():
    found = sea_bode.bode()
    assert [row.name for row in found.rows if row.met is False] == []
    values = {row.name: row.value for row in found.rows}
    size, phase = ": largest | |H| |, 2 to 10 Hz [dB]", ": phase off the pure delay, largest, 2 to 10 Hz [deg]"
    held = "held by a hand of 2000 N m/rad: "
    wanted = [
        [values[OBSERVER + size], values[OBSERVER + phase]],
        [values[f"{PI}: -3 dB bandwidth [Hz]"], values[sea_bode.PI_LINEAR], values["bandwidth, observer + P over PI"]],
        [values["phase lag with the predictor over without, largest, 2 to 10 Hz"], values[PREDICTED + size]],
        [values[f"measured off linear, observer + P, 2 to 10 Hz [{unit}]"] for unit in ("dB", "deg")],
        [values[name + size] for name in ("feedforward", "feedforward + P", MOMENTUM, PI)],
        [values[held + sea_bode.HAND_SIZE], values[held + sea_bode.HAND_OFF]],
    ]
    for row, expected in zip(readme_table("figure of C.bode"), wanted, strict=True):
        for cell, value in zip(re.findall(r"\d+(?:\.\d+)?", row[1]), expected, strict=True):
            agrees(cell, value, row[0])


@pytest.mark.slow
def test_c_held_is_what_the_readme_says():
    found = sea_held.held()
    missed = [row.name for row in found.rows if row.met is False]
    assert missed == ["torque RMSE, observer + P over momentum observer"]
    values = {row.name: row.value for row in found.rows}
    keys = ("torque RMSE [N m]", "torque RMSE but for the delay [N m]", *sea_held.BY_HAND)
    for heading in ("law", "law, beside"):
        for name, *cells in readme_table(heading):
            for cell, key in zip(cells, keys, strict=False):
                assert (cell == "-") == (f"{name}: {key}" not in values), (name, key)
                if cell != "-":
                    agrees(cell, values[f"{name}: {key}"], f"{name}: {key}")
    for name, cell in readme_table("caught, speed_bandwidth [rad/s]"):
        agrees(cell, values[f"caught, speed_bandwidth {name}: RMSE [N m]"], name)
