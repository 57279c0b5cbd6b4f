"""The torque that a model expects must not hold the residual of the regression that it is a column of."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.signal import savgol_filter

from drake_tc.diagnosis.data.link_prior import LinkPrior
from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import fit, noise_smoothed, predict
from drake_tc.effects.library import effect
from drake_tc.logs.prepare import load_run
from drake_tc.logs.rig import parse_rig

GAIN = 0.05
DECLARED = [Term(effect("viscous")), Term(effect("coulomb"))]


@pytest.fixture
def columns(tmp_path: Path) -> Columns:
    """A joint with next to no load whose effort holds a disturbance of 1 to 5 Hz that nothing explains."""
    t = np.arange(6000) * 0.005
    q, v = np.sin(1.7 * t) + 0.3 * np.sin(4.1 * t), 1.7 * np.cos(1.7 * t) + 1.23 * np.cos(4.1 * t)
    white = np.random.default_rng(3).normal(size=t.size)
    disturbance = savgol_filter(white, 31, 2) * 2.0
    effort = GAIN * (1.5 * v + 0.8 * np.tanh(50.0 * v) + disturbance)
    table = pd.DataFrame({"time": t, "j/position": q, "j/position_command": q + effort, "j/torque": 1e-9 * q})
    path = tmp_path / "run.csv"
    table.to_csv(path, index=False)
    rig = parse_rig({"joint": "j", "drive": "position_servo", "drive_gain": GAIN})
    return Columns(build_samples([load_run(path, rig)], rig, "j"), declared_gain=GAIN)


def explained_by_backlash(columns: Columns) -> float:
    plain = fit(columns, DECLARED)
    known = columns.with_model(plain.terms, plain.beta, servo=True)
    both = fit(known, [*DECLARED, Term(effect("backlash"))])
    return 1.0 - float(np.std(predict(known, both)) / np.std(predict(columns, plain)))


def test_the_sign_of_the_residual_is_no_column_where_the_effort_is_the_target(columns: Columns) -> None:
    """The sign of a Gaussian residual explains 1 - sqrt(1 - 2/pi) = 40 % of it, whatever the joint is."""
    prior = LinkPrior(np.zeros(0), 1.0)
    fitted = Columns(replace(columns.samples, link_prior=prior), declared_gain=GAIN)
    assert fitted.effort_is_target
    assert abs(explained_by_backlash(fitted)) < 0.02


def test_a_lag_does_not_explain_what_it_only_smooths_away(columns: Columns) -> None:
    """e + T de/dt of e = sin(w t) is larger by sqrt(1 + w^2 T^2); the lag of a joint that has none gains nothing."""
    t = columns.samples.signals.time[columns.samples.rows]
    wave = Columns(
        replace(columns.samples, link_prior=LinkPrior(np.zeros(0), 1.0)), target=np.sin(12.0 * t), declared_gain=GAIN
    )
    lag = Term(effect("current_lag"), {"lag": 0.05})
    assert noise_smoothed(wave, [lag], np.zeros(1)) == pytest.approx(np.hypot(1.0, 12.0 * 0.05), rel=0.02)
    assert noise_smoothed(wave, [], np.zeros(1)) == 1.0
    assert noise_smoothed(columns, [lag], np.zeros(1)) == 1.0  # the effort is not the target
    fitted = Columns(wave.samples, declared_gain=GAIN)
    known = fitted.with_model(DECLARED, fit(fitted, DECLARED).beta, servo=True)
    least = fit(known, DECLARED).cv_rms
    assert min(fit(known, [*DECLARED, Term(lag.effect, {"lag": x})]).cv_rms for x in (0.01, 0.03, 0.1)) > 0.99 * least
