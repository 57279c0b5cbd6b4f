"""The laws of one series-elastic joint against the rule by which their gains are chosen."""

import pytest
from numpy.testing import assert_allclose

from drake_tc.diagrams.papers.faraji2015.sea_laws import LARGEST_PEAK, LAWS, LEAST_DELAY_MARGIN, NO_GAIN, margins_of


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in LAWS if name != NO_GAIN])
def test_every_law_with_a_gain_keeps_the_rule_and_uses_it(name):
    """Within the rule; and with a tenth more gain no longer, as its margins are computed anew."""
    found, more = margins_of(name), margins_of(name, 1.1)
    assert found.sensitivity_peak <= LARGEST_PEAK
    assert found.delay_margin >= LEAST_DELAY_MARGIN
    assert more.sensitivity_peak > LARGEST_PEAK or more.delay_margin < LEAST_DELAY_MARGIN


@pytest.mark.slow
def test_the_law_without_a_gain_breaks_the_rule():
    """It has none of GAINS; what it has of feedback is the measured speed."""
    assert set(LAWS[NO_GAIN]) == {"mode"}
    found = margins_of(NO_GAIN)
    assert_allclose(found.sensitivity_peak, 3.84, atol=0.02)
