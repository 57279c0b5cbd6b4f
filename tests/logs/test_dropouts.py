"""Zeros that no sensor read: which are taken out, and which stay because the joint made them."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from drake_tc.logs.checks.outliers import unanswered_zeros, zero_rows

T = 2e-3 * np.arange(4000)
SMOOTH = 0.6 * np.sin(2.0 * T) + 0.1 * np.sin(5.0 * T)


@pytest.mark.parametrize(("begin", "count"), [(300, 1), (300, 3), (900, 40), (1500, 400), (3990, 10), (0, 20)])
@pytest.mark.parametrize("offset", [0.0, 1.0])
def test_what_drops_out_is_found_exactly(begin, count, offset):
    values = SMOOTH + offset + 1e-4
    before = values.copy()
    values[begin : begin + count] = 0.0
    found = zero_rows(values)
    assert_array_equal(np.flatnonzero(found), np.arange(begin, begin + count))
    assert_array_equal(before[~found], values[~found])


def test_zeros_that_belong_to_the_signal_stay():
    rng = np.random.default_rng(0)
    cases = {
        "crosses zero on a coarse grid": np.round(SMOOTH / 0.01) * 0.01,
        "square wave": 0.5 * (np.sin(3.0 * T) > 0.0),
        "steps to zero and rests": np.where((T > 2.0) & (T < 4.0), 0.0, 0.5),
        "dead zone": np.sign(SMOOTH) * np.maximum(np.abs(SMOOTH) - 0.2, 0.0),
        "noise in whole numbers": np.round(rng.standard_normal(T.size) * 2.0),
        "mostly zero": np.where(T % 1.0 < 0.6, 0.0, 1.0 + SMOOTH),
    }
    for name, values in cases.items():
        assert not zero_rows(values).any(), name


def test_a_command_of_zero_that_was_sent_is_answered_and_stays():
    command = SMOOTH + 1.0
    position = command.copy()
    command[1000:1100] = 0.0
    assert_array_equal(np.flatnonzero(unanswered_zeros(command, position)), np.arange(1000, 1100))
    single = position.copy()
    single[1000] = 0.0
    assert_array_equal(np.flatnonzero(unanswered_zeros(single, position)), [1000])
    answering = position.copy()
    answering[1000:1100] *= np.exp(-np.arange(100) / 20.0)
    assert not unanswered_zeros(command, answering).any()
    elsewhere = command.copy()
    elsewhere[1100:] -= 0.7  # does not come back to where it was going
    assert not unanswered_zeros(elsewhere, position).any()
