"""Turns of encoders, lost zeros and spikes are mended and told; exchanged and complex columns are refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from drake_tc.errors import LogError
from drake_tc.logs.checks.jumps import jumps
from drake_tc.logs.checks.mistaken_columns import leads_by
from drake_tc.logs.checks.outliers import spikes, without_turns
from drake_tc.logs.prepare import load_run, load_runs

from .conftest import PERIOD, bench, load, noted, servo_rig, write

TURN = 2.0 * np.pi


@pytest.mark.parametrize("turns", [1, -1, 3])
def test_one_sample_whole_turns_off_is_put_right_exactly(tmp_path, table, turns):
    before = table["joint/position"].to_numpy().copy()
    table.loc[1200, "joint/position"] += TURN * turns
    run = load(table, tmp_path)
    assert noted(run, "Column joint/position jumps by whole turns of 2 pi in 2 rows (the first: row 1201")
    assert_allclose(run.columns["joint/position"], before, rtol=0, atol=1e-12)


def test_an_encoder_that_wraps_round_is_unwrapped(tmp_path):
    table = bench()
    command = table["joint/position_command"].to_numpy() + 3.0
    truth = table["joint/position"].to_numpy() + 3.0
    table["joint/position"] = (truth + np.pi) % TURN - np.pi
    table["joint/position_command"] = (command + np.pi) % TURN - np.pi
    run = load(table, tmp_path, units={"position": "rad"})
    q, q_d = run.columns["joint/position"], run.columns["joint/position_command"]
    assert_allclose(q - q[0], truth - truth[0], rtol=0, atol=1e-9)
    assert_allclose(q_d - q, command - truth, rtol=0, atol=1e-9)


def test_a_fast_joint_keeps_its_turns():
    steps = np.concatenate([np.full(500, 5.9), np.full(500, 6.6)])  # nothing but large steps: nobody can tell
    values = np.cumsum(steps)
    assert without_turns(values).rows == () and without_turns(values).values is values


@pytest.mark.parametrize("suffix", ["position", "torque"])
def test_three_spikes_are_taken_out(tmp_path, table, suffix):
    name = f"joint/{suffix}"
    size = 3.0 if suffix == "position" else 60.0
    truth = bench()[name].to_numpy()
    for row, sign in ((700, 1), (2500, -1), (2501, -1)):
        table.loc[row, name] += sign * size
    run = load(table, tmp_path)
    assert noted(run, f"Column {name} has spikes of up to") and noted(run, "in 3 rows (the first: row 701")
    assert np.abs(run.columns[name] - truth).max() < (1e-5 if suffix == "position" else 0.3)


@pytest.mark.parametrize(("later", "stays"), [(0, True), (2, True), (40, False)])
def test_a_torque_that_answers_a_pulse_of_the_effort_is_no_spike(tmp_path, table, later, stays):
    table.loc[700:701, "joint/torque"] += 60.0
    table.loc[700 - later : 701 - later, "joint/position_command"] += 2.0
    run = load(table, tmp_path)
    assert noted(run, "Column joint/torque has spikes") != stays
    assert (run.columns["joint/torque"][700] > 30.0) == stays


def test_what_joints_do_is_no_spike():
    t = np.arange(8000) * PERIOD
    rng = np.random.default_rng(3)
    cases = {
        "sine": np.sin(40.0 * t),
        "steps of a command": np.round(2.0 * np.sin(2.0 * t)) / 2.0,
        "rest, then an impact": np.where(t > 4.0, np.exp(-(t - 4.0) / 0.02) * np.sin(400.0 * (t - 4.0)), 0.0),
        "white noise": rng.standard_normal(t.size),
        "heavy tails": rng.standard_t(4, t.size),
        "encoder": np.round(0.2 * np.sin(t) / 1e-3) * 1e-3,
    }
    for name, values in cases.items():
        assert not spikes(values).any(), name


def test_spikes_without_end_are_refused(tmp_path, table):
    table.loc[::97, "joint/position"] += 3.0
    with pytest.raises(LogError, match=r"run\.csv: column joint/position has spikes in 6. of 6000 rows"):
        load(table.iloc[:6000], tmp_path)


@pytest.mark.parametrize("late", [0, 3, 8.5, -4])
def test_the_lead_between_two_channels(late):
    t = np.arange(4000) * PERIOD
    motion = lambda t: np.sin(2.0 * t) + 0.2 * np.sin(11.0 * t)  # noqa: E731
    found = leads_by(motion(t), motion(t - late * PERIOD), np.ones(t.size), PERIOD)
    assert found == pytest.approx(late, abs=0.1)


def servo(noise: float, lag: int, seed: int = 0):
    """A servo's log: the position, with an encoder's noise [rad], follows the command `lag` samples later."""
    table = bench()
    rng = np.random.default_rng(seed)
    table["joint/position"] += noise * rng.standard_normal(len(table))
    table["joint/position_command"] = np.roll(table["joint/position_command"], -lag)
    return table.drop(columns="joint/velocity").iloc[20:-20]


def exchanged(table):
    names = ["joint/position", "joint/position_command"]
    return table.rename(columns=dict(zip(names, names[::-1], strict=True)))


@pytest.mark.parametrize(("noise", "lag"), [(2e-5, 0), (0.0, 5), (2e-5, 5)])
def test_exchanged_columns_are_refused(tmp_path, noise, lag):
    table = servo(noise, lag)
    assert not load(table, tmp_path).notes
    with pytest.raises(LogError, match=r"'joint/position' .* seem to be exchanged: .* and .*; exchange them under"):
        load(exchanged(table), tmp_path)


def test_a_turned_torque_is_still_repaired_and_not_taken_for_exchanged_columns(tmp_path):
    table = servo(2e-5, 5)
    table["joint/torque"] *= -1.0
    assert noted(load(table, tmp_path), "Column joint/torque has the wrong sign")


def test_of_several_runs_the_majority_decides(tmp_path):
    tables = [servo(2e-5, 4, seed) for seed in range(3)]
    paths = [write(table, tmp_path / f"{i}.csv") for i, table in enumerate(tables)]
    assert len(load_runs(paths, servo_rig())) == 3
    paths = [write(exchanged(table), tmp_path / f"{i}.csv") for i, table in enumerate(tables)]
    with pytest.raises(LogError, match="seem to be exchanged"):
        load_runs(paths, servo_rig())


def test_complex_numbers_are_refused(tmp_path, table):
    columns = {name: table[name].to_numpy() for name in table}
    columns["joint/torque"] = columns["joint/torque"] + 1j
    np.savez(tmp_path / "run.npz", **columns)
    with pytest.raises(LogError, match=r"run\.npz: column 'joint/torque' .* holds complex numbers; expected real"):
        load_run(tmp_path / "run.npz", servo_rig())


def test_cells_beyond_the_header(tmp_path, table):
    lines = write(table, tmp_path / "run.csv").read_text().splitlines()
    lines[100] += ",7"
    (tmp_path / "run.csv").write_text("\n".join(lines))
    with pytest.raises(LogError, match=r"line 101 has 8 cells, and the header 7 names"):
        load_run(tmp_path / "run.csv", servo_rig())
    lines[100] = lines[100].removesuffix("7")
    (tmp_path / "run.csv").write_text("\n".join(lines))
    assert len(load_run(tmp_path / "run.csv", servo_rig())) == len(table)


def motion(rate: float, step: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """(time, angle) of 20 s, with an encoder of this step [rad]."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 20.0, 1.0 / rate)
    angle = 0.8 * np.sin(2.0 * np.pi * 0.7 * time) + 0.1 * np.sin(2.0 * np.pi * 3.1 * time)
    return time, np.round((angle + 1e-4 * rng.standard_normal(time.size)) / step) * step


@pytest.mark.parametrize("rate", [100.0, 1000.0])
@pytest.mark.parametrize("step", [1e-6, 2.0 * np.pi / 4096])
def test_a_lost_zero_is_found_at_its_row(rate: float, step: float) -> None:
    time, angle = motion(rate, step)
    row = time.size // 3
    angle[row + 1 :] -= 0.4
    assert_array_equal(jumps(time, angle), [row])


@pytest.mark.parametrize("rate", [20.0, 100.0, 1000.0])
@pytest.mark.parametrize("step", [1e-6, 2.0 * np.pi / 4096])
def test_motion_has_no_jump(rate: float, step: float) -> None:
    time, angle = motion(rate, step)
    assert jumps(time, angle).size == 0


def test_a_fast_step_of_a_servo_is_no_jump() -> None:
    """A second-order step response of 20 Hz in an otherwise resting log."""
    time = np.arange(0.0, 20.0, 0.005)
    w, since = 2.0 * np.pi * 20.0, np.maximum(time - 8.0, 0.0)
    angle = 0.5 * (1.0 - np.exp(-w * since) * (1.0 + w * since))
    assert jumps(time, np.round(angle / 1e-3) * 1e-3).size == 0


def test_rows_that_are_missing_in_time_are_no_jump() -> None:
    time, angle = motion(500.0, 1e-6)
    kept = np.r_[0:3000, 3100 : time.size]
    assert jumps(time[kept], angle[kept]).size == 0


def test_a_run_is_split_where_its_encoder_lost_its_zero(tmp_path) -> None:
    whole = load_run(write(bench(), tmp_path / "whole.csv"), servo_rig())
    table = bench()
    table.loc[len(table) // 2 :, "joint/position"] += 0.5
    run = load_run(write(table, tmp_path / "run.csv"), servo_rig())
    assert len([hint for hint in run.hints if "joint/position jumps by 0.5" in hint]) == 1
    assert set(run.hints) <= set(run.notes)
    assert run.segment.max() == whole.segment.max() + 1
    assert whole.hints == ()
