"""A curve over the position, or a wrong scale of the known load?"""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import Fit, fit
from drake_tc.diagnosis.selection.known_load import looks_like_known_load, share_of_known_load
from drake_tc.diagnosis.thresholds import MOST_OF_KNOWN_LOAD, OWN_FORM
from drake_tc.effects.library import effect

from .runs import DECLARED, PLAIN, QUADRATIC, columns_of

NOISE = 0.1
STIFFNESS = 3000.0
WAVE = Term(effect("encoder_eccentricity.separate"))


@pytest.fixture(scope="module")
def pendulum() -> Columns:
    """A position servo that holds a pendulum: gravity is a function of the angle, the inertial part is none."""
    samples = columns_of([PLAIN] * 3, "train").samples
    s = samples.signals
    load = 8.0 * np.sin(s.position) + 0.3 * s.acceleration
    return Columns(replace(samples, signals=replace(s, load_torque=load, stiffness=STIFFNESS)))


def missing(pendulum: Columns, torque: np.ndarray) -> Columns:
    """Rows in which the drive overcomes a further torque (N,) that the model lacks, with noise."""
    balance = Columns(pendulum.samples).design(DECLARED) @ [12.5, 6.0, 3.0]
    noise = NOISE * np.random.default_rng(3).standard_normal(torque.size)
    return Columns(pendulum.samples, pendulum.gain, pendulum.floor, balance - torque + noise)


def wave(pendulum: Columns, amplitude: float, phase: float) -> np.ndarray:
    """Torque (N,) of an encoder that errs by amplitude sin(q + phase)."""
    theta = amplitude * np.array([np.cos(phase), np.sin(phase)])
    return pendulum.of(WAVE) @ theta


@pytest.mark.parametrize("phase", [0.0, 0.8, 2.2, 2.4, np.pi / 2])
def test_an_eccentricity_is_kept_unless_its_phase_is_that_of_gravity(pendulum, phase):
    rows = missing(pendulum, wave(pendulum, 1e-3, phase))
    found = fit(rows, [*DECLARED, WAVE])
    share, own = share_of_known_load(found, WAVE, rows)
    objection = looks_like_known_load(found, WAVE, rows)
    assert (objection is not None) == (phase == 0.0)
    if phase == 0.8:  # mostly the form of the load, and the rest is not far above the noise
        assert share > MOST_OF_KNOWN_LOAD
        assert own < OWN_FORM * found.rms / found.gain


@pytest.mark.parametrize("scale", [-0.3, -0.05, 0.05, 0.3])
@pytest.mark.parametrize("inertia", [-0.1, 0.0, 0.1])
def test_a_wrong_scale_of_the_load_is_no_eccentricity(pendulum, scale, inertia):
    s = pendulum.samples.signals
    rows = missing(pendulum, pendulum.samples.reduce(scale * s.load_torque + inertia * s.acceleration))
    assert looks_like_known_load(fit(rows, [*DECLARED, WAVE]), WAVE, rows) is not None


def test_a_curve_that_is_a_multiple_of_the_known_load_is_told_from_one_that_is_not(pendulum):
    s = pendulum.samples.signals
    term = Term(effect("position_dependent_load"), {"curve_start": -1.1, "curve_end": 1.1})
    gravity = pendulum.samples.reduce(8.0 * np.sin(s.position))
    known = np.linalg.lstsq(pendulum.of(term), gravity, rcond=None)[0]
    for theta, alike in ((-0.3 * known, True), (np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0]), False)):
        fitted = Fit((*DECLARED, term), np.array([12.5, 6.0, 3.0, *theta]), np.zeros(1), 1.0, 1.0, np.zeros(1))
        assert (share_of_known_load(fitted, term, pendulum)[0] > MOST_OF_KNOWN_LOAD) == alike
        assert (looks_like_known_load(fitted, term, pendulum) is not None) == alike
    quadratic = fit(pendulum, [*DECLARED, QUADRATIC])
    assert looks_like_known_load(quadratic, QUADRATIC, pendulum) is None
