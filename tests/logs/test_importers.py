"""Importers on the public data: numbers checked against the raw files and against physics, then loaded as runs."""

import gzip
import json

import numpy as np
import pandas as pd
import pytest
import typer
from numpy.testing import assert_allclose
from scipy.signal import savgol_filter
from typer.testing import CliRunner

from drake_tc.cli.import_logs import import_logs
from drake_tc.errors import LogError
from drake_tc.logs.importers import IMPORTERS
from drake_tc.logs.importers.bam import applied_duty
from drake_tc.logs.importers.uart_backlash import decode_sign
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.prepare import load_run, load_runs
from drake_tc.logs.rig import load_rig

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


@pytest.mark.parametrize("name", sorted(SETS))
def test_every_rig_written_loads_with_all_its_runs(data, tmp_path, name):
    rigs = IMPORTERS[name](data / SETS[name], tmp_path)
    assert rigs and all(rig.is_file() for rig in rigs)
    for rig in rigs:
        runs = runs_of(rig)
        assert runs
        assert not any("wrong sign" in note for run in runs for note in run.notes)


def test_bam_voltage_follows_the_firmware_law(data, tmp_path):
    rigs = IMPORTERS["bam"](data / "bam-xl330-pendulum", tmp_path)
    folders = by_folder(rigs)
    assert sorted(folders) == ["xl330_kp100", "xl330_kp200", "xl330_kp800"]
    rig = load_rig(folders["xl330_kp100"])
    assert rig.drive["servo"] == "voltage" and rig.load["servo"] == Pendulum(0.49, 0.1)
    assert load_rig(by_folder(rigs, "rig_servo.yaml")["xl330_kp100"]).drive["servo"] == "position_servo"
    run = load_run(folders["xl330_kp100"].parent / "sin_sin.parquet", rig)
    error = run.columns["servo/position_command"] - run.columns["servo/position"]
    law = 100 * 4096 / (2 * np.pi) / (256 * 885) * error * 7.3
    # supply read in 0.1 V steps, duty of the last firmware cycle: the law holds to about 5 % of its size
    assert_allclose(run.columns["servo/voltage"], law, rtol=0, atol=0.15 * np.abs(law).max())
    assert np.corrcoef(run.columns["servo/voltage"], law)[0, 1] > 0.99
    dropped = load_run(folders["xl330_kp100"].parent / "lift_and_drop.parquet", rig)
    assert any("drive switched off" in note for note in dropped.notes)
    assert_allclose(dropped.time[dropped.segment >= 0].max(), 2.0, atol=0.05)  # torque goes off after 2 s


def test_bam_feetech_has_no_load_register_and_one_rig(data, tmp_path):
    (rig_file,) = IMPORTERS["bam"](data / "bam-sts3250-pendulum", tmp_path)
    rig = load_rig(rig_file)
    assert rig.drive["servo"] == "position_servo" and rig.load["servo"] == Pendulum(1.13, 0.12)
    assert len(runs_of(rig_file)) == 4
    assert "servo/voltage" not in pd.read_parquet(rig_file.parent / "sin_sin.parquet")


def pendulum_run(**changes):
    """A run of a pendulum at rest, in the form of the data set."""
    entry = {"position": 0.1, "goal_position": 0.1, "speed": 0.0, "load": 3, "torque_enable": True}
    entries = [entry | {"timestamp": 0.01 * i, "position": 0.1 + 1e-3 * i, "load": 3 + i} for i in range(50)]
    run = {"mass": 0.5, "length": 0.2, "kp": 8, "vin": 7.4, "motor": "m", "trajectory": "a", "entries": entries}
    return run | changes


def test_bam_arms_have_mass_and_masses_may_differ_by_run(tmp_path):
    """Of a point mass and a uniform rod: weight and inertia by hand."""
    for name, mass in (("light", 0.0), ("heavy", 0.5)):
        run = pendulum_run(mass=mass, arm_mass=0.12, trajectory=name)
        (tmp_path / f"{name}.json").write_text(json.dumps(run))
    voltage, _servo = IMPORTERS["bam"](tmp_path, tmp_path / "out")
    rig = load_rig(voltage)
    for run in (load_run(path, rig) for path in voltage.parent.glob("*.parquet")):
        mass = {"light": 0.0, "heavy": 0.5}[run.name]
        pendulum = rig.load["servo"].in_run(run)
        assert_allclose(pendulum.mass * pendulum.length, 0.2 * mass + 0.1 * 0.12, rtol=1e-12)
        assert_allclose(pendulum.inertia, 0.2**2 * mass + 0.12 * 0.2**2 / 3.0, rtol=1e-12)
    # no register of the supply was read: the file's own voltage is taken
    volts = pd.read_parquet(voltage.parent / "light.parquet")["servo/voltage"]
    assert_allclose(volts, 7.4 * (3 + np.arange(50)) / 885.0, rtol=1e-12)


def test_bam_runs_without_any_mass_have_an_unknown_load(tmp_path):
    (tmp_path / "free.json").write_text(json.dumps(pendulum_run(mass=0.0)))
    (tmp_path / "loaded.json").write_text(json.dumps(pendulum_run()))
    rigs = {rig.parent.name: load_rig(rig) for rig in IMPORTERS["bam"](tmp_path, tmp_path / "out")}
    assert rigs["m_kp8_no_load"].load["servo"] == "unknown" and rigs["m_kp8"].load["servo"] == Pendulum(0.5, 0.2)
    for key, value in (("mass", -1.0), ("arm_mass", "x"), ("length", 0.0)):
        (tmp_path / "odd.json").write_text(json.dumps(pendulum_run(**{key: value})))
        with pytest.raises(LogError, match=rf"odd\.json: {key}: expected a"):
            IMPORTERS["bam"](tmp_path, tmp_path / "out")


def test_registers():
    assert_allclose(applied_duty(np.array([0, 885, 65536 - 885])), [0, 1, -1], rtol=0)
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


def bam_run(tmp_path, **changes):
    entries = [{"timestamp": 0.01 * k, "position": 0.1 * k, "goal_position": 0.1 * k + 0.05} for k in range(30)]
    run = {"mass": 1.0, "length": 0.1, "kp": 8, "motor": "other", "entries": entries} | changes
    (tmp_path / "run.json").write_text(json.dumps(run))
    return IMPORTERS["bam"](tmp_path, tmp_path / "out")


def test_bam_of_a_motor_that_reports_position_alone(tmp_path):
    (rig_file,) = bam_run(tmp_path)
    (run,) = load_runs(sorted(rig_file.parent.glob("*.parquet")), load_rig(rig_file))
    assert_allclose(run.columns["servo/position"], 0.1 * np.arange(30))
    assert "servo/temperature" not in run.columns


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ([{"timestamp": 0.0, "position": 0.0}], "entries: missing goal_position; present: position, timestamp"),
        ([{"timestamp": 0.0, "position": 0.0}, {"timestamp": 0.1}], "entries: expected the same keys with numbers"),
        ([{"timestamp": "now", "position": 0.0}], "entries: expected the same keys with numbers"),
    ],
)
def test_bam_entries_that_are_odd_are_refused(tmp_path, entries, message):
    with pytest.raises(LogError, match=message):
        bam_run(tmp_path, entries=entries)


def command() -> typer.Typer:
    app = typer.Typer()
    app.command("import")(import_logs)
    return app


def test_command_prints_the_rig_files(data, tmp_path):
    result = CliRunner().invoke(command(), ["staubli", str(data / "staubli-tx40"), "--out", str(tmp_path / "out")])
    assert result.exit_code == 0
    assert result.stdout.splitlines() == [str(tmp_path / "out" / "rig.yaml")]


def test_command_prints_json(data, tmp_path):
    arguments = ["staubli", str(data / "staubli-tx40"), "--out", str(tmp_path / "out"), "--json", "--seed", "0"]
    result = CliRunner().invoke(command(), arguments)
    assert json.loads(result.stdout) == {"name": "import", "rigs": [str(tmp_path / "out" / "rig.yaml")]}


@pytest.mark.parametrize("arguments", [["bam", "nowhere"], ["kuka", "."]])
def test_command_refuses_and_leaves_nothing(tmp_path, arguments):
    result = CliRunner().invoke(command(), [*arguments, "--out", str(tmp_path)])
    assert isinstance(result.exception, LogError)
    assert result.stdout == "" and not list(tmp_path.iterdir())


@pytest.mark.parametrize("rig_name", ["rig_1", "rig_2", "rig_3"])
def test_practice_rigs_load_with_no_note(data, rig_name):
    folder = data / "bench-practice" / rig_name
    rig = load_rig(folder / "rig.yaml")
    runs = load_runs(sorted(folder.glob("run_*")), rig)
    assert [run.name for run in runs] == ["run_multisine", "run_sine", "run_static"]
    for run in runs:
        assert run.period == 1e-3 and len(run) == 29950
        assert run.notes == ()  # a pulse of 88 N m in one of them answers a pulse of the voltage
    assert rig.known("joint", "rotor_inertia") > 0.3
