"""Drive gain from rest, friction from motion."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import IdentificationError
from drake_tc.identification.two_stage import fit_two_stage

TRUTH = {"K_tau": 2e-4, "K_v": 7e-3, "K_c": 3e-3}


def log(seed, noise):
    rng = np.random.default_rng(seed)
    velocity = np.concatenate([np.zeros(500), rng.normal(size=1500)])
    tau = rng.normal(size=2000) * 30
    effort = TRUTH["K_tau"] * tau + TRUTH["K_v"] * velocity + TRUTH["K_c"] * np.sign(velocity)
    return tau, velocity, effort + noise * rng.normal(size=2000)


def test_without_noise_all_three_are_exact():
    fit = fit_two_stage(*log(0, 0.0), still_below=1e-6)
    assert_allclose([fit.parameters[k] for k in TRUTH], list(TRUTH.values()), rtol=1e-9)
    assert_allclose(fit.residual, 0, atol=1e-12)
    assert fit.still.sum() == 500


def test_intervals_cover_and_include_the_first_stage():
    hits = np.zeros(3)
    for seed in range(200):
        fit = fit_two_stage(*log(seed, 1e-3), still_below=1e-6, lengths=[700, 1300])
        hits += [fit.intervals[k][0] < v < fit.intervals[k][1] for k, v in TRUTH.items()]
    assert np.all((hits / 200 > 0.90) & (hits / 200 <= 0.995)), hits / 200


def test_coulomb_can_be_left_out():
    tau, velocity, effort = log(0, 0.0)
    fit = fit_two_stage(tau, velocity, effort - 3e-3 * np.sign(velocity), still_below=1e-6, coulomb=False)
    assert set(fit.parameters) == {"K_tau", "K_v"}
    assert_allclose(fit.parameters["K_v"], 7e-3, rtol=1e-9)


def test_a_log_without_rest_is_refused():
    with pytest.raises(IdentificationError, match="at rest and in motion"):
        fit_two_stage(*log(0, 0.0), still_below=-1.0)
