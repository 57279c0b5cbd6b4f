"""Numbers as text."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drake_tc.report.numbers import fold, interval, percent, pretty_unit, scale_for, significant, times


def plain(text: str) -> str:
    assert " " not in text  # a number is never parted from its unit
    return text.replace("\u00a0", " ")


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.0, 3, "0"),
        (0.01423, 3, "0.0142"),
        (1234.5, 3, "1234"),
        (-3.2, 2, "−3.2"),
        (9.9996, 3, "10.0"),
        (1.8327e-5, 3, "1.83·10⁻⁵"),
        (251234.0, 2, "251234"),
        (2.5e7, 2, "2.5·10⁷"),
        (None, 3, "–"),
        (math.nan, 3, "–"),
        (-math.inf, 3, "−∞"),
    ],
)
def test_significant(value: float | None, digits: int, text: str) -> None:
    assert significant(value, digits) == text


@given(st.floats(min_value=1e-12, max_value=1e12), st.integers(min_value=2, max_value=6))
def test_significant_reads_back(value: float, digits: int) -> None:
    text = significant(value, digits)
    superscript = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
    mantissa, _, power = text.partition("·10")
    read = float(mantissa) * 10.0 ** int(power.translate(superscript) or 0)
    assert read == pytest.approx(value, rel=0.51 * 10.0 ** (1 - digits))  # half a unit of the last digit


@pytest.mark.parametrize(
    ("largest", "unit", "text"),
    [
        (6.574e-4, "rad", "657 µrad"),
        (0.0342, "V", "34.2 mV"),
        (0.99999, "V", "1.00 V"),
        (12.3, "N*m", "12.3 N·m"),
        (4100.0, "N*m", "4.10 kN·m"),
        (30.0, "degC", "30.0 degC"),
        (5e-12, "A", "0.00500 nA"),
        (3600.0, "s", "3600 s"),
    ],
)
def test_a_quantity_takes_the_prefix_that_suits_it(largest: float, unit: str, text: str) -> None:
    assert plain(scale_for(largest, unit).quantity(largest)) == text


@pytest.mark.parametrize("largest", [None, 0.0, math.nan, math.inf])
def test_a_scale_without_a_size_has_no_prefix(largest: float | None) -> None:
    scale = scale_for(largest, "rad")
    assert (scale.factor, scale.unit) == (1.0, "rad")


def test_a_scale_is_shared() -> None:
    scale = scale_for(0.3, "V")
    assert [scale.text(v) for v in (0.3, 0.00456, math.nan)] == ["300", "4.56", "–"]
    assert scale.quantity(math.nan) == "–"


@pytest.mark.parametrize(
    ("estimate", "shown"),
    [
        ((0.18321, 0.18292, 0.1835), ("0.18321", "[0.18292, 0.18350]")),
        ((41.2, 33.5, 48.9), ("41.2", "[33.5, 48.9]")),
        ((-0.002, -0.013, 0.009), ("−0.002", "[−0.013, 0.009]")),
        ((1.5e-6, 1.4e-6, 1.6e-6), ("1.50·10⁻⁶", "[1.40, 1.60]·10⁻⁶")),
        ((2.0, -math.inf, math.inf), ("2.000", "")),
        ((2.0, math.nan, 3.0), ("2.000", "")),
        ((0.0, 0.0, 0.0), ("0", "")),
    ],
)
def test_an_interval_sets_the_digits(estimate: tuple[float, float, float], shown: tuple[str, str]) -> None:
    assert interval(*estimate) == shown


@pytest.mark.parametrize(
    ("before", "after", "text", "sentence"),
    [
        (46.2, 1.0, "46 ×", "46 times smaller"),
        (1.0, 2.0, "0.50 ×", "2.0 times larger"),
        (0.0, 1.0, "–", "no ratio, because one of them is zero"),
        (math.nan, 1.0, "–", "no ratio, because one of them could not be computed"),
    ],
)
def test_fold(before: float, after: float, text: str, sentence: str) -> None:
    assert (plain(fold(before, after)), times(before, after)) == (text, sentence)


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.34, "34 %"),
        (0.0012, "0.12 %"),
        (0.00002, "< 0.1 %"),
        (-0.00002, "> −0.1 %"),
        (-2.41, "−241 %"),
        (-136.0, "< −1000 %"),
        (0.0, "0 %"),
    ],
)
def test_percent(share: float, text: str) -> None:
    assert plain(percent(share)) == text


def test_units_for_people() -> None:
    assert [pretty_unit(u) for u in ("N*m*s^2/rad^2", "-", "rad/(N*m)")] == ["N·m·s²/rad²", "", "rad/(N·m)"]


def test_no_minus_sign_before_zeros() -> None:
    assert interval(-0.0002, -0.086, 0.086) == ("0.000", "[−0.086, 0.086]")
