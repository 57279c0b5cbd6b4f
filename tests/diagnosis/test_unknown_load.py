"""`load: unknown`: the load is fitted from the motion and the effort alone, against closed forms."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.model_file import load_model_file
from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.prepared import Prepared, prepare_joint
from drake_tc.diagnosis.problem.regression import effort_left, fit
from drake_tc.diagnosis.result.models import models_of
from drake_tc.diagnosis.run import close_loop
from drake_tc.effects.library import effect
from drake_tc.errors import IdentificationError
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import Rig, load_rig, save_rig
from drake_tc.loops.joint_bench import rig_free_run
from drake_tc.report.data_files import joint_json
from tests.benchmarks.importers import dfki, tmotor, uart_backlash

from . import pendulum_rig
from .pendulum_rig import JOINT, Swing, rig_of, runs_of

SWING = Swing()
SERVO = replace(SWING, drive="position_servo", gain=0.01, encoder_noise=2e-5)
SMOOTH = {"unknown": "smooth"}


def curve(q: np.ndarray) -> np.ndarray:
    return 1.5 * np.sin(2.0 * q) + 0.5 * q


def prepared(swing: Swing, rig: Rig) -> Prepared:
    return prepare_joint(*runs_of(swing), rig, JOINT)


@pytest.mark.parametrize("scaled_by_inertia", [False, True])
def test_a_smooth_load_follows_the_curve(scaled_by_inertia: bool) -> None:
    swing = replace(SWING, gravity=curve, constant=0.0)
    more = {"drive_gain": None, "declared": {"rotor_inertia": swing.inertia}} if scaled_by_inertia else {}
    p = prepared(swing, rig_of(swing, SMOOTH, **more))
    samples = p.train.samples
    s, rows = samples.signals, samples.rows
    told = s.load_torque[rows] - s.link_inertia * s.acceleration[rows]
    assert_allclose(told, curve(s.position[rows]), atol=0.02 * np.ptp(curve(s.position[rows])))
    gain = fit(p.train, p.terms).gain
    assert_allclose(gain, swing.gain, rtol=0.02)
    assert_allclose(s.link_inertia + s.rotor_inertia, swing.inertia, rtol=0.02)


@pytest.mark.parametrize(
    ("swing", "message"),
    [
        (replace(SWING, size=0.05), r"cannot be fitted to a motion over 0\.1\d* rad.*set load: \{unknown: smooth\}$"),
        (replace(SWING, gain=-0.4, constant=0.0), "the effort has the wrong sign"),
    ],
)
def test_what_the_motion_cannot_tell_is_refused_in_one_line(swing: Swing, message: str) -> None:
    with pytest.raises(IdentificationError, match=message) as refused:
        prepared(swing, rig_of(swing, drive_gain=abs(swing.gain)))
    assert "\n" not in str(refused.value)


def test_a_small_travel_is_enough_for_a_smooth_load() -> None:
    assert prepared(replace(SWING, size=0.05), rig_of(SWING, SMOOTH)).terms[-1].effect.key == "unknown_load.smooth_2"


def test_taking_the_effort_away_explains_nothing() -> None:
    """The effort is the target: a dead zone that swallows nine tenths of it must not count as a better model."""
    p = prepared(SWING, rig_of(SWING))
    width = 0.9 * float(np.abs(p.train.samples.signals.effort).max())
    wide = Term(effect("deadzone"), {"deadzone": width})
    assert fit(p.train, [*p.terms, wide]).cv_rms > fit(p.train, p.terms).cv_rms
    known = Columns(build_samples(runs_of(SWING)[0], rig_of(SWING), JOINT), declared_gain=None)
    assert not known.effort_is_target and effort_left(known, [wide]) == 1.0


def written(folder: Path, swing: Swing, rig: Rig) -> tuple[Path, list[Path]]:
    logs = []
    for run in (run for side in runs_of(swing) for run in side):
        logs.append(folder / f"{run.name}.csv")
        pd.DataFrame({"time": run.time, **run.columns}).to_csv(logs[-1], index=False)
    return save_rig(rig, folder / "rig.yaml"), logs


def test_from_files_to_a_free_run_without_any_scale(tmp_path: Path) -> None:
    swing = replace(SWING, drive="position_servo", gain=0.01, encoder_noise=2e-5, duration=10.0, period=4e-3)
    rig, logs = written(tmp_path, swing, rig_of(swing, drive_gain=None))
    quick = DiagnosisOptions(effects=(effect("stribeck"), effect("cable_spring")), assess_residual=False)
    result = close_loop(rig, logs[:2], logs[2:], quick, rig_free_run)
    joint = result.joints[JOINT]
    assert joint.after.free_run_heldout is not None and joint.after.free_run_heldout < 0.01  # of a motion of 2.8 rad
    entry = joint_json(joint)
    assert entry["load"]["title"].startswith("unknown load") and "inertia" in entry["load"]["parameters"]
    assert any("set to 1 rad per N*m, because nothing in the rig fixes the scale" in note for note in entry["notes"])
    assert joint.load_notes
    models_of(result, tmp_path)
    assert load_model_file(tmp_path / "model_after.yaml").torque_as_effort == (JOINT,)


def imported(data: Path, name: str, convert: Callable[[Path, Path], object], out: Path, folder: str) -> Path:
    convert(data / name, out)
    rig = load_rig(out / folder / "rig.yaml")
    assert set(rig.load.values()) == {"unknown"}
    return out / folder


def test_an_imported_rig_of_unknown_load_is_fitted(data: Path, tmp_path: Path) -> None:
    """Each joint of the double pendulum has its own fit; that the links are coupled is for `load: {robot: fitted}`."""
    folder = imported(data, "dfki-double-pendulum", dfki.convert, tmp_path, "double_C0_20220914")
    rig, logs = load_rig(folder / "rig.yaml"), sorted(folder.glob("*.parquet"))[:3]
    runs = load_runs(logs, rig)
    for joint in rig.joints:
        p = prepare_joint(runs[:2], runs[2:], rig, joint)
        assert p.terms[-1].effect.key == "unknown_load.pendulum"
        assert np.isfinite(p.train.samples.signals.load_torque[p.train.samples.rows]).all()


@pytest.mark.parametrize(
    ("name", "folder", "log", "message"),
    [
        ("tmotor-ak80-9-bench", "free_running", "torque_step_1Nm", "moves in one direction only"),
        ("uart-servo-backlash", "nocomp2", "run", "too little motion"),
    ],
)
def test_imported_runs_that_cannot_tell_the_load_say_why(
    data: Path, tmp_path: Path, name: str, folder: str, log: str, message: str
) -> None:
    convert = tmotor.convert if name.startswith("tmotor") else uart_backlash.convert
    source = imported(data, name, convert, tmp_path, folder)
    rig = load_rig(source / "rig.yaml")
    runs = load_runs([source / f"{log}.parquet"], rig)
    with pytest.raises(IdentificationError, match=message):
        prepare_joint(runs, runs, rig, rig.joints[0])


def test_the_module_under_test_writes_no_torque_column() -> None:
    run = pendulum_rig.record(SWING, "run", 0)
    assert set(run.columns) == {f"{JOINT}/position", f"{JOINT}/current"}
