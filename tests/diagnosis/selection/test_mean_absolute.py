"""Rows that err much, such as those at which a gear crosses its gap, must not be bought with an error of all others."""

from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.problem.regression import Fit, fit, predict
from drake_tc.diagnosis.root_mean_square import mean_absolute, rms
from drake_tc.diagnosis.selection.confirmation import _worse_than
from drake_tc.diagnosis.selection.withdrawal import LargerThanDeclared
from drake_tc.effects.library import effect

from ..pendulum_rig import JOINT, Swing, rig_of, runs_of

SWING = Swing(encoder_noise=2e-5)


def fits(swing: Swing) -> tuple[Fit, Columns, Columns, Fit]:
    """The declared model, training and held-out rows, and the model with friction on a line over the position."""
    p, linear = prepare_joint(*runs_of(swing), rig_of(swing), JOINT), effect("position_dependent_friction.linear")
    chosen = fit(p.train, [*p.terms, Term(linear, linear.shape_grid(p.context)[0])])
    return fit(p.train, p.terms), p.train, p.held, chosen


def bursts(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """2 N m against the motion within 40 mrad of one position, and nothing elsewhere."""
    return np.asarray(2.0 * np.sign(v) * (np.abs(q - 0.9) < 0.04))


def line(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """The effect itself."""
    return np.asarray(0.05 * np.sign(v) * q)


def test_an_effect_that_fits_bursts_leaves_more_on_average():
    declared, train, held, chosen = fits(replace(SWING, extra=bursts))
    for rows in (train, held):
        assert rms(predict(rows, chosen)) < rms(predict(rows, declared))
    found = _worse_than(declared, train, held, chosen)
    assert isinstance(found, LargerThanDeclared) and found.part == "mean absolute"
    growth = [mean_absolute(predict(r, chosen)) / mean_absolute(predict(r, declared)) - 1.0 for r in (train, held)]
    assert found.growth == min(growth) > 0.03


def test_an_effect_that_acts_leaves_less_on_average():
    assert _worse_than(*fits(replace(SWING, extra=line))) is None
