"""Bags are made here, with known motions, rates and clocks, and read back."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import LogError
from drake_tc.logs.files.readers import read_table
from drake_tc.logs.prepare import load_run
from drake_tc.logs.rig import parse_rig

pytest.importorskip("rosbags")
from .recorded import arrays, bag, imus, joint_states, trajectory, wrenches

PERIOD = 0.002
TIME = np.arange(2000) * PERIOD


def swing(t, joint=0):
    return 0.5 * np.sin((2.0 + joint) * t) + 0.3 * joint


STATES = {f"j{i}": [swing(TIME, i), np.gradient(swing(TIME, i), TIME), 3.0 * np.cos(TIME)] for i in range(3)}


def notes(table) -> str:
    return " ".join(table.attrs["notes"])


@pytest.mark.parametrize("mcap", [True, False])
def test_joint_states_alone(tmp_path, mcap):
    path = bag(tmp_path / "run", joint_states("/joint_states", TIME, STATES), mcap=mcap)
    table = read_table(path)
    assert_allclose(table["time"], TIME, rtol=0, atol=1e-9)
    for i in range(3):
        assert_allclose(table[f"j{i}/position"], swing(TIME, i), rtol=1e-12)
        assert_allclose(table[f"j{i}/effort"], STATES["j0"][2], rtol=1e-12)
    assert "The rows are the 2000 messages of /joint_states (500 Hz)" in notes(table)
    if mcap:  # the file alone, without the metadata beside it
        (file,) = path.glob("*.mcap")
        assert read_table(file).equals(table)


def test_commands_of_a_forward_controller_find_their_joints(tmp_path):
    """At 100 Hz, in another order than the joint states, without stamps, 4 ms of delay in the servo."""
    ticks = np.arange(0.0, 4.0, 0.01)
    order = [2, 0, 1]
    sent = np.column_stack([swing(ticks + 0.004, i) for i in order])
    path = bag(
        tmp_path / "run",
        joint_states("/joint_states", TIME, STATES),
        arrays("/position_controller/commands", ticks, sent),
    )
    table = read_table(path)
    assert "assigned to j2/position_command, j0/position_command, j1/position_command: each to" in notes(table)
    assert "not certain" not in notes(table) and "/position_controller/commands has no stamps" in notes(table)
    held = np.floor(TIME / 0.01 + 1e-6) * 0.01
    for i in range(3):
        assert_allclose(table[f"j{i}/position_command"], swing(held + 0.004, i), rtol=0, atol=1e-9)


def test_commands_as_joint_states_and_a_late_recorder(tmp_path):
    path = bag(
        tmp_path / "run",
        joint_states("/joint_states", TIME, STATES, late=0.003),
        joint_states("/joint_commands", TIME + 0.0005, {"j1": [swing(TIME, 1) + 0.01]}),
    )
    table = read_table(path)
    assert np.isnan(table["j1/position_command"][0])
    assert_allclose(table["j1/position_command"][1:], swing(TIME[:-1], 1) + 0.01, rtol=1e-12)


def test_trajectories_are_followed_held_and_replaced(tmp_path):
    path = bag(
        tmp_path / "run",
        joint_states("/joint_states", TIME, {"j0": [swing(TIME)]}),
        trajectory("/controller/joint_trajectory", 0.5, ["j0"], [(0.0, [0.0]), (1.0, [1.0]), (2.0, [3.0])]),
        trajectory("/controller/joint_trajectory", 2.0, ["j0"], [(0.5, [0.0])]),
    )
    table = read_table(path)
    command = table["j0/position_command"].to_numpy()
    assert np.isnan(command[TIME < 0.5]).all()
    expected = np.interp(TIME, [0.5, 1.5, 2.0, 2.5], [0.0, 1.0, 2.0, 0.0])
    assert_allclose(command[TIME >= 0.5], expected[TIME >= 0.5], rtol=0, atol=1e-9)


def test_sensors_at_their_own_rates_and_clocks(tmp_path):
    slow = np.arange(0.0, 4.0, 0.005)
    gyro = np.column_stack([np.sin(slow), slow, 1.0 - slow])
    force = np.column_stack([slow, -slow, 2.0 * slow])
    path = bag(
        tmp_path / "run",
        joint_states("/joint_states", TIME, STATES, late=0.001),
        imus("/torso/imu/data", "torso_link", slow, gyro, gyro + 9.0, clock=12.5),
        wrenches("/ft_sensor/wrench", "left_foot", slow, force, 0.1 * force),
    )
    table = read_table(path)
    inside = slow[-1] > TIME
    assert "The clock of /torso/imu/data differs from that of /joint_states by -12.5 s" in notes(table)
    assert_allclose(table["imu_torso/gyro_y"][inside], TIME[inside], rtol=0, atol=1e-6)
    assert_allclose(table["ft_left_foot/tz"][inside], 0.2 * TIME[inside], rtol=0, atol=1e-9)
    assert "of /ft_sensor/wrench (200 Hz) was resampled to these rows (interpolated)" in notes(table)


def test_a_bag_is_a_log(tmp_path):
    path = bag(
        tmp_path / "walk",
        joint_states("/joint_states", TIME, STATES),
        joint_states("/joint_commands", TIME, {f"j{i}": [swing(TIME, i) + 1e-3 * np.cos(TIME)] for i in range(3)}),
    )
    rig = parse_rig(
        {"joint": "j1", "drive": "position_servo", "load": "torque", "columns": {"torque": "j1/effort"}}, "rig.yaml"
    )
    run = load_run(path, rig)
    assert run.name == "walk" and run.period == pytest.approx(PERIOD)
    assert any("/joint_commands" in note for note in run.notes)


def test_what_is_no_bag_or_has_no_joints(tmp_path):
    slow = np.arange(0.0, 1.0, 0.01)
    path = bag(tmp_path / "run", imus("/imu", "base", slow, np.zeros((100, 3)), np.zeros((100, 3))))
    with pytest.raises(LogError, match=r"no joint states in this bag; expected .*/imu \(measured\)"):
        read_table(path)
    (file,) = path.glob("*.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.read_bytes()[:300])
    with pytest.raises(LogError, match=r"no joint states in this bag; .*The file cut\.mcap is cut off"):
        read_table(cut)
    (tmp_path / "odd.db3").write_text("no database")
    with pytest.raises(LogError, match=r"odd\.db3: cannot be read as a ROS bag"):
        read_table(tmp_path / "odd.db3")
