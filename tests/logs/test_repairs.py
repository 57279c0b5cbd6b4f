"""What can be mended is mended as the notes say, and a sound log passes through unchanged."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from drake_tc.errors import LogError
from drake_tc.logs.channels import hold_period, release_hold, saturated_share
from drake_tc.logs.prepare import load_runs

from .conftest import PERIOD, bench, load, noted, servo_rig, write


def test_a_sound_log_passes_through_unchanged(tmp_path, table):
    run = load(table, tmp_path)
    assert run.notes == ()
    assert run.period == PERIOD and len(run) == len(table)
    for name, values in run.columns.items():  # 17 digits of text
        assert_allclose(values, table[name], rtol=1e-15, atol=1e-15)
    assert_array_equal(run.segment, 0)


@pytest.mark.parametrize("rate", [60.0, 187.3, 1000.0, 5000.0])
def test_rates(tmp_path, rate):
    run = load(bench(seconds=3.0, period=1.0 / rate), tmp_path)
    assert_allclose(run.period, 1.0 / rate, rtol=1e-8)  # the clock is exact but for nine digits
    assert run.notes == ()


def test_time_stamps_rounded_to_a_millisecond_do_not_bias_the_period(tmp_path):
    table = bench(period=1.0 / 187.3)
    position = table["joint/position"].to_numpy()
    table["time"] = table["time"].round(3)
    run = load(table, tmp_path)
    assert_allclose(run.period, 1.0 / 187.3, rtol=1e-3)  # half a millisecond over 6 s
    assert_array_equal(run.columns["joint/position"], position)


def test_repeated_rows_are_dropped(tmp_path, table):
    doubled = pd.concat([table.iloc[:500], table.iloc[499:500], table.iloc[500:]])
    run = load(doubled, tmp_path)
    assert noted(run, "1 rows that repeat a time stamp were dropped, the first of them row 501")
    assert_allclose(run.columns["joint/position"], table["joint/position"], rtol=1e-12)


def test_jitter_is_stated_and_interpolated(tmp_path):
    exact = bench()
    rng = np.random.default_rng(1)
    time = exact["time"].to_numpy() + rng.uniform(-3e-4, 3e-4, len(exact))
    shaken = exact.copy()
    for name in exact.columns[1:]:
        shaken[name] = np.interp(time, exact["time"], exact[name])
    shaken["time"] = time
    run = load(shaken, tmp_path)
    assert noted(run, "The clock jitters") and noted(run, "uniform clock")
    assert_allclose(np.diff(run.time), run.period, rtol=1e-6)  # rounding of sums of the period
    truth = np.interp(run.time, exact["time"], exact["joint/position"])
    # linear interpolation errs by at most qddot h^2/8 each time: 5 rad/s^2 (1.6 ms)^2/8
    assert_allclose(run.columns["joint/position"][2:-2], truth[2:-2], rtol=0, atol=2e-6)


def test_lost_rows_are_interpolated_and_gaps_split(tmp_path, table):
    holes = table.drop(index=[1000, 1001, 2000, *range(4000, 4100)])
    run = load(holes, tmp_path)
    assert noted(run, "3 lost rows") and noted(run, "1 gap of more than 5 periods")
    assert len(list(run.segments())) == 2
    assert len(run) == len(table) - 100
    assert_allclose(run.columns["joint/position"][1001], table["joint/position"][1001], rtol=0, atol=2e-6)
    assert np.all(np.diff(run.time) > 0)


def test_missing_values_short_and_long(tmp_path, table):
    table.loc[100:102, "joint/torque"] = np.nan
    table.loc[3000:3099, "joint/position"] = np.nan
    run = load(table, tmp_path)
    assert noted(run, "Column joint/torque: 3 missing values were interpolated")
    assert noted(run, "Column joint/position: 100 rows of long holes were left out (the first: row 3001)")
    assert_array_equal(np.flatnonzero(run.segment < 0), np.arange(3000, 3100))
    assert np.isfinite(run.columns["joint/position"]).all()


def test_optional_column_without_numbers_is_left_out(tmp_path, table):
    run = load(table.assign(**{"joint/temperature": np.nan}), tmp_path)
    assert "joint/temperature" not in run.columns and noted(run, "'joint/temperature' holds no number")


def test_temperature_once_a_second_costs_no_rows(tmp_path, table):
    warm = table["joint/temperature"].to_numpy().copy()
    table.loc[table.index % 1000 != 0, "joint/temperature"] = np.nan
    run = load(table, tmp_path)
    assert (run.segment == 0).all() and noted(run, "has a value every 1000 rows")
    assert_allclose(run.columns["joint/temperature"][:5001], warm[:5001], rtol=1e-9)  # linear in time, as here


def test_optional_column_that_is_mostly_missing_costs_no_rows(tmp_path, table):
    table.loc[1000:, "joint/velocity"] = np.nan
    run = load(table, tmp_path)
    assert "joint/velocity" not in run.columns and (run.segment == 0).all()
    assert noted(run, "Column joint/velocity is missing in 83 % of the rows and was left out")


@pytest.mark.parametrize("off", [0, False, "off"])
def test_drive_switched_off(tmp_path, table, off):
    on = "on" if off == "off" else type(off)(1)
    table["power"] = [on if not 2000 <= i < 2500 else off for i in range(len(table))]
    run = load(table, tmp_path, enabled="power")
    assert noted(run, "500 rows with the drive switched off")
    assert_array_equal(np.flatnonzero(run.segment < 0), np.arange(2000, 2500))


@pytest.mark.parametrize("condition", ["clear", "height > 0.02", ["height >= -1", "height > 0.02"]])
def test_samples_that_are_not_valid(tmp_path, table, condition):
    table["height"] = np.where((table.index >= 2000) & (table.index < 2500), 0.02, 0.1)
    table["clear"] = (table["height"] > 0.02).astype(float)
    run = load(table, tmp_path, valid=condition)
    assert run.notes == ("500 rows were left out because the rig's `valid` does not hold there.",)
    assert_array_equal(np.flatnonzero(run.segment < 0), np.arange(2000, 2500))
    assert_allclose(run.columns["joint/position"], table["joint/position"], rtol=1e-15, atol=1e-15)


def test_a_missing_value_is_not_valid(tmp_path, table):
    table["height"] = 0.1
    table.loc[100:199, "height"] = np.nan
    run = load(table, tmp_path, valid="height < 0.2")
    assert_array_equal(np.flatnonzero(run.segment < 0), np.arange(100, 200))


def test_a_column_of_valid_that_the_log_does_not_have(tmp_path, table):
    with pytest.raises(LogError, match=r"no column 'tip' \(for valid\).*correct the key `valid`"):
        load(table, tmp_path, valid="tip > 0")


def test_command_that_copies_the_position_is_torque_off(tmp_path, table):
    table.loc[2000:2999, "joint/position_command"] = table.loc[2000:2999, "joint/position"]
    run = load(table, tmp_path)
    assert noted(run, "1000 rows in which the command of joint copies its moving position (torque off)")
    assert_array_equal(run.segment[2000:3000], -1)


def test_frozen_torque_is_left_out(tmp_path, table):
    table.loc[3000:3299, "joint/torque"] = table.loc[3000, "joint/torque"]
    run = load(table, tmp_path)
    assert noted(run, "Column joint/torque is frozen in 300 rows (the first: row 3001)")
    assert_array_equal(np.flatnonzero(run.segment < 0), np.arange(3000, 3300))


def test_an_encoder_at_rest_is_not_frozen(tmp_path, table):
    table["joint/position"] = table["joint/position"].clip(-0.3, 0.3)
    assert not noted(load(table, tmp_path), "frozen")


@pytest.mark.parametrize(("hold", "told"), [(100, False), (250, True)])
def test_a_torque_below_5_hz_makes_long_filters_and_a_note_says_so(tmp_path, hold, told):
    """Of a log at 1 kHz: 10 Hz and 4 Hz."""
    table = bench(30.0)
    torque = table["joint/torque"].to_numpy()
    run = load(table.assign(**{"joint/torque": np.repeat(torque[::hold], hold)[: torque.size]}), tmp_path)
    assert noted(run, "All channels are filtered over four of its periods, 1 s") == told


def test_channel_on_a_slower_clock(tmp_path, table):
    smooth = 8.0 * np.sin(3.1 * table["time"].to_numpy() + 1.0)
    table["joint/torque"] = np.repeat(smooth[::5], 5)
    run = load(table, tmp_path)
    assert noted(run, "joint/torque was sampled on a clock 5 times slower")
    assert run.slower == {"joint/torque": 5 * run.period}
    # held: 25 N m/s * 4 ms = 0.1 off; interpolated: 77 N m/s^2 (5 ms)^2/8
    assert_allclose(run.columns["joint/torque"][:-5], smooth[:-5], rtol=0, atol=3e-4)
    table["joint/position_command"] = np.repeat(table["joint/position_command"].to_numpy()[::5], 5)
    run = load(table, tmp_path)
    assert noted(run, "a command that is held")
    assert set(run.slower) == {"joint/torque"}
    assert_allclose(run.columns["joint/position_command"], table["joint/position_command"], rtol=1e-12)


def test_a_coarse_encoder_is_no_slow_clock(table):
    for bits in (10, 12, 14):
        step = 2 * np.pi / 2**bits
        position = np.round(table["joint/position"].to_numpy() / step) * step
        assert hold_period(table["time"].to_numpy(), position) == 1.0


def test_a_coarse_encoder_on_a_ramp_is_no_slow_clock():
    ramp = np.arange(5000) * 1e-3
    assert hold_period(ramp, np.round(ramp / 5e-3) * 5e-3) == 1.0
    assert hold_period(ramp, np.repeat(np.sin(ramp[::5]), 5)) == 5.0


def sampled_by(topic_hz: float, rng, *, log_hz: float = 200.0, lost: float = 0.0, jitter: float = 0.0):
    """Times of the rows that were not lost, a torque held from a topic of its own clock, and the torque itself."""
    written = (np.arange(int(30 * topic_hz) + 2) - 0.7) / topic_hz
    written += jitter / topic_hz * rng.uniform(-1.0, 1.0, written.size)
    time = np.arange(int(30 * log_hz)) / log_hz
    time = time[rng.uniform(size=time.size) >= lost]
    last = np.searchsorted(written, time, side="right") - 1
    return (
        time,
        np.sin(3.1 * written[last] + 1.0) + 1e-3 * rng.normal(size=written.size)[last],
        np.sin(3.1 * time + 1.0),
    )


@pytest.mark.parametrize(
    ("topic_hz", "lost", "jitter"),
    [(50.0, 0.0, 0.0), (50.0, 0.05, 0.0), (60.0, 0.0, 0.0), (60.0, 0.02, 0.05), (90.0, 0.0, 0.0), (130.0, 0.02, 0.0)],
)
def test_a_slower_clock_need_not_divide_that_of_the_log(topic_hz, lost, jitter):
    time, held, true = sampled_by(topic_hz, np.random.default_rng(5), lost=lost, jitter=jitter)
    rows = hold_period(time, held)
    assert_allclose(rows, 200.0 / topic_hz, rtol=0.02)  # lost rows leave their mark on the mean interval
    inside = (time > 0.1) & (time < 29.9)
    released = release_hold(time, held, rows)

    def age(values):  # [s], by which the sine comes late, from the slope of least squares over its rate
        rate = 3.1 * np.cos(3.1 * time + 1.0)
        return -float(np.mean((values - true)[inside] * rate[inside]) / np.mean(rate[inside] ** 2))

    assert_allclose(age(held), 0.5 / topic_hz, rtol=0, atol=2e-3)  # half a period of the topic
    assert -1e-3 < age(released) < 5e-3 + 0.5e-3  # a sample is logged by the next row, at most 5 ms later


def test_repeats_without_a_clock_are_no_slower_clock():
    rng = np.random.default_rng(11)
    for intervals in (rng.integers(1, 4, 4000), rng.geometric(0.4, 4000)):
        values = np.repeat(rng.normal(size=4000), intervals)
        assert hold_period(np.arange(values.size) * 5e-3, values) == 1.0
    moving = rng.normal(size=4000) * (np.arange(4000) % 200 < 100)  # every row while it moves, and rests between
    assert hold_period(np.arange(4000) * 5e-3, moving) == 1.0
    time = np.arange(6000) * 5e-3
    for speed in (0.3, 1.0, 3.0):  # of a coarse encoder with noise of a step, whose steps have two sizes
        angle = speed * np.sin(0.7 * time) + 6e-3 * rng.normal(size=time.size)
        assert hold_period(time, np.round(angle / 6e-3) * 6e-3) == 1.0


def test_steps_of_an_unsteady_logger_are_no_lost_rows():
    """Rows after 5.5 ms while a channel moves, and after 3.5 ms, which are most, while it rests."""
    rng = np.random.default_rng(7)
    moves = np.arange(1500) % 1000 < 300
    time = np.cumsum(np.where(moves, 5.5e-3, 3.5e-3))
    changes = moves & (rng.uniform(size=1500) < 0.85)
    assert hold_period(time, np.cumsum(changes * rng.normal(size=1500))) == 1.0


def test_saturated_voltage_is_noted(tmp_path, table):
    table["joint/voltage"] = table["joint/voltage"].clip(-3, 3)
    assert noted(load(table, tmp_path, drive="voltage"), "rests at its limit of 3")


def test_a_command_in_steps_is_at_no_limit():
    """It rests at every value alike; a smooth one that is cut off rests at its limit alone."""
    steps = np.repeat(np.random.default_rng(3).uniform(-5.0, 5.0, 40), 100)
    assert saturated_share(steps) == 0.0
    limited = np.clip(3.0 * np.sin(np.arange(4000) * 0.01), -2.0, 2.0)
    assert saturated_share(limited) == pytest.approx(np.mean(np.abs(limited) == 2.0), abs=1e-3)  # a crest at the end


@pytest.mark.parametrize("drive", ["position_servo", "voltage"])
def test_wrong_sign_of_the_torque_is_turned(tmp_path, table, drive):
    right = load(table, tmp_path, drive=drive)
    run = load(table.assign(**{"joint/torque": -table["joint/torque"]}), tmp_path, drive=drive)
    assert not noted(right, "sign") and noted(run, "Column joint/torque has the wrong sign and was turned")
    assert_allclose(run.columns["joint/torque"], right.columns["joint/torque"], rtol=1e-12)


@pytest.mark.parametrize(("drive", "name"), [("position_servo", "position_command"), ("voltage", "voltage")])
def test_wrong_sign_of_the_command_is_turned(tmp_path, table, drive, name):
    column = f"joint/{name}"
    run = load(table.assign(**{column: -table[column]}), tmp_path, drive=drive)
    assert noted(run, f"Column {column} has the wrong sign") and not noted(run, "joint/torque")
    assert_allclose(run.columns[column], table[column], rtol=1e-12, atol=1e-15)


def test_a_run_that_is_not_clear_follows_the_others(tmp_path):
    clear, dull = bench(), bench(seed=3)
    rng = np.random.default_rng(0)
    dull["joint/torque"] = 2.0 * rng.standard_normal(len(dull))
    for table, name in ((clear, "a"), (dull, "b")):
        table["joint/torque"] *= -1
        write(table, tmp_path / f"{name}.csv")
    a, b = load_runs([tmp_path / "a.csv", tmp_path / "b.csv"], servo_rig())
    assert noted(a, "wrong sign") and noted(b, "as in the other runs")


def test_wrong_sign_and_lag_of_the_velocity(tmp_path, table):
    run = load(table.assign(**{"joint/velocity": -table["joint/velocity"]}), tmp_path)
    assert noted(run, "joint/velocity has the opposite sign")
    assert_allclose(run.columns["joint/velocity"], table["joint/velocity"], rtol=1e-12, atol=1e-15)
    rng = np.random.default_rng(5)
    rough = table.copy()
    rough["joint/velocity"] = np.cumsum(rng.standard_normal(len(table))) * 0.02
    rough["joint/velocity"] = rough["joint/velocity"].rolling(60, min_periods=1, center=True).mean()
    rough["joint/position"] = np.cumsum(rough["joint/velocity"]) * PERIOD
    rough["joint/position_command"] = rough["joint/position"] + 1e-3 * table["joint/torque"]
    rough["joint/velocity"] = np.roll(rough["joint/velocity"], 8)
    assert noted(load(rough, tmp_path), "comes about 8 ms after")


def test_units_and_names_are_mapped(tmp_path, table):
    other = pd.DataFrame(
        {
            "t_ms": table["time"] * 1e3,
            "q": np.rad2deg(table["joint/position"]),
            "q_des": np.rad2deg(table["joint/position_command"]),
            "load": -1e3 * table["joint/torque"],
        }
    )
    columns = {"time": "t_ms", "position": "q", "position_command": "q_des", "joint/torque": "load"}
    run = load(other, tmp_path, columns=columns, units={"time": "ms", "position": "deg", "torque": "-mN*m"})
    for name in ("joint/position", "joint/position_command", "joint/torque"):
        assert_allclose(run.columns[name], table[name], rtol=1e-9, atol=1e-12)
    assert run.period == PERIOD


def test_imu_and_ft_columns_come_along(tmp_path, table):
    table["imu_base/gyro_x"] = 1.0 + table["time"]
    table["ft_wrist/fz"] = 2.0 * table["time"]
    run = load(table, tmp_path, units={"gyro_x": "deg/s"})
    assert_allclose(run.columns["imu_base/gyro_x"], np.deg2rad(1.0 + table["time"]), rtol=1e-12)
    assert "ft_wrist/fz" in run.columns


def test_names_are_unique(tmp_path, table):
    paths = []
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        paths.append(write(table, tmp_path / folder / "run.csv"))
    runs = load_runs([*paths, paths[0]], servo_rig())
    assert [run.name for run in runs] == ["a/run", "b/run", "a/run-2"]


@pytest.mark.parametrize(("bits", "unit"), [(16, 1e-3), (32, 1e-3), (32, 1e-6)])
@pytest.mark.parametrize("whole", [True, False])
def test_a_counter_that_begins_anew_goes_on(tmp_path, table, bits, unit, whole):
    """As those of microcontrollers, in their own unit or in s."""
    counts = (np.round(table["time"] / unit).astype(np.int64) + 2**bits - round(3.0 / unit)) % 2**bits
    run = load(table.assign(time=counts if whole else counts * unit), tmp_path, units={"time": unit if whole else "s"})
    assert_allclose(run.time - run.time[0], table["time"], rtol=0, atol=1e-6)
    assert noted(run, "(found: 1)")
