"""What a tick of robust TSID costs, everything included, and the humanoid's diagram: rows are printed (run with -s)."""

import pytest

from drake_tc.registry import tsid_entry
from tests.benchmarks.tsid_timing import tick_timings

from .machine import slowness

pytestmark = pytest.mark.benchmark
BUDGET = {
    "a tick, everything: classic": 350.0,
    "a tick, everything: individual": 500.0,
    "a tick, everything: box": 500.0,
    "a tick, everything: rectangle": 1000.0,
    "the diagram, a tick of 1 ms: controller, plant with contact, log": 1000.0,
}
"""Median [us] on a quiet machine."""
MARGIN = 1.4
"""A guard against regressions fails beyond the budget times this, not at the budget itself: a busy neighbour takes more
from caches and memory than `slowness` sees."""


def test_a_tick_and_the_diagram_are_no_slower_than_their_bounds():
    before = slowness()
    rows = {row.name: row for row in tick_timings(tsid_entry().scenario("com_move").changed(duration=1.0), _silent)}
    slow = max(before, slowness())
    for row in rows.values():
        print(
            f"\n{row.name}: median {row.value:.0f} us, p99 {row.highest:.0f} us, n {row.n}, machine {slow:.2f} x slower"
        )
    for name, budget in BUDGET.items():
        assert rows[name].value < MARGIN * budget * slow, name


def _silent(what, share):
    pass
