"""Runs of different rates on one clock."""

import numpy as np
from numpy.testing import assert_allclose

from drake_tc.logs.channels import at_common_period
from drake_tc.logs.record import Run


def run(period: float, gap: bool = False) -> Run:
    time = np.arange(0.0, 4.0, period)
    segment = np.zeros(time.size, dtype=np.int64)
    if gap:
        segment[(time > 1.0) & (time < 1.5)] = -1
        segment[time >= 1.5] = 1
    return Run(f"{period:g}", None, time, period, {"joint/position": np.sin(3.0 * time)}, segment)


def test_runs_of_one_rate_are_left_alone() -> None:
    runs = (run(0.002), run(0.002))
    assert at_common_period(runs) == runs
    assert at_common_period(()) == ()


def test_the_slower_run_is_interpolated_to_the_faster_clock() -> None:
    fast, slow = at_common_period((run(0.002), run(0.005, gap=True)))
    assert fast.period == slow.period == 0.002
    # linear interpolation of sin(3 t) at 5 ms: at most (3 h)^2 / 8
    assert_allclose(slow.columns["joint/position"], np.sin(3.0 * slow.time), atol=(3.0 * 0.005) ** 2 / 8)
    steps = [np.diff(slow.time[s]) for s in slow.segments()]
    assert len(steps) == 2
    for step in steps:
        assert_allclose(step, 0.002, rtol=1e-9)
    assert not ((slow.time > 1.001) & (slow.time < 1.499)).any()
    assert "5 ms to 2 ms" in slow.notes[-1]
