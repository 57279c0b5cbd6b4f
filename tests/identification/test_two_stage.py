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


def test_the_error_of_the_gain_counts_where_the_load_moves_with_the_joint():
    """With tau = 30 v in motion, K_v takes up 30 times the error of K_tau: 900 s^2/sum tau_rest^2 more than alone.

    Alone its variance is s^2 [(Z^T Z)^-1]_vv with the columns Z of v and sign(v).
    """
    stated, expected = [], []
    for seed in range(40):
        tau, velocity, _ = log(seed, 0.0)
        tau[500:] = 30.0 * velocity[500:]
        noise = np.random.default_rng([seed, 1]).normal(size=2000)
        effort = TRUTH["K_tau"] * tau + TRUTH["K_v"] * velocity + 1e-3 * noise
        fit = fit_two_stage(tau, velocity, effort, still_below=1e-6)
        stated.append(fit.moving.hac_covariance[0, 0])
        columns = np.stack([velocity[500:], np.sign(velocity[500:])], axis=1)
        alone = 1e-6 * np.linalg.inv(columns.T @ columns)[0, 0]
        expected.append(alone + 900.0 * 1e-6 / np.sum(tau[:500] ** 2))
    assert_allclose(np.mean(stated), np.mean(expected), rtol=0.1)  # 40 estimates of a variance, each within some 20 %


def test_a_log_without_rest_is_refused():
    with pytest.raises(IdentificationError, match="at rest and in motion"):
        fit_two_stage(*log(0, 0.0), still_below=-1.0)
