"""Turns of encoders and spikes are mended and told; exchanged, dead and complex columns are refused."""

import gzip

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import LogError
from drake_tc.logs.checks.mistaken_columns import leads_by
from drake_tc.logs.checks.outliers import spikes, without_turns
from drake_tc.logs.prepare import load_run, load_runs

from .conftest import PERIOD, bench, servo_rig, write

TURN = 2.0 * np.pi


def noted(run, text: str) -> bool:
    return any(text in note for note in run.notes)


def load(table, tmp_path, **rig):
    return load_run(write(table, tmp_path / "run.csv"), servo_rig(**rig))


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


def refusal(table, tmp_path, **rig) -> str:
    with pytest.raises(LogError) as caught:
        load(table, tmp_path, **rig)
    return str(caught.value)


def test_a_torque_that_is_zero_throughout(tmp_path, table):
    line = refusal(table.assign(**{"joint/torque": 0.0}), tmp_path)
    assert "'joint/torque' is 0 in all rows while joint moves" in line and "load:" in line


def test_a_position_that_never_changes(tmp_path, table):
    assert "'joint/position' is constant (0.3) in all rows" in refusal(
        table.assign(**{"joint/position": 0.3}).drop(columns="joint/velocity"), tmp_path
    )


def test_complex_numbers_are_refused(tmp_path, table):
    columns = {name: table[name].to_numpy() for name in table}
    columns["joint/torque"] = columns["joint/torque"] + 1j
    np.savez(tmp_path / "run.npz", **columns)
    with pytest.raises(LogError, match=r"run\.npz: column 'joint/torque' .* holds complex numbers; expected real"):
        load_run(tmp_path / "run.npz", servo_rig())


@pytest.mark.parametrize("packed", [False, True])
def test_a_name_that_stands_twice_in_a_header(tmp_path, packed):
    text = "time,q,q\n" + "".join(f"{i},1,2\n" for i in range(50))
    path = tmp_path / ("run.csv.gz" if packed else "run.csv")
    path.write_bytes(gzip.compress(text.encode()) if packed else text.encode())
    with pytest.raises(LogError, match="column 'q' stands more than once"):
        load_run(path, servo_rig())


def test_cells_beyond_the_header(tmp_path, table):
    lines = write(table, tmp_path / "run.csv").read_text().splitlines()
    lines[100] += ",7"
    (tmp_path / "run.csv").write_text("\n".join(lines))
    with pytest.raises(LogError, match=r"line 101 has 8 cells, and the header 7 names"):
        load_run(tmp_path / "run.csv", servo_rig())
    lines[100] = lines[100].removesuffix("7")
    (tmp_path / "run.csv").write_text("\n".join(lines))
    assert len(load_run(tmp_path / "run.csv", servo_rig())) == len(table)
