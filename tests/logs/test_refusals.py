"""Logs that cannot be used are refused in one line that names the file, the place, and what to do."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drake_tc.errors import LogError, RigError
from drake_tc.logs.files.episodes import require_different_files, require_different_runs, require_two_runs
from drake_tc.logs.prepare import load_run, load_runs
from drake_tc.logs.record import Run

from .conftest import bench, refusal, servo_rig, write

TORQUE = "joint/torque"
PENDULUM = {"pendulum": {"mass": 1.0, "length": 0.2}}
CONSTANT = "is constant (0.5) in all rows"


def with_commas(values):
    return [str(value).replace(".", ",") for value in values]


def with_a_hole(times):
    return times.where((times.index < 10) | (times.index > 2000))


@pytest.mark.parametrize(
    ("change", "rig", "said"),
    [
        (lambda t: t.rename(columns={"time": "t"}), {}, "no column 'time'"),
        (lambda t: t.rename(columns={TORQUE: "Torque"}), {}, "columns: {joint/torque: Torque}"),
        (lambda t: t, {"columns": {"torque": "tau"}}, "no column 'tau' (for joint/torque)"),
        (lambda t: t, {"enabled": "off"}, "no column 'off'"),
        (lambda t: t.assign(on=0), {"enabled": "on"}, "no usable samples are left of 6000 rows"),
        (lambda t: t.assign(**{"joint/position_command": 0.5}), {"load": "unknown"}, CONSTANT),
        (lambda t: t.assign(**{"joint/position_command": 0.5}), {"load": PENDULUM}, CONSTANT),
        (lambda t: t.assign(**{"joint/current": 0.5}), {"drive": "current", "load": "torque"}, CONSTANT),
        (lambda t: t.assign(**{TORQUE: np.nan}), {}, "holds no number at all"),
        (lambda t: t.assign(**{TORQUE: 1e300}), {}, "holds no number at all"),
        (lambda t: t.assign(**{TORQUE: -1e13}), {}, "holds no number at all"),
        (lambda t: t.assign(**{TORQUE: np.inf}), {}, "holds no number at all"),
        (lambda t: t.assign(**{TORQUE: with_commas(t[TORQUE])}), {}, "row 1 (file line 2) holds"),
        (lambda t: t.assign(**{TORQUE: with_commas(t[TORQUE])}), {}, "write numbers with a decimal point"),
        (lambda t: t.head(12), {}, "only 12 usable rows"),
        (lambda t: t.assign(time=with_a_hole(t["time"])), {}, "no value in 1991 rows, first in row 11"),
        (lambda t: t.assign(time=1e3 * t["time"]), {}, "units: {time: ms}"),
        (lambda t: t.assign(time=1e6 * t["time"]), {}, "units: {time: us}"),
        (lambda t: t.assign(time=1e9 * t["time"]), {}, "units: {time: ns}"),
        (lambda t: t, {"units": {"time": "ms"}}, "it looks like s: set units: {time: s}"),
        (lambda t: t.assign(time=np.round(t["time"])), {}, "changes in 6 of 6000 rows only"),
        (
            lambda t: t.assign(time=1.5),
            {},
            "column 'time' is constant (1.5 s); expected a time stamp that increases from row to row",
        ),
        (
            lambda t: t.assign(**{"joint/velocity": t["joint/velocity"] * 30.0 / np.pi}),
            {},
            "looks like rpm; set units: {velocity: rpm}",
        ),
        (
            lambda t: t.assign(**{"joint/position": 0.3}).drop(columns="joint/velocity"),
            {},
            "'joint/position' is constant (0.3 rad) in all rows",
        ),
        (lambda t: t.assign(**{TORQUE: 0.0}), {}, "'joint/torque' is 0 in all rows while joint moves"),
        (lambda t: t.assign(**{TORQUE: 0.0}), {}, "load:"),
    ],
)
def test_one_fault_is_named(tmp_path, table, change, rig, said):
    assert said in refusal(change(table), tmp_path / "run.csv", servo_rig(**rig))


def test_missing_column_lists_what_is_there_and_near_matches(tmp_path, table):
    message = refusal(table.rename(columns={"joint/torque": "joint/torqe"}), tmp_path / "run.csv")
    assert "no column 'joint/torque'" in message
    assert "near matches: 'joint/torqe'" in message
    assert "joint/position" in message and "columns: {joint/torque: NAME_IN_FILE}" in message


def test_a_log_of_the_velocity_alone_is_told_what_it_is_enough_for(tmp_path, table):
    speeds = table.drop(columns="joint/position")
    assert "is computed from the position" in refusal(speeds, tmp_path / "a.csv")
    speeds["joint/current"] = speeds["joint/torque"]
    rig = servo_rig(drive="current", load="unknown")
    assert refusal(speeds, tmp_path / "b.csv", rig).endswith("a velocity replaces it only with load: torque")


def test_non_numeric_column_names_row_and_line(tmp_path, table):
    table["joint/torque"] = table["joint/torque"].astype(object)
    table.loc[6, "joint/torque"] = "overload"
    message = refusal(table, tmp_path / "run.csv")
    assert "'joint/torque'" in message and "row 7 (file line 8) holds 'overload'" in message


def test_time_going_backwards_names_the_row(tmp_path, table):
    swapped = table.copy()
    swapped.loc[[100, 101], "time"] = table.loc[[101, 100], "time"].to_numpy()
    message = refusal(swapped, tmp_path / "run.csv")
    assert "time goes backwards at row 102 (file line 103)" in message and "out of order" in message
    reset = table.copy()
    reset.loc[3000:, "time"] -= 2.9
    message = refusal(reset, tmp_path / "reset.csv")
    assert "row 3001" in message and "clock was reset" in message


def test_a_servo_that_is_moved_from_a_constant_goal_is_accepted_beside_a_torque_sensor(tmp_path, table):
    """Its effort, the distance from the goal, follows the measured torque."""
    stiffness = 40.0
    moved = 0.5 - table["joint/torque"] / stiffness
    table = table.assign(**{"joint/position_command": 0.5, "joint/position": moved})
    table.to_csv(tmp_path / "run.csv", index=False)
    notes = load_runs([tmp_path / "run.csv"], servo_rig(load="torque"))[0].notes
    assert "Column joint/position_command is constant: this joint was not commanded." in notes


def test_a_servo_whose_goal_was_not_recorded_is_refused_beside_a_torque_sensor(tmp_path, table):
    """It moves, but not with the torque: its true goal moved it."""
    moved = table["joint/position"] + np.linspace(0.0, 60.0, len(table)) % 1.3
    table = table.assign(**{"joint/position_command": 0.25, "joint/position": moved})
    assert "is constant (0.25) in all rows" in refusal(table, tmp_path / "run.csv")


@pytest.mark.parametrize("drive", ["position_servo", "voltage"])
def test_degrees_read_as_radians(tmp_path, table, drive):
    for name in ("joint/position", "joint/position_command", "joint/velocity"):
        table[name] = np.rad2deg(table[name])
    rig = servo_rig(drive=drive)
    message = refusal(table, tmp_path / "run.csv", rig)
    assert "looks like degrees; set units: {position: deg}" in message
    right = servo_rig(drive=drive, units={"position": "deg", "velocity": "deg/s"})
    load_run(tmp_path / "run.csv", right)


@pytest.mark.parametrize("name", ["position", "position_command"])
def test_one_angle_in_degrees_is_found_by_the_other(tmp_path, table, name):
    small = table.copy()
    for column in ("joint/position", "joint/position_command"):
        small[column] = table[column] * 0.02
    small[f"joint/{name}"] = np.rad2deg(small[f"joint/{name}"])
    message = refusal(small.drop(columns="joint/velocity"), tmp_path / "run.csv")
    assert f"'joint/{name}'" in message and "looks like degrees" in message


def test_many_turns_are_believed_when_stated(tmp_path):
    table = bench()
    turns = table["time"] * 5.0
    for name in ("joint/position", "joint/position_command"):
        table[name] += turns
    table["joint/velocity"] += 5.0
    assert "looks like degrees" in refusal(table, tmp_path / "run.csv")
    run = load_run(tmp_path / "run.csv", servo_rig(units={"position": "rad"}))
    assert np.ptp(run.columns["joint/position"]) > 25.0


def test_a_wheel_that_turns_fast_for_long_is_believed_when_stated(tmp_path):
    """1900 rpm and 900 rpm in rad: the refusal names the entry that lets the log in."""
    for speed in (200.0, 94.0):
        table = bench().drop(columns="joint/velocity")
        table["joint/position"] += speed * table["time"]
        path = tmp_path / f"at_{speed:.0f}.csv"
        assert "position: rad if it is right" in refusal(table, path, servo_rig(drive="voltage"))
        run = load_run(path, servo_rig(drive="voltage", units={"position": "rad"}))
        assert np.ptp(run.columns["joint/position"]) > 4.0 * speed


@pytest.mark.parametrize("frequencies", [(0.3,), (0.2, 0.55, 0.9)])
def test_a_position_that_is_the_rate_of_the_velocity_is_refused(tmp_path, table, frequencies):
    """Of one sine, the rate of the velocity is the position turned, so the sign would seem to be wrong."""
    time = table["time"].to_numpy()
    waves = [(2.0 * np.pi * f, 0.4 / k) for k, f in enumerate(frequencies, start=1)]
    q = sum(size * np.sin(w * time) for w, size in waves)
    v = sum(size * w * np.cos(w * time) for w, size in waves)
    right = table.assign(**{"joint/position": q, "joint/velocity": v})
    write(right, tmp_path / "right.csv")
    load_run(tmp_path / "right.csv", servo_rig(drive="voltage"))
    wrong = table.assign(**{"joint/position": v, "joint/velocity": q})
    message = refusal(wrong, tmp_path / "run.csv", servo_rig(drive="voltage"))
    assert "'joint/position' (position) is the rate of column 'joint/velocity' (velocity)" in message


def test_fewer_than_two_runs():
    with pytest.raises(LogError, match=r"at least two runs.*got 1 .*run\.csv"):
        require_two_runs(["run.csv"])
    with pytest.raises(LogError, match="got 0"):
        require_two_runs([])
    require_two_runs(["run.csv", "other.csv"])


def test_a_run_that_is_given_twice_is_refused(tmp_path):
    one, other, copy = (tmp_path / name for name in ("one.csv", "other.csv", "copy.csv"))
    one.write_text("time,a\n0,1\n")
    other.write_text("time,a\n0,2\n")
    copy.write_text(one.read_text())
    require_different_files([one], [other])
    require_different_files([one, tmp_path / "missing.csv"], [other])
    with pytest.raises(LogError, match=r"one\.csv: given as --holdout, but the same file is already given as --log"):
        require_different_files([one], [other, one])
    with pytest.raises(LogError, match=r"copy\.csv: given as --holdout, but the same content as .*one\.csv is already"):
        require_different_files([one], [copy])
    with pytest.raises(LogError, match="given as --log, but the same file is already given as --log"):
        require_different_files([one, one], [other])


def test_minutes_are_no_unit_of_time(tmp_path):
    """A clock of seconds taken for minutes would give 60 times the friction of the joint, and no other sign of it."""
    with pytest.raises(RigError, match=r"units: time: 'min' is not a unit of this quantity; possible: s, ms, us, ns"):
        servo_rig(units={"time": "min"})


def take(name: str, seed: int, size: int = 200) -> Run:
    rng = np.random.default_rng(seed)
    time = 1e-3 * np.arange(size)
    columns = {"joint/position": np.sin(time), "joint/current": rng.standard_normal(size)}
    return Run(name, Path(name), time, 1e-3, columns, np.zeros(size, dtype=np.int64))


def test_takes_of_one_motion_are_different_runs():
    require_different_runs([take("a.csv", 0), take("b.csv", 1), take("c.csv", 0, 199)])
    require_different_runs([take("a.csv", 0)])
    require_different_runs([])


@pytest.mark.parametrize("place", [0, 1, 2])
def test_the_same_samples_are_refused_and_both_files_named(place):
    runs = [take("a.csv", 0), take("b.csv", 1), take("c.csv", 2)]
    runs.insert(place, replace(runs[2], source=Path("again.npz"), name="again", time=runs[2].time + 5.0))
    with pytest.raises(LogError, match=r"holds the same samples.*remove one") as caught:
        require_different_runs(runs)
    assert "again.npz" in str(caught.value)
    assert "c.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_column_more_does_not_make_it_another_run():
    first = take("a.csv", 0)
    more = {**first.columns, "joint/temperature": np.full(len(first), 30.0)}
    with pytest.raises(LogError):
        require_different_runs([first, replace(first, source=Path("b.csv"), columns=more)])


def test_one_sample_that_differs_makes_it_another_run():
    first = take("a.csv", 0)
    current = first.columns["joint/current"].copy()
    current[100] += 1e-9
    require_different_runs([first, replace(first, columns={**first.columns, "joint/current": current})])
