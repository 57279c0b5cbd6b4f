"""Rig files, logs in several shapes, and the command, all from files alone."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml
from numpy.testing import assert_allclose

from drake_tc.cli.main import run
from drake_tc.errors import LogError, RigError
from drake_tc.estimation.base_log import evaluate_log, read_base_log
from drake_tc.estimation.base_rig import load_base_rig

from .constructed import REAL, ROOT, Motion, construct, walker

PERIOD = 1e-2


@pytest.fixture(scope="module")
def made():
    return construct(Motion(duration=2.0, period=PERIOD), REAL, seed=31)


def document(**changes):
    contact = {"xyz": [0.0, 0.0, -0.055], "sole": [-0.1, 0.1, -0.05, 0.05], "make": 30.0, "break": 20.0}
    return {
        "robot": str(ROOT / "models" / "hrp2_like" / "hrp2_like.yaml"),
        "contacts": {
            side: {"link": f"{side[0]}_foot", "sensor": f"{side}_ankle", **contact} for side in ("left", "right")
        },
        **changes,
    }


def written(folder, **changes):
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(document(**changes)), encoding="utf-8")
    return path


def canonical(made):
    log, joints = made.log, walker().joints
    columns = {"time": log.time + 5.0}
    columns |= {f"{joint}/position": log.q[:, i] for i, joint in enumerate(joints)}
    columns |= {f"{joint}/velocity": log.qd[:, i] for i, joint in enumerate(joints)}
    for i, axis in enumerate("xyz"):
        columns |= {f"imu_torso/gyro_{axis}": log.gyro[:, i], f"imu_torso/accel_{axis}": log.accel[:, i]}
    for k, side in enumerate(("left", "right")):
        names = ("fx", "fy", "fz", "tx", "ty", "tz")
        columns |= {f"ft_{side}_ankle/{name}": log.wrench[:, k, i] for i, name in enumerate(names)}
    return pd.DataFrame(columns)


def as_arrays(made, order):
    log = made.log
    return {
        "stamp": log.time,
        "joints_q": log.q[:, order],
        "joints_qd": log.qd[:, order],
        "names": np.array(walker().joints)[order],
        "omega": log.gyro,
        "acc": log.accel,
        "rpy": np.column_stack([log.tilt, 0.0 * log.time]),
        "lf": log.wrench[:, 0],
        "rf": log.wrench[:, 1],
        "base_xyz": made.truth.position,
        "base_rpy": made.truth.rpy,
        "another_clock": np.arange(3.0),
    }


COLUMNS = {
    "time": "stamp",
    "position": "joints_q",
    "velocity": "joints_qd",
    "joint_order": "names",
    "gyro": "omega",
    "accel": "acc",
    "roll_pitch": "rpy",
    "truth_position": "base_xyz",
    "truth_rpy": "base_rpy",
}


def npz_rig(folder):
    contacts = document()["contacts"]
    for side in contacts:
        contacts[side]["wrench"] = f"{side[0]}f"
    return written(folder, columns=COLUMNS, contacts=contacts)


def test_a_log_in_canonical_columns(tmp_path, made):
    canonical(made).to_csv(tmp_path / "run.csv", index=False)
    log, truth, period = read_base_log(load_base_rig(written(tmp_path)), tmp_path / "run.csv")
    assert truth is None
    assert_allclose(period, PERIOD, rtol=1e-9)
    for name in ("time", "q", "qd", "gyro", "accel", "wrench"):
        assert_allclose(getattr(log, name), getattr(made.log, name), atol=1e-9)
    assert np.isnan(log.tilt).all()


def test_without_velocities_they_are_differences(tmp_path, made):
    table = canonical(made)
    table[[name for name in table if not name.endswith("/velocity")]].to_csv(tmp_path / "run.csv", index=False)
    log, _, _ = read_base_log(load_base_rig(written(tmp_path)), tmp_path / "run.csv")
    assert_allclose(log.qd[1:], np.diff(log.q, axis=0) / PERIOD, atol=1e-9)


def test_arrays_of_an_npz_in_any_order_of_joints(tmp_path, made):
    order = np.random.default_rng(0).permutation(30)
    np.savez(tmp_path / "run.npz", **as_arrays(made, order))
    result = evaluate_log(load_base_rig(npz_rig(tmp_path)), tmp_path / "run.npz")
    ours, base = result.errors
    assert np.linalg.norm(ours.position) < 0.2 * np.linalg.norm(base.position)
    log, truth, _ = read_base_log(load_base_rig(npz_rig(tmp_path)), tmp_path / "run.npz")
    assert_allclose(log.q, made.log.q)
    assert_allclose(log.tilt, made.log.tilt)
    assert_allclose(truth.position, made.truth.position)


def test_the_command_prints_json_and_writes_files(tmp_path, made, capsys):
    np.savez(tmp_path / "run.npz", **as_arrays(made, np.arange(30)))
    rig = npz_rig(tmp_path)
    arguments = ["estimate-base", "--rig", str(rig), "--log", str(tmp_path / "run.npz"), "--out", str(tmp_path / "out")]
    assert run([*arguments, "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    values = {row["name"]: row["value"] for row in shown["rows"]}
    assert len(values) == 18
    assert values["estimate/position_y"] < 0.2 * values["foot_centre/position_y"]
    assert values["estimate/angle_yaw"] < 0.5
    table = pd.read_csv(tmp_path / "out" / "estimate.csv")
    assert len(table) == shown["samples"] == len(made.log.time)
    rms = np.sqrt(np.mean((table["base/y"] - table["truth/y"]) ** 2))
    assert_allclose(rms, values["estimate/position_y"], rtol=1e-6)
    assert json.loads((tmp_path / "out" / "estimate.json").read_text())["rows"] == shown["rows"]
    assert run(arguments) == 0
    assert "RMSE against the truth" in capsys.readouterr().out


def test_a_start_of_ones_own(tmp_path, made):
    canonical(made).to_parquet(tmp_path / "run.parquet")
    rig = load_base_rig(written(tmp_path, start={"position": [1.0, 2.0, 0.65], "yaw": 1.5}))
    result = evaluate_log(rig, tmp_path / "run.parquet")
    assert_allclose(result.estimate.position[0], [1.0, 2.0, 0.65], atol=1e-9)
    assert_allclose(result.estimate.rpy[0, 2], 1.5, atol=1e-9)
    assert result.errors is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"robots": "x"}, "unknown key 'robots'; did you mean 'robot'"),
        ({"contacts": {}}, "at least one contact"),
        ({"contacts": {"left": {"link": "l_foot", "make": 3.0, "break": 2.0}}}, "contacts.left: expected a sensor"),
        ({"contacts": {"left": {"link": "l_foot", "sensor": "left_ankle", "make": 2.0, "break": 3}}}, "break <= make"),
        ({"contacts": {"left": {"link": "l_foot", "sensor": "left_ankle", "sole": [1, 0, 0, 1], "make": 3.0,
                                "break": 2.0}}}, "x from, x to"),
        ({"estimator": {"ground": "flat"}}, "estimator.ground: expected one of unknown, level, got 'flat'"),
        ({"estimator": {"velocity_tim": 1.0}}, "estimator: unknown key 'velocity_tim'; did you mean 'velocity_time'"),
        ({"columns": {"stamp": "t"}}, "unknown key 'stamp'"),
        ({"start": {"position": [0.0, 0.0]}}, "start.position: expected a list of 3 numbers"),
        ({"robot": "nowhere.yaml"}, "nowhere.yaml"),
    ],
)  # fmt: skip
def test_rig_files_that_say_something_impossible(tmp_path, changes, message):
    with pytest.raises(RigError, match=message) as caught:
        load_base_rig(written(tmp_path, **changes))
    assert "\n" not in str(caught.value)


def test_logs_that_cannot_be_used(tmp_path, made):
    rig = load_base_rig(written(tmp_path))
    table = canonical(made)

    def refused(changed, message):
        changed.to_csv(tmp_path / "bad.csv", index=False)
        with pytest.raises(LogError, match=message):
            read_base_log(rig, tmp_path / "bad.csv")

    refused(table.drop(columns="imu_torso/gyro_y"), "no column 'imu_torso/gyro_y'")
    refused(table.iloc[::-1], "does not increase at row 2")
    refused(table.drop(index=range(50, 90)), "a gap of 0.41 s before row 51")
    refused(table.iloc[:5], "at least ten")
    refused(table.assign(**{"l_knee/position": "bent"}), "expected numbers")
    with pytest.raises(LogError, match="no such log file"):
        read_base_log(rig, tmp_path / "none.npz")
    (tmp_path / "broken.npz").write_bytes(b"PK nothing")
    with pytest.raises(LogError, match=r"cannot be read as \.npz"):
        read_base_log(rig, tmp_path / "broken.npz")
    for name, what in (
        ("omega", "gyro"),
        ("rf", "wrench of right"),
        ("base_rpy", "truth_rpy"),
        ("joints_qd", "velocity"),
    ):
        short = as_arrays(made, np.arange(30))
        short[name] = short[name][:-3]
        np.savez(tmp_path / "short.npz", **short)
        with pytest.raises(LogError, match=f"{what}: expected 200 rows, as many as times, got 197"):
            read_base_log(load_base_rig(npz_rig(tmp_path)), tmp_path / "short.npz")
    narrow = as_arrays(made, np.arange(30))
    narrow["acc"] = narrow["acc"][:, :2]
    np.savez(tmp_path / "narrow.npz", **narrow)
    with pytest.raises(LogError, match="accel: expected 3 columns in 'acc'"):
        read_base_log(load_base_rig(npz_rig(tmp_path)), tmp_path / "narrow.npz")


def test_the_command_ends_with_two_and_one_line(tmp_path, capsys):
    for rig, log in ((tmp_path / "no.yaml", "x.csv"), (written(tmp_path), str(tmp_path / "no.csv"))):
        assert run(["estimate-base", "--rig", str(rig), "--log", str(log)]) == 2
        error = capsys.readouterr().err.strip().splitlines()
        assert len([line for line in error if line.startswith("drake-tc:")]) == 1


def test_missing_readings_stay_missing(tmp_path, made):
    table = canonical(made)
    table.loc[20:25, "imu_torso/gyro_x"] = np.nan
    table.to_csv(tmp_path / "run.csv", index=False)
    result = evaluate_log(load_base_rig(written(tmp_path)), tmp_path / "run.csv")
    assert result.flag_shares()["imu_missing"] == pytest.approx(6.0 / len(table))
    assert np.isfinite(result.estimate.position).all()
    assert replace(result, truth=None).errors is None


def test_a_contact_of_no_link_names_the_rig_file(tmp_path, made):
    canonical(made).to_csv(tmp_path / "run.csv", index=False)
    entry = document()["contacts"]["left"]
    rig = load_base_rig(written(tmp_path, contacts={"left": {**entry, "link": "l_foo"}}))
    with pytest.raises(RigError, match=r"rig\.yaml: left: .*there is no link 'l_foo'"):
        evaluate_log(rig, tmp_path / "run.csv")
