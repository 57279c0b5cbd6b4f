"""Logs that cannot be used are refused in one line that names the file, the place, and what to do."""

import numpy as np
import pytest

from drake_tc.errors import LogError, RigError
from drake_tc.logs.episodes import require_different_files, require_two_runs
from drake_tc.logs.prepare import load_run, load_runs
from drake_tc.logs.rig import parse_rig

from .conftest import bench, servo_rig, write


def refusal(table, path, rig=None) -> str:
    write(table, path)
    with pytest.raises(LogError) as caught:
        load_run(path, rig or servo_rig())
    message = str(caught.value)
    assert message.startswith(str(path)) and "\n" not in message
    return message


def test_missing_column_lists_what_is_there_and_near_matches(tmp_path, table):
    message = refusal(table.rename(columns={"joint/torque": "joint/torqe"}), tmp_path / "run.csv")
    assert "no column 'joint/torque'" in message
    assert "near matches: 'joint/torqe'" in message
    assert "joint/position" in message and "columns: {joint/torque: NAME_IN_FILE}" in message


def test_a_bare_canonical_name_is_offered_as_the_column(tmp_path, table):
    message = refusal(table.rename(columns={"joint/torque": "Torque"}), tmp_path / "run.csv")
    assert message.endswith("columns: {joint/torque: Torque}")


def test_a_log_of_the_velocity_alone_is_told_what_it_is_enough_for(tmp_path, table):
    speeds = table.drop(columns="joint/position")
    assert "is computed from the position" in refusal(speeds, tmp_path / "a.csv")
    speeds["joint/current"] = speeds["joint/torque"]
    rig = servo_rig(drive="current", load="unknown")
    assert refusal(speeds, tmp_path / "b.csv", rig).endswith("a velocity replaces it only with load: torque")


def test_missing_time_and_mapped_column(tmp_path, table):
    assert "no column 'time'" in refusal(table.rename(columns={"time": "t"}), tmp_path / "a.csv")
    rig = servo_rig(columns={"torque": "tau"})
    assert "no column 'tau' (for joint/torque)" in refusal(table, tmp_path / "b.csv", rig)


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


@pytest.mark.parametrize("load", ["unknown", {"pendulum": {"mass": 1.0, "length": 0.2}}])
def test_constant_command(tmp_path, table, load):
    """What moves the joint is then a torque that the balance lacks."""
    still = table.assign(**{"joint/position_command": 0.5})
    assert "is constant (0.5) in all rows" in refusal(still, tmp_path / "r.csv", servo_rig(load=load))


def test_constant_current(tmp_path, table):
    rig = parse_rig({"joint": "joint", "drive": "current", "load": "torque"})
    assert "is constant (0.5) in all rows" in refusal(table.assign(**{"joint/current": 0.5}), tmp_path / "c.csv", rig)


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


def test_empty_column(tmp_path, table):
    assert "holds no number at all" in refusal(table.assign(**{"joint/torque": np.nan}), tmp_path / "run.csv")


def test_too_few_rows(tmp_path, table):
    assert "only 12 usable rows" in refusal(table.head(12), tmp_path / "run.csv")


def test_time_missing_in_many_rows(tmp_path, table):
    table.loc[10:2000, "time"] = np.nan
    assert "no value in 1991 rows, first in row 11" in refusal(table, tmp_path / "run.csv")


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_time_in_another_unit(tmp_path, table, factor, unit):
    table["time"] *= factor
    assert f"units: {{time: {unit}}}" in refusal(table, tmp_path / "run.csv")


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


def test_velocity_in_another_unit(tmp_path, table):
    table["joint/velocity"] *= 60 / (2 * np.pi)
    assert "looks like rpm; set units: {velocity: rpm}" in refusal(table, tmp_path / "run.csv")


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


def test_fewer_than_two_runs(tmp_path, table):
    write(table, tmp_path / "run.csv")
    runs = load_runs([tmp_path / "run.csv"], servo_rig())
    with pytest.raises(LogError, match=r"at least two runs.*got 1 .*run\.csv"):
        require_two_runs(runs)
    with pytest.raises(LogError, match="got 0"):
        require_two_runs([])
    require_two_runs([*runs, *runs])


def test_everything_switched_off(tmp_path, table):
    rig = servo_rig(enabled="on")
    assert "no usable samples are left of 6000 rows" in refusal(table.assign(on=0), tmp_path / "run.csv", rig)
    assert "no column 'off'" in refusal(table, tmp_path / "run.csv", servo_rig(enabled="off"))


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


@pytest.mark.parametrize("value", [1e300, -1e13, np.inf])
def test_numbers_that_no_sensor_reads_are_missing(tmp_path, table, value):
    assert "holds no number at all" in refusal(table.assign(**{"joint/torque": value}), tmp_path / "run.csv")


def test_decimal_commas(tmp_path, table):
    table["joint/torque"] = [str(value).replace(".", ",") for value in table["joint/torque"]]
    message = refusal(table, tmp_path / "run.csv")
    assert "row 1 (file line 2) holds" in message and "write numbers with a decimal point" in message


def test_a_constant_time(tmp_path, table):
    table["time"] = 1.5
    message = refusal(table, tmp_path / "run.csv")
    assert "column 'time' is constant (1.5 s); expected a time stamp that increases from row to row" in message


def test_a_time_of_few_digits(tmp_path, table):
    table["time"] = np.round(table["time"])
    assert f"changes in {int(table['time'].max())} of {len(table)} rows only" in refusal(table, tmp_path / "run.csv")


def test_minutes_are_no_unit_of_time(tmp_path):
    """A clock of seconds taken for minutes would give 60 times the friction of the joint, and no other sign of it."""
    with pytest.raises(RigError, match=r"units: time: 'min' is not a unit of it; possible: s, ms, us, ns"):
        servo_rig(units={"time": "min"})


def test_the_unit_of_time_that_fits_is_named_beside_the_stated_one(tmp_path, table):
    message = refusal(table, tmp_path / "run.csv", servo_rig(units={"time": "ms"}))
    assert "it looks like s: set units: {time: s}" in message
