"""R_ind and p_ind against derivatives taken otherwise, convexity, and probabilities known in closed form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.special import log_ndtr, ndtr
from scipy.stats import multivariate_normal

from drake_tc.diagrams.papers.delprete2015.probability import probability
from drake_tc.tsid.robust.scaled import TorqueError, p_ind
from drake_tc.tsid.rows import Polytope

from .individual_risk import individual_risk
from .robust_problems import random_covariance, random_polytope, random_problem

SEEDS = range(6)


def risk_by_definition(polytope, covariance, torque):
    """-sum of log Phi, one side after the other; complex torques for complex steps."""
    deviation = np.sqrt(np.diagonal(polytope.matrix @ covariance @ polytope.matrix.T))
    value = polytope.matrix @ torque
    total = 0.0
    for v, low, high, sigma in zip(value, polytope.lower, polytope.upper, deviation, strict=True):
        total -= log_ndtr((v - low) / sigma) if np.isfinite(low) else 0.0
        total -= log_ndtr((high - v) / sigma) if np.isfinite(high) else 0.0
    return total


def errors(seed, sigma):
    return TorqueError(sigma**2), TorqueError(random_covariance(np.random.default_rng(seed), sigma))


@pytest.mark.parametrize("seed", SEEDS)
def test_gradient_by_complex_steps(seed):
    polytope, inside, sigma = random_polytope(np.random.default_rng(seed), 5, 7)
    torque = inside + 2.0 * sigma * np.random.default_rng(seed + 50).normal(size=5)
    for error in errors(seed, sigma):
        got = individual_risk(polytope, torque, error)
        assert_allclose(got.value, risk_by_definition(polytope, error.covariance, torque), rtol=1e-12)
        by_step = []
        for j in range(5):
            step = np.zeros(5, dtype=complex)
            step[j] = 1e-30j
            by_step.append(risk_by_definition(polytope, error.covariance, torque + step).imag / 1e-30)
        assert_allclose(got.gradient, by_step, rtol=1e-10, atol=1e-10 * np.abs(by_step).max())


@pytest.mark.parametrize("seed", SEEDS)
def test_hessian_by_differences_of_the_gradient(seed):
    polytope, inside, sigma = random_polytope(np.random.default_rng(seed), 5, 7)
    torque = inside + 2.0 * sigma * np.random.default_rng(seed + 50).normal(size=5)
    for error in errors(seed, sigma):
        hessian = individual_risk(polytope, torque, error).hessian
        columns = []
        for j in range(5):
            step = np.zeros(5)
            step[j] = 1e-4 * sigma[j]
            ahead, behind = (individual_risk(polytope, torque + s, error).gradient for s in (step, -step))
            columns.append((ahead - behind) / (2.0 * step[j]))
        # central differences with steps h = 1e-4 sigma: h^2 / 6 of the third derivative, of order 1
        scale = np.outer(sigma, sigma)
        assert_allclose(hessian * scale, np.array(columns) * scale, rtol=1e-6, atol=1e-6)
        assert_allclose(hessian, hessian.T, rtol=1e-12)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), far=st.floats(0.1, 300.0), share=st.floats(0.01, 0.99), full=st.booleans())
def test_convex_on_random_polytopes(seed, far, share, full):
    rng = np.random.default_rng(seed)
    polytope, inside, sigma = random_polytope(rng, 4, 6)
    error = TorqueError(random_covariance(rng, sigma) if full else sigma**2)
    one, other = (inside + far * sigma * rng.normal(size=4) for _ in range(2))
    at_one, at_other = (individual_risk(polytope, x, error) for x in (one, other))
    between = individual_risk(polytope, share * one + (1.0 - share) * other, error)
    chord = share * at_one.value + (1.0 - share) * at_other.value
    assert between.value <= chord + 1e-10 * (1.0 + abs(chord))
    tangent = at_one.value + at_one.gradient @ (other - one)
    assert at_other.value >= tangent - 1e-9 * (1.0 + abs(tangent) + abs(at_one.value))
    scaled = between.hessian * np.outer(sigma, sigma)
    assert np.linalg.eigvalsh(scaled).min() >= -1e-10 * max(1.0, np.abs(scaled).max())


@pytest.mark.parametrize("full", [False, True])
def test_p_ind_is_exact_for_rows_orthogonal_in_sigma(full):
    """G Sigma G^T diagonal; scipy's multivariate cdf is the other library."""
    rng = np.random.default_rng(5)
    sigma = 10.0 ** rng.uniform(-1, 1, 4)
    covariance = random_covariance(rng, sigma) if full else np.diag(sigma**2)
    turn = np.linalg.qr(rng.normal(size=(4, 4)))[0][:3]
    matrix = turn @ np.linalg.inv(np.linalg.cholesky(covariance)) * np.array([[1.0], [30.0], [0.01]])
    torque = rng.normal(size=4)
    upper = matrix @ torque + np.array([0.3, 1.1, -0.4]) * np.array([1.0, 30.0, 0.01])
    polytope = Polytope(matrix, np.full(3, -np.inf), upper)
    error = TorqueError(covariance)
    joint = multivariate_normal(np.zeros(3), matrix @ covariance @ matrix.T).cdf(upper - matrix @ torque)
    assert_allclose(p_ind(polytope, torque, error), joint, rtol=1e-5)
    assert_allclose(p_ind(polytope, torque, error), np.prod(ndtr([0.3, 1.1, -0.4])), rtol=1e-12)
    found = probability(polytope, torque, error)
    assert_allclose(found.value, joint, rtol=1e-5)


class TestPaperExample:
    """Five constraints in the plane and sigma 1.44, as in Fig. 2: corners of less, just, and more than 90 deg."""

    corners = np.array([[-4.0, -3.0], [4.0, -3.0], [4.0, 2.0], [-1.0, 5.0], [-5.5, 0.0]])
    error = TorqueError(np.full(2, 1.44**2))

    def polytope(self):
        edges = np.roll(self.corners, -1, axis=0) - self.corners
        normals = np.stack([-edges[:, 1], edges[:, 0]], axis=1)
        return Polytope(normals, np.einsum("ij,ij->i", normals, self.corners), np.full(5, np.inf))

    def exact(self, torque):
        """Integral over x of the normal's density times the mass of the vertical chord, by a fine trapezoid rule."""
        polytope = self.polytope()
        x = np.linspace(-5.5, 4.0, 40_001)
        low, high = np.full_like(x, -np.inf), np.full_like(x, np.inf)
        for (a, b), c in zip(polytope.matrix, polytope.lower, strict=True):
            if abs(b) < 1e-12:
                continue
            ends = (c - a * x) / b
            low, high = (np.maximum(low, ends), high) if b > 0.0 else (low, np.minimum(high, ends))
        s = 1.44
        chord = np.maximum(ndtr((high - torque[1]) / s) - ndtr((low - torque[1]) / s), 0.0)
        density = np.exp(-0.5 * ((x - torque[0]) / s) ** 2) / (s * np.sqrt(2.0 * np.pi))
        return np.trapezoid(density * chord, x)

    def test_probability(self):
        for torque in ([0.0, 0.0], [3.5, -2.5], [-5.0, 0.0], [6.0, 0.0], [-1.0, 4.6], [0.0, -9.0]):
            found = probability(self.polytope(), np.array(torque), self.error, samples=8192)
            assert_allclose(found.value, self.exact(torque), rtol=2e-3, atol=1e-7)

    def test_error_of_p_ind_has_the_sign_of_the_corner(self):
        polytope = self.polytope()
        for i, corner in enumerate(self.corners):
            back, ahead = self.corners[i - 1] - corner, self.corners[(i + 1) % 5] - corner
            cosine = back @ ahead / np.linalg.norm(back) / np.linalg.norm(ahead)
            rows = polytope.matrix[[i - 1, i]]
            wedge = Polytope(rows, rows @ corner, np.full(2, np.inf))
            difference = probability(wedge, corner, self.error).value - p_ind(wedge, corner, self.error)
            # the probability of a wedge seen from its corner is its angle over 360 deg, that of two half planes 1/4
            assert_allclose(difference, np.arccos(cosine) / (2.0 * np.pi) - 0.25, atol=5e-5)


def test_a_row_that_does_not_err_decides_by_itself():
    _, polytope, error = random_problem(0)
    sigma = error.sigma.copy()
    sigma[2] = 0.0
    known = TorqueError(sigma**2)
    torque = np.clip(np.zeros(6), polytope.lower[:6], polytope.upper[:6])
    assert np.isfinite(individual_risk(polytope, torque, known).value)
    assert p_ind(polytope, torque, known) >= 0.0
    torque[2] = 2.0 * polytope.upper[2]
    assert p_ind(polytope, torque, known) == 0.0
    got = individual_risk(polytope, torque, TorqueError(np.zeros(6)))
    assert_allclose(got.value, 0.0, atol=1e-28)
    assert_allclose(got.gradient, 0.0, atol=1e-28)
