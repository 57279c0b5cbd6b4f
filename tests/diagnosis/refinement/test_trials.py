"""Which stretches of the training runs the refinement follows."""

import numpy as np
import pytest

from drake_tc.diagnosis.refinement import BUDGET, longest_piece, trials_of, windows
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

RIG = parse_rig({"joint": "j", "drive": "position_servo", "load": {"pendulum": {"mass": 1.0, "length": 0.2}}})


def run_of(seconds: float, period: float = 0.01, gap: tuple[int, int] | None = None) -> Run:
    size = round(seconds / period)
    time = np.arange(size) * period
    segment = np.zeros(size, np.int64)
    if gap is not None:
        segment[gap[0] : gap[1]] = -1
        segment[gap[1] :] = 1
    columns = {"j/position": np.sin(time), "j/position_command": np.sin(time)}
    return Run(f"run{seconds:g}", None, time, period, columns, segment)


def test_short_runs_are_followed_whole():
    assert windows(run_of(6.0), 12.0, 8.0) == [slice(0, 600)]


def test_of_a_long_run_stretches_are_taken_evenly():
    found = windows(run_of(100.0), 10.0, 30.0)
    assert len(found) == 3
    assert found[0].start == 0 and found[-1].stop == 10000
    assert all(900 <= s.stop - s.start <= 1000 for s in found)


def test_no_stretch_crosses_a_gap():
    run = run_of(10.0, gap=(400, 420))
    assert windows(run, 12.0, 20.0) == [slice(0, 400), slice(420, 1000)]


@pytest.mark.parametrize("lengths", [[6.0] * 3, [100.0] * 3, [2.0, 100.0, 100.0], [200.0]])
def test_the_share_keeps_the_budget_and_wastes_none(lengths: list[float]):
    share = longest_piece(lengths, BUDGET)
    assert sum(min(share, x) for x in lengths) == pytest.approx(min(BUDGET, sum(lengths)))


def test_a_single_run_is_dealt_to_two_halves():
    found = trials_of([run_of(8.0)], RIG, "j", 2e-3)
    assert [t.run for t in found] == [0, 1]
    assert sum(t.position.size for t in found) == 800


def test_a_fast_log_is_thinned_to_the_step():
    (first, _) = trials_of([run_of(2.0, 5e-4), run_of(1.5, 5e-4)], RIG, "j", 2e-3)
    assert first.recording.period == pytest.approx(2e-3)
    assert first.position.size == first.recording.time.size == 1000
