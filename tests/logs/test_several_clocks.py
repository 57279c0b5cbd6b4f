"""A table whose rows hold the columns of one sender each gives what each sender measured, at the position's times."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from drake_tc.logs.prepare import load_run
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


@pytest.mark.parametrize("late", [0.0007, 0.0, 0.0024])
def test_the_rows_of_the_position_are_the_samples(tmp_path, late):
    pd.concat(parts(late)).sort_values("time", kind="stable").to_csv(tmp_path / "run.csv", index=False)
    run = load_run(tmp_path / "run.csv", parse_rig(RIG))
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
    pd.concat(tables).sort_values("time", kind="stable").to_csv(tmp_path / "run.csv", index=False)
    run = load_run(tmp_path / "run.csv", parse_rig({"joint": "joint", "drive": "position_servo"}))
    rows = np.flatnonzero(run.segment >= 0)
    row = np.round(run.time[rows] / PERIOD).astype(int)
    expected = goal[np.maximum((row - 1) // 4, 0) * 4]
    assert_allclose(run.columns["joint/position_command"][rows][8:], expected[8:], rtol=0, atol=1e-9)


def test_a_hole_is_not_filled(tmp_path):
    first, second, third = parts(0.0007)
    third = third[(third["time"] < 3.0) | (third["time"] > 4.0)]
    pd.concat([first, second, third]).sort_values("time", kind="stable").to_csv(tmp_path / "run.csv", index=False)
    run = load_run(tmp_path / "run.csv", parse_rig(RIG))
    hole = (run.time > 3.02) & (run.time < 3.98)
    assert (run.segment[hole] < 0).all()


def test_missing_values_of_one_clock_stay_missing_values(tmp_path):
    table = pd.DataFrame({"time": T, "joint/position": position(T), "joint/current": current(T)})
    table["joint/torque"] = load(T)
    table.loc[::3, "joint/position"] = np.nan
    table.to_csv(tmp_path / "run.csv", index=False)
    run = load_run(tmp_path / "run.csv", parse_rig(RIG))
    assert "are the samples" not in " ".join(run.notes) and "missing values were interpolated" in " ".join(run.notes)
