"""A sound log with one fault gives a result within the interval of the sound log, or is refused.

Faults: those of `FAULTS`, one in each log. Figures: the drive gain, viscous and Coulomb friction. One fault cannot be
mended in full: rows that a saturated sensor cut are lost, and what is left of the log is less than the sound log. There
the result has to be that of the sound log without these rows, which nothing that reads the damaged log can improve on.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from drake_tc.errors import IdentificationError, LogError
from drake_tc.identification.identify import identify
from drake_tc.logs.checks.jumps import repeated_rows
from drake_tc.logs.prepare import load_run, load_runs

from .conftest import bench, servo_rig, write

RIG = servo_rig(declared={"rotor_inertia": 0.3})
SEEDS = [pytest.param(seed, marks=[pytest.mark.slow] if seed > 1 else []) for seed in range(8)]


def recording() -> pd.DataFrame:
    """Encoder, command and torque sensor with noise and steps; no velocity, which would give an error away."""
    rng = np.random.default_rng(5)
    table = bench(5.0, period=2e-3).drop(columns=["joint/velocity", "joint/voltage", "joint/temperature"])
    table["joint/position"] = 1e-5 * np.round((table["joint/position"] + 5e-6 * rng.standard_normal(len(table))) / 1e-5)
    table["joint/torque"] += 0.1 * rng.standard_normal(len(table))
    return table


SIGNALS = ("joint/position", "joint/position_command", "joint/torque")
MEASURED = ("joint/position", "joint/torque")


def spike(table, rng):
    """One to three rows that are far off."""
    name, at, width = rng.choice(MEASURED), rng.integers(5, len(table) - 5), rng.integers(1, 4)
    size = rng.choice([3.0, 30.0, 1e3]) * np.ptp(table[name]) * rng.choice([-1.0, 1.0])
    table.loc[at : at + width - 1, name] += size


def turn(table, rng):
    """An angle jumps by a turn and stays, or comes back."""
    at, width = rng.integers(5, len(table) - 5), rng.choice([1, 2, 700, len(table)])
    name = rng.choice(["joint/position", "joint/position_command"])
    table.loc[at : at + width - 1, name] += 2.0 * np.pi * rng.choice([-2, -1, 1])


def wild(table, rng):
    """One value that is no number of this world."""
    value = rng.choice([1e9, -1e30, 1e300, np.inf, -np.inf, np.nan, 65535.0, -32768.0])
    table.loc[rng.integers(5, len(table) - 5), rng.choice(MEASURED)] = value


def moderate(table, rng):
    """One torque that is off by a tenth of its range to all of it: no repair need see it, no fit may follow it."""
    table.loc[rng.integers(5, len(table) - 5), "joint/torque"] += rng.uniform(-1.0, 1.0) * np.ptp(table["joint/torque"])


def repeated(table, rng):
    """Rows are there twice."""
    at, count = rng.integers(5, len(table) - 200), rng.integers(1, 100)
    return pd.concat([table[: at + count], table[at:]], ignore_index=True)


def held(table, rng):
    """The logger repeats the last values under new times."""
    at, count = rng.integers(5, len(table) - 200), rng.integers(2, 150)
    for name in SIGNALS:
        table.loc[at : at + count, name] = table.loc[at, name]


def clock(table, rng):
    """The clock steps."""
    table.loc[rng.integers(5, len(table) - 5) :, "time"] += rng.choice([-3.0, -0.1, 0.005, 0.02, 0.5, 60.0, 3600.0])


def dropped(table, rng):
    """Rows are lost."""
    at, count = rng.integers(5, len(table) - 500), rng.integers(1, 400)
    return table.drop(index=range(at, at + count)).reset_index(drop=True)


def blank(table, rng):
    """A channel has no values for a while."""
    at, count = rng.integers(5, len(table) - 500), rng.integers(1, 400)
    table.loc[at : at + count, rng.choice(SIGNALS)] = np.nan


def zero(table, rng):
    """A sensor or the logger gives 0 for a while."""
    at, count = rng.integers(5, len(table) - 500), rng.integers(1, 400)
    table.loc[at : at + count, rng.choice(SIGNALS)] = 0.0


def saturated(table, rng):
    """A sensor at the end of its range, on both sides or on one."""
    name = rng.choice(MEASURED)
    limit = rng.uniform(0.4, 0.9) * np.abs(table[name]).max()
    table[name] = table[name].clip(rng.choice([-limit, -np.inf]), limit)


def exchanged(table, rng):
    """Two columns stand under each other's name."""
    one, other = rng.choice(SIGNALS, 2, replace=False)
    table[[one, other]] = table[[other, one]].to_numpy()


def turned(table, rng):
    """A column has the wrong sign."""
    table[rng.choice(SIGNALS)] *= -1.0


def unit(table, rng):
    """A column is in another unit than the rig file says."""
    name = rng.choice(SIGNALS)
    angle, torque = (180.0 / np.pi, np.pi / 180.0), (1e3, 1e-3, 10.1972, 8.85075)
    table[name] *= rng.choice(torque if name == "joint/torque" else angle)


def ticks(table, rng):
    """The clock counts ms, us or ns."""
    table["time"] *= rng.choice([1e3, 1e6, 1e9])


def reversed_time(table, rng):
    """Time stamps run backwards, throughout or for a while."""
    at, count = rng.choice([(0, len(table)), (1000, 300)])
    table.loc[at : at + count - 1, "time"] = table["time"].to_numpy()[at : at + count][::-1]


def long_blank(table, rng):
    """A channel has no values for seconds."""
    at, count = rng.integers(5, len(table) - 1500), rng.integers(400, 1200)
    table.loc[at : at + count, rng.choice(SIGNALS)] = np.nan


FAULTS: dict[str, Callable] = {
    each.__name__: each
    for each in (
        *(spike, turn, wild, moderate, repeated, held, clock, dropped, blank),
        *(zero, saturated, exchanged, turned, unit, ticks, reversed_time, long_blank),
    )
}
TOLD = (spike, turn, wild, zero, saturated, turned, long_blank)
"""What is not mended without a word."""


def with_fault(fault, rng, path):
    table = recording()
    changed = fault(table, rng)
    return write(table if changed is None else changed, path)


@pytest.fixture(scope="module")
def sound_run(tmp_path_factory):
    return load_run(write(recording(), tmp_path_factory.mktemp("sound") / "run.csv"), RIG)


@pytest.fixture(scope="module")
def sound(sound_run):
    return identify([sound_run], RIG)


def test_the_sound_result_is_right(sound):
    """Within its interval, or within a percent where the smoothing of the sign of the velocity is more."""
    truth = {"K_tau": 2e-3, "K_v": 4e-3, "K_c": 3e-3}
    for name, value in truth.items():
        low, high = sound.intervals[name]
        slack = 0.02 * value
        assert low - slack <= value <= high + slack


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("fault", FAULTS)
def test_one_fault_changes_no_result_beyond_the_interval_of_the_sound_one(sound, sound_run, tmp_path, fault, seed):
    rng = np.random.default_rng([seed, list(FAULTS).index(fault)])
    try:
        run = load_run(with_fault(FAULTS[fault], rng, tmp_path / "run.csv"), RIG)
        found = identify([run], RIG)
    except (LogError, IdentificationError):
        return
    outside = [name for name, (low, high) in sound.intervals.items() if not low <= found.parameters[name] <= high]
    if outside:
        assert FAULTS[fault] is saturated, outside
        assert_is_of_the_rows_that_are_left(found, run, sound, sound_run)
    assert run.notes or FAULTS[fault] not in TOLD


def assert_is_of_the_rows_that_are_left(found, run, sound, sound_run):
    """The result is that of the sound log without the rows that were left out, and agrees with that of all rows."""
    assert np.array_equal(run.time, sound_run.time)
    fewer = identify([replace(sound_run, segment=run.segment)], RIG)
    for name, interval in sound.intervals.items():
        width = 0.5 * np.ptp(interval)
        assert found.parameters[name] == pytest.approx(fewer.parameters[name], abs=0.05 * width), name
        widths = width + 0.5 * np.ptp(found.intervals[name])
        assert abs(found.parameters[name] - sound.parameters[name]) <= widths, name


@pytest.mark.parametrize(("at", "count"), [(1918, 149), (1922, 143)])
def test_a_logger_that_repeats_itself_while_the_joint_turns_round(sound, tmp_path, at, count):
    """The speeds before and after differ in sign, so that they do not tell how far the joint went meanwhile."""
    table = recording()
    for name in SIGNALS:
        table.loc[at : at + count, name] = table.loc[at, name]
    run = load_run(write(table, tmp_path / "run.csv"), RIG)
    found = identify([run], RIG)
    assert any(f"repeats an earlier value in {count} rows" in note for note in run.notes)
    for name, (low, high) in sound.intervals.items():
        assert low <= found.parameters[name] <= high, name


def test_a_joint_that_rests_in_all_channels_is_no_logger_that_repeats_itself():
    """Rest, and then as fast as ever: no leap. A leap of twice the fastest step is one."""
    moving = np.cumsum(np.full(100, 0.01))
    torque = 5.0 * np.sin(moving * 30.0)
    rest = [np.concatenate([each, np.full(50, each[-1])]) for each in (moving, torque)]
    on = np.concatenate([rest[0], rest[0][-1] + moving]), np.concatenate([rest[1], torque])
    assert not repeated_rows(on[0], on[1:]).any()
    leap = np.concatenate([rest[0], rest[0][-1] + 0.02 + moving])
    assert np.flatnonzero(repeated_rows(leap, on[1:])).tolist() == list(range(100, 150))
    assert not repeated_rows(leap, []).any()


def test_faults_are_repaired_far_more_often_than_refused(sound, tmp_path):
    """The property above would hold of a library that refuses every log."""
    refused, beyond_repair = 0, {exchanged, unit, ticks, reversed_time}
    for number, fault in enumerate(fault for fault in FAULTS.values() if fault not in beyond_repair):
        try:
            load_run(with_fault(fault, np.random.default_rng([0, number]), tmp_path / "run.csv"), RIG)
        except LogError:
            refused += 1
    assert refused <= len(FAULTS) // 4


def test_a_run_of_another_joint_among_the_logs_is_refused(tmp_path):
    other = recording()
    effort = other["joint/position_command"] - other["joint/position"]
    other["joint/position_command"] = other["joint/position"] + 3.0 * effort
    paths = [write(recording(), tmp_path / "one.csv"), write(other, tmp_path / "other.csv")]
    with pytest.raises(
        LogError, match=r"other\.csv: the runs are not of one joint: the effort for 1 N m .* in other and .* in one;"
    ):
        load_runs(paths, RIG)
    load_runs([paths[0], paths[0]], RIG)
