"""What a tick of robust TSID costs, everything included, and the humanoid's diagram: rows are printed (run with -s)."""

import pytest

from drake_tc.registry import tsid_entry
from tests.benchmarks.tsid_timing import tick_timings

from .machine import require

pytestmark = pytest.mark.benchmark
BUDGET = {
    "a tick, everything: classic": 90e-6,
    "a tick, everything: individual": 110e-6,
    "a tick, everything: box": 120e-6,
    "a tick, everything: rectangle": 150e-6,
    "the diagram, a tick of 1 ms: controller, plant with contact, log": 500e-6,
}
"""Median on a quiet machine [s]."""


def test_a_tick_and_the_diagram_are_no_slower_than_their_bounds():
    scenario = tsid_entry().scenario("com_move").changed(duration=1.0)

    def medians():
        return {row.name: 1e-6 * row.value for row in tick_timings(scenario, lambda what, share: None)}

    require(BUDGET, medians, rounds=3)
