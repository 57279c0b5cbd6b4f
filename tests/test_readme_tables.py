"""Reading figures out of the README files' tables."""

import pytest
from readme_tables import assert_quoted, numbers, row


@pytest.mark.parametrize(
    ("cell", "found"),
    [
        ("**0.31**; 0.05; 0.19 − **0.38**; **8**", ["0.31", "0.05", "0.19", "0.38", "8"]),
        ("−1.1; 2.1 points", ["-1.1", "2.1"]),
        ("6 of 6; none", ["6", "6", "0"]),
        ("1.5e-4 m/s²", ["1.5e-4"]),
        ("25 % [11, 47]", ["25", "11", "47"]),
        ("stands; falls", []),
        ("> 4.5", ["4.5"]),
        ("p_ind2 and K6", []),
    ],
)
def test_numbers_of_a_cell(cell, found):
    assert numbers(cell) == found


@pytest.mark.parametrize(
    ("cell", "values"),
    [
        ("0.14", [0.1449]),
        ("0.14", [0.1351]),
        ("1.5e-4", [1.54e-4]),
        ("24 of 24", [24.0, None]),
        ("none", [0.0]),
        ("4.5", [4.507]),
        ("57.6", [57.65]),  # on record to four digits, of 57.648
    ],
)
def test_a_rounded_value_is_quoted(cell, values):
    assert_quoted(cell, values, "figure")


@pytest.mark.parametrize(
    ("cell", "values"),
    [("0.14", [0.146]), ("0.14", [float("nan")]), ("1.5e-4", [1.6e-4]), ("24", [23.0]), ("1, 2", [1.0]), ("", [1.0])],
)
def test_another_value_or_number_of_values_is_not(cell, values):
    with pytest.raises(AssertionError):
        assert_quoted(cell, values, "figure")


def test_a_row_is_found_by_its_beginning():
    cells = row("drake_tc/tsid/README.md", "1 | mean")
    assert cells[0] == "1" and cells[-1] == "2.6"  # the bars inside |p - p_ind| are not cells' ends
    with pytest.raises(AssertionError, match="0 rows begin"):
        row("README.md", "there is no such row")
