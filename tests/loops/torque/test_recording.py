"""Recordings: the log and rig file that a simulation writes are read back with the same numbers."""

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from drake_tc.errors import LogError
from drake_tc.logs.files.readers import read_table
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig
from drake_tc.loops.recording import write_log, write_rig
from drake_tc.loops.torque.running import log_columns, rig_of, simulate_scenario, summarise, write_results
from drake_tc.registry import diagram_entry


@pytest.fixture(scope="module")
def recording():
    text = "{duration: 0.7, controller: servo, guard: {start_time: 0.1}, log_truth: true}"
    return simulate_scenario(diagram_entry("hrp2_leg").scenario("identify_motion", text=text))


@pytest.mark.parametrize("ending", ["csv", "parquet", "npz"])
def test_log_and_rig_are_read_back_with_the_same_numbers(recording, ending, tmp_path):
    columns = log_columns(recording, recording["joint_torque"])
    log = write_log(columns, tmp_path / "deep" / f"log.{ending}")
    rig = load_rig(write_rig(rig_of(recording), tmp_path / "rig.yaml"))
    assert list(rig.joints) == list(recording.robot.joints)
    table = read_table(log)
    assert list(table.columns) == list(columns)
    assert_allclose(table.to_numpy(), np.column_stack(list(columns.values())), rtol=1e-8, atol=1e-12)  # csv: 9 digits
    (run,) = load_runs([log], rig)
    assert len(run) == recording.time.size
    assert_allclose(run.time - run.time[0], recording.time, atol=1e-9)
    for i, joint in enumerate(recording.robot.joints):
        assert_allclose(run.columns[f"{joint}/position"], recording["encoder"][:, i], rtol=1e-8, atol=1e-12)
        assert_allclose(run.columns[f"{joint}/position_command"], recording["command"][:, i], rtol=1e-8, atol=1e-12)
        assert_allclose(run.columns[f"{joint}/torque"], recording["joint_torque"][:, i], rtol=1e-8, atol=1e-12)
        model = recording.models[joint]
        half_step = (
            0.5 * recording.plant_step * next(e for e in model.effects if e.key == "viscous").parameters["viscous"]
        )
        assert_allclose(rig.known(joint, "rotor_inertia"), model.inertia + half_step, rtol=1e-12)


def test_columns_are_the_canonical_ones(recording):
    columns = log_columns(recording)
    assert {f"imu_torso/{name}_{axis}" for name in ("gyro", "accel") for axis in "xyz"} <= set(columns)
    assert {f"ft_right_ankle/{name}" for name in ("fx", "fy", "fz", "tx", "ty", "tz")} <= set(columns)
    assert not any(name.endswith("/torque") for name in columns)
    assert np.mean(columns["imu_torso/accel_z"]) == pytest.approx(9.81, abs=0.05)  # up, at rest
    weight = np.mean(columns["ft_right_ankle/fz"])
    assert -30.0 < weight < -3.0  # the foot hangs from its sensor
    assert_allclose(columns["r_knee/position"], recording["encoder"][:, 3])


def test_results_hold_torques_that_were_estimated_without_delay(recording, tmp_path):
    files = write_results(recording, tmp_path, "npz")
    assert [file.name for file in files] == ["log.npz", "rig.yaml"]
    table = read_table(files[0])
    late = recording.time > 0.3
    truth = recording["joint_torque"][late]
    estimate = np.column_stack([table[f"{joint}/torque"] for joint in recording.robot.joints])[late]
    # 0.7 s of a slow motion: zeroed F/T, so a few tenths of a newton metre are left
    assert np.sqrt(np.mean((estimate - truth) ** 2, axis=0)).max() < 1.0
    document = yaml.safe_load(files[1].read_text())
    assert document["drive"] == "position_servo"
    assert document["load"] == "torque"


def test_lost_samples_leave_the_torque_out_and_the_rest_in(tmp_path):
    text = "{duration: 0.3, faults: {imu: [{kind: dropped, start: 0.1, duration: 0.02}]}}"
    recording = simulate_scenario(diagram_entry("hrp2_leg").scenario("hanging", text=text))
    table = read_table(write_results(recording, tmp_path, "parquet")[0])
    assert not any(name.endswith("/torque") for name in table.columns)
    assert int(table["imu_torso/accel_z"].isna().sum()) == 20


def test_the_summary_says_what_was_seen(recording):
    summary = summarise(recording)
    assert summary["robot"] == "hrp2_like_leg"
    assert summary["faults"] == []
    error = np.abs(recording.tracking_error[recording.time >= 0.35])
    assert [row["joint"] for row in summary["joints"]] == list(recording.robot.joints)
    assert_allclose([row["max_error"] for row in summary["joints"]], error.max(axis=0))


def test_views_of_a_recording(recording):
    n = recording.size
    assert_allclose(recording.position, recording["joint_state"][:, :n])
    assert_allclose(recording.tracking_error + recording.position, recording["reference"][:, :n])
    q, v = recording.position, recording.velocity
    # a semi-implicit step: q[k+1] = q[k] + dt v[k+1]
    assert_allclose(np.diff(q, axis=0) * 1e3, v[1:], atol=1e-9)
    with pytest.raises(LogError, match="no signal 'smell' recorded; recorded: acceleration, actuation"):
        recording["smell"]
    with pytest.raises(LogError, match=r"expected a log that ends in \.csv, \.parquet, \.npz, got \.doc"):
        write_log({}, recording.robot.source.with_suffix(".doc"))
