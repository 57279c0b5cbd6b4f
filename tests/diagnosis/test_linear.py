"""Evidence of a linear model against the dense Gaussian that it stands for."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear, nnls
from scipy.stats import multivariate_normal

from drake_tc.diagnosis.linear import Prior, Products, mode, posterior
from drake_tc.types import FloatArray

RNG = np.random.default_rng(5)


def _prior(size: int, *, positive: bool = False) -> Prior:
    return Prior(np.full(size, 0.3), np.linspace(0.5, 2.0, size), np.full(size, positive))


def test_the_evidence_is_that_of_the_dense_gaussian() -> None:
    x, prior, variance = RNG.normal(size=(30, 4)), _prior(4), 0.49
    u = x @ np.array([1.0, -0.5, 0.2, 0.7]) + 0.7 * RNG.normal(size=30)
    dense = multivariate_normal(x @ prior.mean, variance * np.eye(30) + (x * prior.deviation**2) @ x.T)
    found = posterior(Products.of(x, u), prior, variance)
    np.testing.assert_allclose(found.log_evidence, dense.logpdf(u), rtol=1e-9)


def test_the_covariance_is_that_of_the_conditional_gaussian() -> None:
    x, prior, variance = RNG.normal(size=(25, 3)), _prior(3), 0.3
    joint = np.diag(prior.deviation**2)
    gain = joint @ x.T @ np.linalg.inv(variance * np.eye(25) + x @ joint @ x.T)
    found = posterior(Products.of(x, RNG.normal(size=25)), prior, variance)
    np.testing.assert_allclose(found.covariance, joint - gain @ x @ joint, rtol=1e-8, atol=1e-12)


def test_the_estimated_variance_is_that_of_the_noise() -> None:
    x = RNG.normal(size=(4000, 3))
    u = x @ np.array([1.0, 2.0, 3.0]) + 0.2 * RNG.normal(size=4000)
    found = posterior(Products.of(x, u), Prior(np.zeros(3), np.full(3, 10.0), np.zeros(3, dtype=bool)))
    assert found.variance == pytest.approx(0.04, rel=0.1)  # four standard deviations of 4000 samples: 9 %


def test_coefficients_with_a_bound_are_those_of_non_negative_least_squares() -> None:
    x = RNG.normal(size=(200, 3))
    u = x @ np.array([1.0, -0.8, 0.5]) + 0.1 * RNG.normal(size=200)
    wide = Prior(np.zeros(3), np.full(3, 1e4), np.ones(3, dtype=bool))
    np.testing.assert_allclose(posterior(Products.of(x, u), wide, 0.01).beta, nnls(x, u)[0], rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("reach", [0.5, 2.0, np.inf])
def test_coefficients_that_reach_so_far_are_those_of_bounded_least_squares(reach: float) -> None:
    x, mean, deviation = RNG.normal(size=(200, 3)), np.array([0.2, -0.3, 0.0]), np.array([1.0, 0.4, 1e4])
    u = x @ np.array([1.0, -0.8, 0.5]) + 0.1 * RNG.normal(size=200)
    prior = Prior(mean, deviation, np.zeros(3, dtype=bool), np.array([reach, reach, np.inf]))
    most = prior.reach * deviation
    both = np.vstack([x / 0.1, np.diag(1.0 / deviation)])
    expected = lsq_linear(both, np.concatenate([u / 0.1, mean / deviation]), (mean - most, mean + most), tol=1e-14)
    np.testing.assert_allclose(posterior(Products.of(x, u), prior, 0.01).beta, expected.x, rtol=1e-6, atol=1e-8)
    assert (np.abs(expected.x - mean) < 0.999 * most).all() == (reach > 1.0)  # no bound acts, or one does


def test_products_of_parts_add_up_to_those_of_the_whole() -> None:
    x, u = RNG.normal(size=(40, 2)), RNG.normal(size=40)
    parts, whole = Products.of(x[:15], u[:15]) + Products.of(x[15:], u[15:]), Products.of(x, u)
    beta = np.array([0.4, -1.0])
    np.testing.assert_allclose(parts.rss(beta), whole.rss(beta), rtol=1e-12)
    np.testing.assert_allclose(whole.rss(beta), np.sum((u - x @ beta) ** 2), rtol=1e-10)


def test_a_column_that_says_nothing_costs_evidence_and_one_that_acts_gains_it() -> None:
    x = RNG.normal(size=(300, 2))
    u = x[:, 0] + 0.3 * RNG.normal(size=300)
    acts, nothing = x[:, :1], x
    alone = posterior(Products.of(acts, u), _prior(1)).log_evidence
    assert posterior(Products.of(nothing, u), _prior(2)).log_evidence < alone
    assert posterior(Products.of(x[:, 1:], u), _prior(1)).log_evidence < alone - 50.0


def noisy_regression(random: np.random.Generator, noise: float, rows: int = 400) -> tuple[Products, FloatArray]:
    """Products of a regression whose first column holds noise of this size, and E[dX'dX]."""
    true = np.stack([np.sin(0.1 * np.arange(rows)), np.cos(0.037 * np.arange(rows))], axis=1)
    design = true + np.stack([noise * random.standard_normal(rows), np.zeros(rows)], axis=1)
    target = true @ [1.0, -2.0] + 0.2 * random.standard_normal(rows)
    return Products.of(design, target), np.diag([rows * noise**2, 0.0])


def test_noise_in_a_column_biases_no_coefficient_and_widens_its_interval() -> None:
    random, wide = np.random.default_rng(3), Prior(np.zeros(2), np.full(2, 100.0), np.zeros(2, dtype=bool))
    found, told = [], []
    for _ in range(400):
        products, gram = noisy_regression(random, noise=0.7)
        true = products.without_noise(gram, np.zeros(2))
        b = mode(true, wide, 1.0)
        own = posterior(true.leaving(products.rss(b), b), wide)
        found.append(own.beta)
        told.append(np.sqrt(np.diag(own.covariance)))
    spread = np.std(found, axis=0)
    assert np.mean(found, axis=0) == pytest.approx([1.0, -2.0], abs=4.0 * spread.max() / np.sqrt(400.0))
    assert np.mean(told, axis=0) == pytest.approx(spread, rel=0.2)


def test_a_column_of_noise_alone_tells_nothing() -> None:
    rows = 400
    noise = np.random.default_rng(5).standard_normal((rows, 1))
    products = Products.of(noise, 3.0 * noise[:, 0])
    prior = Prior(np.zeros(1), np.full(1, 0.5), np.zeros(1, dtype=bool))
    own = posterior(products.without_noise(products.gram, np.zeros(1)), prior, 1.0)
    assert own.beta == pytest.approx(0.0, abs=1e-6)
    assert own.covariance[0, 0] == pytest.approx(0.25)
