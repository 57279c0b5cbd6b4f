"""A table whose rows hold the columns of one sender each gives what each sender measured; runs come to one rate."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from drake_tc.logs.channels import at_common_period
from drake_tc.logs.prepare import load_run
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

PERIOD = 5e-3
STEP = 1e-3
T = PERIOD * np.arange(1600)
RIG = {"joint": "joint", "drive": "current"}


def load(t):
    return 4.0 * np.sin(2.7 * t)


def current(t):
    acceleration = -0.6 * 4.0 * np.sin(2.0 * t)
    velocity = 1.2 * np.cos(2.0 * t)
    return 0.1 * (load(t) + 0.3 * acceleration + 2.0 * velocity + 1.5 * np.tanh(50.0 * velocity))


def position(t):
    return STEP * np.round(0.6 * np.sin(2.0 * t) / STEP)


def parts(late):
    return [
        pd.DataFrame({"time": T, "joint/position": position(T)}),
        pd.DataFrame({"time": T + late, "joint/current": current(T + late)}),
        pd.DataFrame({"time": T + 2.0 * late, "joint/torque": load(T + 2.0 * late)}),
    ]


def mixed(folder, tables, **rig):
    """The run of a table that has the rows of all these tables in the order of their times."""
    pd.concat(tables).sort_values("time", kind="stable").to_csv(folder / "run.csv", index=False)
    return load_run(folder / "run.csv", parse_rig(RIG | rig))


@pytest.mark.parametrize("late", [0.0007, 0.0, 0.0024])
def test_the_rows_of_the_position_are_the_samples(tmp_path, late):
    run = mixed(tmp_path, parts(late))
    assert run.period == pytest.approx(PERIOD, rel=1e-6)
    assert run.steps["joint/position"] == pytest.approx(STEP, rel=1e-6)
    inside = (run.segment >= 0) & (run.time > 0.02)
    assert inside.sum() > 0.98 * T.size
    assert_allclose(run.columns["joint/position"][inside], position(run.time[inside]), rtol=0, atol=1e-9)
    # linear interpolation errs by h^2/8 of the second derivative
    bend = PERIOD**2 / 8.0
    assert_allclose(run.columns["joint/torque"][inside], load(run.time[inside]), rtol=0, atol=1.1 * bend * 4.0 * 2.7**2)
    assert "the 1600 rows with a position are the samples" in " ".join(run.notes)


def test_a_command_on_rows_of_its_own_is_held(tmp_path):
    goal = position(T) + 0.002 * 10.0 * current(T)
    slow = slice(None, None, 4)
    tables = [
        pd.DataFrame({"time": T, "joint/position": position(T)}),
        pd.DataFrame({"time": T[slow] + 0.001, "joint/position_command": goal[slow]}),
        pd.DataFrame({"time": T + 0.001, "joint/torque": load(T + 0.001)}),
    ]
    run = mixed(tmp_path, tables, drive="position_servo")
    rows = np.flatnonzero(run.segment >= 0)
    row = np.round(run.time[rows] / PERIOD).astype(int)
    expected = goal[np.maximum((row - 1) // 4, 0) * 4]
    assert_allclose(run.columns["joint/position_command"][rows][8:], expected[8:], rtol=0, atol=1e-9)


def test_a_hole_is_not_filled(tmp_path):
    first, second, third = parts(0.0007)
    third = third[(third["time"] < 3.0) | (third["time"] > 4.0)]
    run = mixed(tmp_path, [first, second, third])
    hole = (run.time > 3.02) & (run.time < 3.98)
    assert (run.segment[hole] < 0).all()


def test_missing_values_of_one_clock_stay_missing_values(tmp_path):
    table = pd.DataFrame({"time": T, "joint/position": position(T), "joint/current": current(T)})
    table["joint/torque"] = load(T)
    table.loc[::3, "joint/position"] = np.nan
    run = mixed(tmp_path, [table])
    assert "are the samples" not in " ".join(run.notes) and "missing values were interpolated" in " ".join(run.notes)


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
