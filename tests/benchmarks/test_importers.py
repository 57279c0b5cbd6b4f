"""Importers on the public data: numbers checked against the raw files and against physics, then loaded as runs."""

import gzip
import json

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.signal import savgol_filter

from drake_tc.errors import LogError
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig
from tests.benchmarks.importers import IMPORTERS
from tests.benchmarks.importers.uart_backlash import decode_sign

SETS = {
    "bam": "bam-xl330-pendulum",
    "dfki": "dfki-simple-pendulum",
    "tmotor": "tmotor-ak80-9-bench",
    "staubli": "staubli-tx40",
    "tiago": "tiago-arm",
    "uart-backlash": "uart-servo-backlash",
    "ur10e": "ur10e-calibration",
    "so101": "so101-sage",
    "go2": "go2-leg-pd",
}


def runs_of(rig_file):
    return load_runs(sorted(rig_file.parent.glob("*.parquet")), load_rig(rig_file))


def by_folder(rigs, name="rig.yaml"):
    return {rig.parent.name: rig for rig in rigs if rig.name == name}


LARGE = ("so101", "ur10e")
"""Sets of many runs."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name in LARGE else []) for name in sorted(SETS)]
)
def test_every_rig_written_loads_with_all_its_runs(data, tmp_path, name):
    rigs = IMPORTERS[name](data / SETS[name], tmp_path)
    assert rigs and all(rig.is_file() for rig in rigs)
    for rig in rigs:
        runs = runs_of(rig)
        assert runs
        assert not any("wrong sign" in note for run in runs for note in run.notes)


def test_registers():
    assert_allclose(decode_sign(np.array([74.0, 1135.0]), 1024.0), [74, -111], rtol=0)


def test_dfki_simple_pendulum_current_and_balance(data, tmp_path):
    folders = by_folder(IMPORTERS["dfki"](data / "dfki-simple-pendulum", tmp_path))
    assert sorted(folders) == ["simple", "simple_1kg"]
    rig = load_rig(folders["simple"])
    assert_allclose(rig.load["pendulum"].mass * rig.load["pendulum"].length, 0.304, atol=5e-4)
    raw = pd.read_csv(data / "dfki-simple-pendulum" / "control_method_ddp__data_measured.csv.gz")
    log = pd.read_parquet(folders["simple"].parent / "control_method_ddp__data_measured.parquet")
    assert_allclose(log["pendulum/current"] * 0.091 * 6, raw["torque"], rtol=1e-12)
    q = log["pendulum/position"].to_numpy()
    rate, acceleration = (savgol_filter(q, 41, 3, deriv=order, delta=2e-3) for order in (1, 2))
    columns = np.column_stack([acceleration, 9.81 * np.sin(q), rate, np.arctan(100 * rate), np.ones(len(q))])
    inertia, moment = np.linalg.lstsq(columns, 0.546 * log["pendulum/current"].to_numpy(), rcond=None)[0][:2]
    assert_allclose([inertia, moment], [0.150, 0.329], rtol=0.05)  # README's own fit; another filter, so 5 %


def test_dfki_double_pendulum_both_formats(data, tmp_path):
    folders = by_folder(IMPORTERS["dfki"](data / "dfki-double-pendulum", tmp_path))
    assert sorted(folders) == ["double_A0_20220812", "double_A0_20220815", "double_C0_20220914"]
    rig = load_rig(folders["double_A0_20220812"])
    assert rig.joints == ("shoulder", "elbow") and set(rig.load.values()) == {"unknown"}
    runs = runs_of(folders["double_A0_20220812"])
    assert len(runs) == 10
    spaced = next(run for run in runs if "friccomp" in run.name)
    assert any("repeat a time stamp" in note for note in spaced.notes)
    log = pd.read_parquet(folders["double_C0_20220914"].parent / "C0_20220914_trajectory_12.parquet")
    raw = pd.read_csv(data / "dfki-double-pendulum" / "C0_20220914_trajectory_12.csv.gz")
    assert_allclose(log["elbow/current"] * 0.546, raw["tau_meas2"], rtol=1e-12)


def test_tmotor_sessions_signs_and_rows_of_seven(data, tmp_path):
    folders = by_folder(IMPORTERS["tmotor"](data / "tmotor-ak80-9-bench", tmp_path))
    assert sorted(folders) == ["early", "final", "free_running", "lower_baud", "new_current_calc", "ripple"]
    log = pd.read_parquet(folders["final"].parent / "sysid_final_trial8.parquet")
    with gzip.open(data / "tmotor-ak80-9-bench" / "sysid_final_trial8.csv.gz", "rt") as stream:
        text = stream.read().splitlines()
    rows = np.array([[float(cell) for cell in line.split(",")[:6]] for line in text[1:]])
    raw = pd.DataFrame(rows, columns=text[0].split(","))
    # the drive's reply is one row late against the sensor
    assert_allclose(log["time"], raw["loop_time"][:-1], rtol=0)
    assert_allclose(log["actuator/torque"], -raw["adc_measured_torque"][:-1], rtol=0)
    assert_allclose(log["actuator/current"], raw["motor_measured_current"][1:], rtol=0)
    assert np.corrcoef(log["actuator/current"], log["actuator/torque"])[0, 1] > 0.9
    assert_allclose(log["actuator/velocity"], raw["motor_measured_speed"][1:], rtol=0)
    assert "actuator/position" not in log  # none was logged
    # README: torque per ampere 0.81 in the early session, 1.12 in the final one
    for session, gain in (("early", 0.80), ("final", 1.12)):
        name = {"early": "sysid_test_1", "final": "sysid_final_trial5"}[session]
        one = pd.read_parquet(folders[session].parent / f"{name}.parquet")
        slope = one["actuator/current"] @ one["actuator/torque"] / (one["actuator/current"] @ one["actuator/current"])
        assert_allclose(slope, gain, atol=0.02)
    ripple = pd.read_parquet(folders["ripple"].parent / "ripple_trial_4_torque.parquet")
    turn = np.ptp(ripple["actuator/position"].dropna())
    assert_allclose(turn, 2 * np.pi, rtol=0.1)  # README: one full turn


@pytest.mark.parametrize(
    ("turned", "session"),
    [
        *(("actuator/torque", session) for session in ("early", "new_current_calc", "lower_baud", "final")),
        *(("actuator/current", session) for session in ("early", "final")),  # the others: too little friction to tell
    ],
)
def test_tmotor_signs_are_found_again_when_turned(data, tmp_path, session, turned):
    folder = by_folder(IMPORTERS["tmotor"](data / "tmotor-ak80-9-bench", tmp_path))[session].parent
    for path in folder.glob("*.parquet"):
        log = pd.read_parquet(path)
        log[turned] *= -1
        log.to_parquet(path)
    for run in runs_of(folder / "rig.yaml"):
        assert [note for note in run.notes if note.startswith(f"Column {turned} has the wrong sign")], run.name
        assert sum("wrong sign" in note for note in run.notes) == 1


def test_staubli_matches_the_torque_levels_of_the_readme(data, tmp_path):
    (rig_file,) = IMPORTERS["staubli"](data / "staubli-tx40", tmp_path)
    log = pd.read_parquet(rig_file.parent / "trajectory.parquet")
    # README's torque RMS, two or three digits; it is taken about the mean, as joint 2's gravity shows
    motor = [log[f"joint_{i}/torque_command"] for i in range(1, 7)]
    joint = [*motor[:4], motor[4] + motor[5], motor[5]]
    assert_allclose([torque.std() for torque in joint], [31.5, 26.7, 12.3, 5.8, 8.3, 5.0], rtol=0.02)
    raw = pd.read_csv(data / "staubli-tx40" / "pos_read_data.csv.gz")
    again = 45 * log["joint_5/position"], 32 * log["joint_6/position"] + 32 * log["joint_5/position"]
    for place, angle in zip((5, 6), again, strict=True):
        averaged = raw[f"Joint_{place}"].to_numpy().reshape(-1, 5).mean(axis=1)
        assert_allclose(angle, averaged, atol=1e-9)
    assert_allclose(np.diff(log["time"]), 1e-3, rtol=1e-9)


def test_tiago_joins_three_files(data, tmp_path):
    rig_file, of_wrist = IMPORTERS["tiago"](data / "tiago-arm", tmp_path)
    rig = load_rig(rig_file)
    assert rig.joints == ("torso_lift_joint", *(f"arm_{i}_joint" for i in range(1, 8)))
    (run,) = runs_of(rig_file)
    assert abs(len(run) - 8022) < 5
    rate = np.gradient(run.columns["arm_2_joint/position"], run.time)
    moving = np.abs(rate) > 0.2
    ratio = run.columns["arm_2_joint/velocity"][moving] @ rate[moving] / (rate[moving] @ rate[moving])
    assert_allclose(ratio, 0.99, atol=0.05)  # README: slope 0.99
    wrist = pd.read_parquet(of_wrist.parent / "wrist.parquet")
    joint, motor = run.columns, [wrist[f"{motor}/position"] for motor in load_rig(of_wrist).joints]
    assert_allclose(
        motor[1] + motor[2], 2.0 * np.interp(wrist["time"], run.time, joint["arm_6_joint/position"]), atol=2e-3
    )


def test_tiagos_wrist_reports_its_motors_apart_and_mostly_nothing(data, tmp_path):
    _, of_wrist = IMPORTERS["tiago"](data / "tiago-arm", tmp_path)
    wrist = pd.read_parquet(of_wrist.parent / "wrist.parquet")
    first, second = (np.abs(wrist[f"{motor}/current"]) > 1e-4 for motor in load_rig(of_wrist).joints[1:])
    assert np.mean(first | second) < 0.2
    assert np.mean(first & second) < 0.02


def test_uart_counts_and_signs(data, tmp_path):
    folders = by_folder(IMPORTERS["uart-backlash"](data / "uart-servo-backlash", tmp_path))
    assert sorted(folders) == ["comp2", "nocomp2", "pgain_zero_db", "single", "single_3250"]
    single = load_rig(folders["single"])
    assert single.joints == ("servo_5", "servo_3", "servo_4")
    log = pd.read_parquet(folders["single"].parent / "run.parquet")
    raw = pd.read_csv(data / "uart-servo-backlash" / "motor_telemetry_single.csv")
    assert_allclose(np.rad2deg(log["servo_5/position"]) / 0.087890625, raw["pos (5)"] - 2047, atol=1e-6)
    for joint in single.joints:  # a servo pushes towards its target
        error = log[f"{joint}/position_command"] - log[f"{joint}/position"]
        assert np.corrcoef(error, log[f"{joint}/voltage"])[0, 1] > 0.3, joint


def test_wrong_sources_are_refused(tmp_path):
    for name, convert in IMPORTERS.items():
        with pytest.raises(LogError, match="none of the set's files"):
            convert(tmp_path, tmp_path / "out")
        with pytest.raises(LogError, match="expected the folder"):
            convert(tmp_path / name, tmp_path / "out")
    with gzip.open(tmp_path / "run.json.gz", "wt") as stream:
        json.dump({"entries": []}, stream)
    with pytest.raises(LogError, match="not a BAM run"):
        IMPORTERS["bam"](tmp_path, tmp_path / "out")
    (tmp_path / "motor_telemetry_x.csv").write_text("a,b\n1,2\n")
    with pytest.raises(LogError, match="no column 'timestamp'"):
        IMPORTERS["uart-backlash"](tmp_path, tmp_path / "out")
