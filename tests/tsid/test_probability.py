"""p(tau) against closed forms, scipy and plain Monte Carlo; its interval holds the truth as often as it says."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import ndtr, ndtri

from drake_tc.diagrams.papers.delprete2015.probability import probability
from drake_tc.errors import ParamsError
from drake_tc.tsid.robust.scaled import TorqueError
from drake_tc.tsid.rows import Polytope

from .robust_problems import random_covariance, random_polytope

HALF_LINE = Polytope(np.array([[3.0, 4.0]]), np.array([-np.inf]), np.array([10.0]))


@pytest.mark.parametrize("p", [1e-12, 1e-6, 1e-3, 0.5, 1.0 - 1e-3, 1.0 - 1e-6])
def test_one_row_is_exact(p):
    error = TorqueError(np.array([1.0, 4.0]))
    deviation = np.sqrt(9.0 + 64.0)
    torque = np.array([1.0, 0.0]) * (10.0 - deviation * ndtri(p)) / 3.0
    found = probability(HALF_LINE, torque, error)
    assert_allclose(found.value, p, rtol=1e-9)
    assert found.ci95[0] <= p * (1 + 1e-9) <= found.ci95[1] * (1 + 2e-9)
    assert found.axes == 1


@pytest.mark.parametrize("shift", [-5.0, 0.0, 1.5, 4.0, 9.0])
def test_boxes_are_exact(shift):
    sigma = np.array([0.1, 2.0, 50.0, 1.0])
    low, high = np.array([-1.0, -2.0, 0.1, -np.inf]) * sigma, np.array([2.0, 0.5, 3.0, 1.0]) * sigma
    torque = np.array([shift, 0.0, 0.0, -shift]) * sigma
    z = np.array([[(b - t) / s for b, t, s in zip(side, torque, sigma, strict=True)] for side in (low, high)])
    mass = np.where(z[0] > 0.0, ndtr(-z[0]) - ndtr(-z[1]), ndtr(z[1]) - ndtr(z[0]))
    found = probability(Polytope(np.eye(4), low, high, bounds=4), torque, TorqueError(sigma**2))
    assert_allclose(found.value, np.prod(mass), rtol=1e-9, atol=1e-300)


def wedge(correlation):
    """Two half planes through the origin whose values correlate so, and the probability of both (Sheppard)."""
    matrix = np.array([[1.0, 0.0], [correlation, np.sqrt(1.0 - correlation**2)]])
    exact = 0.25 + np.arcsin(correlation) / (2.0 * np.pi)
    return Polytope(matrix, np.zeros(2), np.full(2, np.inf)), exact


def trihedron(a, b, c):
    """Three half spaces with these correlations, and the probability of all."""
    covariance = np.array([[1.0, a, b], [a, 1.0, c], [b, c, 1.0]])
    exact = 0.125 + (np.arcsin(a) + np.arcsin(b) + np.arcsin(c)) / (4.0 * np.pi)
    return Polytope(np.linalg.cholesky(covariance), np.zeros(3), np.full(3, np.inf)), exact


def equicorrelated(n, half):
    """n rows that correlate by 1/2 share the orthant probability 1 / (n + 1); half tells which sign of the rows."""
    covariance = 0.5 * (np.eye(n) + 1.0)
    return Polytope(half * np.linalg.cholesky(covariance), np.zeros(n), np.full(n, np.inf)), 1.0 / (n + 1.0)


CLOSED = [
    wedge(-0.99),
    wedge(-0.5),
    wedge(0.7),
    wedge(0.999),
    trihedron(0.3, -0.4, 0.5),
    trihedron(-0.45, -0.45, -0.45),
]
CLOSED += [equicorrelated(n, s) for n, s in ((5, 1.0), (12, -1.0), (20, 1.0))]


@pytest.mark.parametrize("case", range(len(CLOSED)))
def test_interval_covers_closed_forms(case):
    """Of 30 seeds 95 % cover on average; fewer than 22 have a chance below 1e-5 (binomial)."""
    polytope, exact = CLOSED[case]
    error = TorqueError(np.ones(polytope.matrix.shape[1]))
    torque = np.zeros(polytope.matrix.shape[1])
    found = [probability(polytope, torque, error, samples=512, seed=seed) for seed in range(30)]
    assert sum(f.ci95[0] <= exact <= f.ci95[1] for f in found) >= 22
    assert_allclose(np.mean([f.value for f in found]), exact, rtol=5e-3)
    assert max(f.ci95[1] - f.ci95[0] for f in found) < 0.2 * exact


def both(correlation, margin):
    """P of both of two rows with this margin and its complement: a fine trapezoid over the first row's value."""
    root = np.sqrt(1.0 - correlation**2)
    x = np.linspace(-margin, margin + 12.0, 400_001)
    density = np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi)
    other = (margin + correlation * x) / root
    return np.trapezoid(density * ndtr(other), x), ndtr(-margin) + np.trapezoid(density * ndtr(-other), x)


@pytest.mark.parametrize("correlation", [-0.8, 0.6, 0.95])
@pytest.mark.parametrize("margin", [-4.0, 2.0, 3.5, 4.7])
def test_interval_covers_rare_and_nearly_sure_events(margin, correlation):
    """1 - p and p down to 1e-6 and beyond, with as many digits."""
    polytope, _ = wedge(correlation)
    torque = np.linalg.solve(polytope.matrix, [margin, margin])
    p, complement = both(correlation, margin)
    found = [probability(polytope, torque, TorqueError(np.ones(2)), seed=s) for s in range(16)]
    slack = 1e-7 * min(p, complement)  # the trapezoid's own error
    assert sum(f.ci95[0] - slack <= p <= f.ci95[1] + slack for f in found) >= 10
    if margin > 0.0:
        assert_allclose([1.0 - f.value for f in found], complement, rtol=1e-2)
    else:
        assert_allclose([f.value for f in found], p, rtol=2e-2)


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_against_plain_monte_carlo(seed, full):
    """More rows than axes, one- and two-sided, from points inside and outside."""
    rng = np.random.default_rng(seed)
    polytope, inside, sigma = random_polytope(rng, 4, 9, near=7.0)
    error = TorqueError(random_covariance(rng, sigma) if full else sigma**2)
    draws = rng.multivariate_normal(np.zeros(4), error.covariance, size=200_000)
    for torque in (inside, inside + 2.0 * sigma * rng.normal(size=4)):
        value = (torque + draws) @ polytope.matrix.T
        share = np.all((value >= polytope.lower) & (value <= polytope.upper), axis=1).mean()
        found = probability(polytope, torque, error, samples=4096, seed=seed)
        spread = 4.0 * np.sqrt(share * (1.0 - share) / 200_000) + 1e-5
        assert found.ci95[0] - spread <= share <= found.ci95[1] + spread
        assert found.rows <= len(polytope.lower)


def test_groups_and_their_whole():
    polytope, inside, sigma = random_polytope(np.random.default_rng(1), 5, 6)
    error = TorqueError(sigma**2)
    parts = {name: probability(polytope, inside, error, group=name).value for name in polytope.groups}
    whole = probability(polytope, inside, error).value
    assert whole <= min(parts.values()) + 1e-3
    assert_allclose(parts["torque"], 1.0, atol=1e-12)
    with pytest.raises(ParamsError, match=r"expected one of \['other', 'torque'\]"):
        probability(polytope, inside, error, group="force")
    with pytest.raises(ParamsError, match="samples"):
        probability(polytope, inside, error, samples=3)


def test_order_scale_and_units_do_not_matter():
    rng = np.random.default_rng(3)
    polytope, inside, sigma = random_polytope(rng, 5, 6)
    reference = probability(polytope, inside, TorqueError(sigma**2))
    order, length, unit = rng.permutation(13), 10.0 ** rng.uniform(-5, 5, 13), 10.0 ** rng.uniform(-3, 3, 5)
    mixed = Polytope(polytope.matrix[order], polytope.lower[order], polytope.upper[order])
    longer = Polytope(polytope.matrix * length[:, None], polytope.lower * length, polytope.upper * length)
    other = Polytope(polytope.matrix / unit, polytope.lower, polytope.upper)
    for limits, torque, deviation in (
        (mixed, inside, sigma),
        (longer, inside, sigma),
        (other, inside * unit, sigma * unit),
    ):
        found = probability(limits, torque, TorqueError(deviation**2))
        assert_allclose(found.value, reference.value, rtol=5e-3)


def test_rows_that_do_not_err_and_rows_that_are_not_there():
    error = TorqueError(np.array([1.0, 0.0]))
    polytope = Polytope(np.array([[1.0, 0.0], [0.0, 1.0]]), np.full(2, -np.inf), np.array([0.0, 1.0]))
    assert_allclose(probability(polytope, np.array([0.0, 1.0]), error).value, 0.5)
    assert probability(polytope, np.array([0.0, 1.1]), error).value == 0.0
    none = Polytope(np.zeros((0, 2)), np.zeros(0), np.zeros(0))
    assert probability(none, np.zeros(2), error).value == 1.0
    assert probability(polytope, np.array([-9.0, 0.0]), error).ci95[1] == 1.0
    crossed = Polytope(np.eye(2), np.array([1.0, -1.0]), np.array([0.0, 1.0]))
    assert probability(crossed, np.zeros(2), TorqueError(np.ones(2))).value == 0.0


def test_same_seed_same_numbers():
    polytope, inside, sigma = random_polytope(np.random.default_rng(2), 4, 5)
    one, again, other = (probability(polytope, inside, TorqueError(sigma**2), seed=s).value for s in (1, 1, 2))
    assert one == again
    assert one != other
