"""Sampling instants that scatter about their stamps: fast strokes are loud, and nothing is missing.

A pendulum under a current drive, J = 0.25 kg m^2 with the rotor, m g l = 3 N m, viscous 0.4 N m s/rad, Coulomb 0.6 N m;
minimum-jerk strokes, one in four of them several times as fast as the others.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from few_effects import experiments_fit

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.notes import ScatteringTimes
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.run import close_loop
from drake_tc.effects.library import effect
from drake_tc.experiments.check.run import check_rig
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig, parse_rig, save_rig
from drake_tc.types import FloatArray

FINE, PERIOD, SECONDS = 1e-4, 4e-3, 30.0
INERTIA, MOMENT, VISCOUS, COULOMB, GAIN = 0.25, 3.0, 0.4, 0.6, 0.5
MASS = 1.0
LENGTH = MOMENT / 9.81
Torque = Callable[[FloatArray, FloatArray], FloatArray]


def strokes(rng: np.random.Generator) -> FloatArray:
    """Position [rad] at every tenth of a millisecond."""
    out, here = [np.zeros(300)], 0.0
    while sum(map(len, out)) * FINE < SECONDS:
        goal, fast = rng.uniform(-1.0, 1.0), rng.choice([0.4, 0.6, 0.8, 4.0])
        count = round(max(1.875 * abs(goal - here) / fast, 0.25) / FINE)
        s = np.arange(count) / count
        out.append(here + (goal - here) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2))
        here = goal
    return np.concatenate(out)[: round(SECONDS / FINE)]


def log(seed: int, scatter: float, extra: Torque | None = None) -> pd.DataFrame:
    """Position and current at t_k + delta_k, with the stamps t_k."""
    motion, rng = strokes(np.random.default_rng(seed)), np.random.default_rng([seed, 1])
    time = np.arange(motion.size) * FINE
    v = np.gradient(motion, FINE)
    torque = INERTIA * np.gradient(v, FINE) + MOMENT * np.sin(motion) + VISCOUS * v
    torque += COULOMB * np.sign(v) * (np.abs(v) > 1e-4)
    torque += 0.0 if extra is None else extra(time, v)
    stamps = np.arange(0.02, SECONDS - 0.02, PERIOD)
    at = stamps + scatter * rng.standard_normal(stamps.size)
    position = np.interp(at, time, motion) + 2e-6 * rng.standard_normal(stamps.size)
    current = GAIN * np.interp(at, time, torque) + 0.01 * rng.standard_normal(stamps.size)
    return pd.DataFrame({"time": stamps.round(7), "joint/position": position, "joint/current": current})


def written(folder: Path, scatter: float, held: Torque | None = None, every: Torque | None = None) -> list[Path]:
    """Three runs, the last of them held out, and the rig file."""
    paths = [folder / f"run_{k}.csv" for k in range(3)]
    for k, path in enumerate(paths):
        log(k, scatter, held if k == 2 and held else every).to_csv(path, index=False)
    rotor = INERTIA - MASS * LENGTH**2
    document = {
        "joint": "joint",
        "drive": "current",
        "load": {"pendulum": {"mass": MASS, "length": LENGTH}},
        "declared": {"rotor_inertia": rotor},
        "drive_gain": GAIN,
    }
    return [*paths, save_rig(parse_rig(document), folder / "rig.yaml")]


def diagnosed(folder: Path, scatter: float, held: Torque | None = None, every: Torque | None = None) -> JointResult:
    *paths, rig = written(folder, scatter, held, every)
    options = DiagnosisOptions(effects=(effect("stribeck"), effect("payload")))
    return close_loop(rig, paths[:2], paths[2:], options).joints["joint"]


def notes_of(result: JointResult) -> list[ScatteringTimes]:
    return [note for note in result.notes if isinstance(note, ScatteringTimes)]


def test_fast_strokes_of_a_sound_joint_are_no_structure(tmp_path):
    found = diagnosed(tmp_path, 1e-4)
    assert found.verdict == "no_missing_effect"
    assert found.unexplained.confined_to == ()
    # what is left is what the noise floor says, of the held-out runs and of the others
    assert 0.8 < found.unexplained.floors < 1.3
    assert 0.8 < found.unexplained.floors_anywhere < 1.3
    (note,) = notes_of(found)
    assert note.scatter == pytest.approx(1e-4, rel=0.1)
    assert note.speed == pytest.approx(4.0, rel=0.15)


def test_the_noise_floor_is_what_the_scatter_leaves(tmp_path, scatter=1e-4):
    """Residual under the true coefficients with the scatter less that without: all rows, loud ones and quiet ones."""
    *paths, file = written(tmp_path, scatter)
    rig = load_rig(file)
    samples = build_samples(load_runs(paths, rig), rig, "joint")
    assert samples.timing is not None
    (tmp_path / "clean").mkdir()
    *clean, _ = written(tmp_path / "clean", 0.0)
    width, final = samples.light.width_s, samples.kernel.width_s
    still = build_samples(load_runs(clean, rig), rig, "joint", width_s=width, final_s=final)
    terms, beta = (Term(effect("viscous")), Term(effect("coulomb"))), np.array([1.0 / GAIN, VISCOUS, COULOMB])
    (one, here), (other, there) = (
        ((c := Columns(s)).target - c.design(terms) @ beta, np.isin(s.rows, np.intersect1d(samples.rows, still.rows)))
        for s in (samples, still)
    )
    added, variance = one[here] - other[there], samples.floor.timing_variance(VISCOUS, moments=samples.timing)[here]
    loud = variance > np.quantile(variance, 0.8)
    # the few fast strokes hold some hundred independent values of the filtered noise: 2 sigma of their RMS are 15 %
    for rows, within in ((slice(None), 0.15), (loud, 0.15), (~loud, 0.3)):
        assert np.sqrt(np.mean(added[rows] ** 2)) == pytest.approx(np.sqrt(np.mean(variance[rows])), rel=within)


def test_check_tells_the_scatter(tmp_path, monkeypatch):
    experiments_fit(monkeypatch, "stribeck")
    *paths, rig = written(tmp_path, 1e-4)
    (told,) = [f for f in check_rig(rig, paths).joints["joint"].findings if f.name == "sample times"]
    assert told.value == pytest.approx(1e-4, rel=0.1)
    assert told.level == "note"
