"""Of position, command and torque any may have the wrong sign, and the notes say which; an effort may have none."""

from itertools import chain, combinations

import numpy as np
import pytest

from drake_tc.errors import LogError
from drake_tc.identification.identify import identify
from drake_tc.logs.checks.mistaken_columns import is_unsigned
from drake_tc.logs.prepare import load_run, load_runs

from .conftest import bench, servo_rig, write

COMMANDS = {"position_servo": "joint/position_command", "voltage": "joint/voltage"}
NUMBERS = range(3)
SETS = tuple(chain.from_iterable(combinations(NUMBERS, count) for count in range(1, 4)))


def columns_of(drive: str) -> list[str]:
    return ["joint/position", COMMANDS[drive], "joint/torque"]


@pytest.fixture(scope="module", params=COMMANDS)
def sound(request, tmp_path_factory):
    rig = servo_rig(drive=request.param, declared={"rotor_inertia": 0.3})
    path = write(bench(5.0, 2e-3), tmp_path_factory.mktemp("sound") / "run.csv")
    return request.param, rig, identify([load_run(path, rig)], rig).parameters


@pytest.mark.parametrize("velocity", [False, True])
@pytest.mark.parametrize("turned", SETS)
def test_wrong_signs_change_no_result(sound, tmp_path, turned, velocity):
    drive, rig, parameters = sound
    table = bench(5.0, 2e-3)
    table = table if velocity else table.drop(columns="joint/velocity")
    for number in turned:
        table[columns_of(drive)[number]] *= -1.0
    path = write(table, tmp_path / "run.csv")
    if drive == "voltage" and turned in ((0,), (1, 2)):
        # the same columns mean exchanged ones, with another model
        with pytest.raises(
            LogError, match=r"run\.csv: friction and inertia of joint would drive it: column 'joint/pos"
        ):
            load_run(path, rig)
        return
    run = load_run(path, rig)
    assert identify([run], rig).parameters == pytest.approx(parameters, rel=1e-9)
    told = [name for name in columns_of(drive) if any(f"{name} has the wrong sign" in note for note in run.notes)]
    left = [columns_of(drive)[number] for number in NUMBERS if number not in turned]
    named = {1: [columns_of(drive)[turned[0]]], 2: left, 3: []}[len(turned)]
    assert told == named


def test_the_velocity_is_turned_with_its_position(tmp_path):
    table = bench(5.0, 2e-3)
    table["joint/position"] *= -1.0
    rig = servo_rig()
    run = load_run(write(table, tmp_path / "run.csv"), rig)
    truth = bench(5.0, 2e-3)
    for name in ("joint/position", "joint/velocity"):
        assert run.columns[name] == pytest.approx(truth[name].to_numpy(), abs=1e-12)


def test_a_delay_is_not_taken_for_a_turned_position(tmp_path):
    """A command that is logged late makes friction seem to drive the joint; inertia keeps its sign."""
    for rows in (3, 10, 25):
        table = bench(5.0, 2e-3)
        table["joint/voltage"] = table["joint/voltage"].shift(rows)
        (run,) = load_runs([write(table.iloc[rows:], tmp_path / "run.csv")], servo_rig(drive="voltage"))
        assert not any("wrong sign" in note for note in run.notes)


def test_a_command_that_is_held_over_several_rows_is_not_taken_for_a_noisy_position(tmp_path):
    """A topic slower than the states, logged late: the position leads, and the command is a staircase without noise."""
    table = bench(5.0, 2e-3)
    held = table["joint/position_command"].iloc[::5].reindex(table.index).ffill()
    table["joint/position_command"] = held.shift(60).bfill()
    table["joint/position"] = (table["joint/position"] / 1e-4).round() * 1e-4
    (run,) = load_runs([write(table, tmp_path / "run.csv")], servo_rig(load="unknown"))
    assert run.columns["joint/position_command"] == pytest.approx(table["joint/position_command"].to_numpy(), abs=1e-12)


def test_an_absolute_value_is_refused(tmp_path):
    table = bench(5.0, 2e-3)
    table["joint/voltage"] = table["joint/voltage"].abs()
    with pytest.raises(LogError, match=r"run\.csv: column 'joint/voltage' of joint seems to be an absolute value"):
        load_runs([write(table, tmp_path / "run.csv")], servo_rig(drive="voltage"))


def balance(offset: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Effort, load and motion of a joint with friction and noise; `offset` is a constant part of the load [N m]."""
    t = np.arange(0.0, 10.0, 4e-3)
    q, velocity, acceleration = np.sin(2.0 * t), 2.0 * np.cos(2.0 * t), -4.0 * np.sin(2.0 * t)
    load = offset + 2.0 * np.sin(q + 0.3)
    others = np.column_stack([acceleration, velocity, np.sign(velocity), np.ones(t.size)])
    noise = np.random.default_rng(0).normal(0.0, 0.1, t.size)
    return 0.5 * (load + others @ np.array([0.1, 0.1, 0.5, 0.0]) + noise), load, others


def test_an_effort_of_one_sign_is_no_absolute_value():
    effort, load, others = balance(4.0)
    assert effort.min() > 0.0
    assert not is_unsigned(effort, load, others)


def test_a_brake_that_never_pulls_is_no_absolute_value():
    """The effort is cut off at 0 in half of the motion."""
    effort, load, others = balance(0.0)
    assert not is_unsigned(np.maximum(effort, 0.0), load, others)
    assert is_unsigned(np.abs(effort), load, others)
