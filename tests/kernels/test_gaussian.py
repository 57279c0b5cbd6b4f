"""The normal's tail functions against 150-digit arithmetic, the mass of intervals against scipy."""

from decimal import Decimal, getcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.special import log_ndtr, ndtr

from drake_tc.kernels.tsid.programs import CEILING, curvature_of, hazard, interval_density, interval_risk, log_cdf

getcontext().prec = 150
PI = Decimal(
    "3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798214808651"
)


def tails(u):
    """(3, m) log Phi, hazard and curvature of each u (m,)."""
    low = [min(x, CEILING) for x in u]
    return np.array([[log_cdf(x) for x in u], [hazard(x) for x in u], [curvature_of(x, hazard(x)) for x in low]])


def intervals(above, below):
    """(3, m) -log P of each [-below, above] (m,), and phi(above) / P, phi(below) / P."""
    risks = [interval_risk(*ends) for ends in zip(above, below, strict=True)]
    density = [[interval_density(end, risk) for end, risk in zip(side, risks, strict=True)] for side in (above, below)]
    return np.array([risks, *density])


def exact(u: float) -> tuple[float, float, float]:
    """(log Phi, hazard, curvature) from the all-positive power series, or the integral by parts far down."""
    x = Decimal(float(u))
    density = (-x * x / 2).exp() / (2 * PI).sqrt()
    if u > -14.0:
        term = total = x
        k = 1
        while abs(term) > Decimal(10) ** -140:
            term *= x * x / (2 * k + 1)
            total += term
            k += 1
        cdf = Decimal("0.5") + density * total
        log = cdf.ln()
        rate = density / cdf
    else:
        # Phi(u) / phi(u) = 1/t - 1/t^3 + 3/t^5 - ... for t = -u: asymptotic, its smallest term below exp(-t^2 / 2)
        t = -x
        term = total = 1 / t
        for k in range(1, 90):
            term *= -(2 * k - 1) / (t * t)
            total += term
        log = total.ln() - x * x / 2 - (2 * PI).sqrt().ln()
        rate = 1 / total
    return float(log), float(rate), float(rate * (rate + x))


POINTS = np.concatenate([-np.logspace(np.log10(14.5), 4, 30), np.linspace(-13.9, 37.0, 160), [-4.0, -4.0 - 1e-9, 0.0]])


@pytest.fixture(scope="module")
def truth():
    return np.array([exact(u) for u in POINTS])


def test_log_cdf(truth):
    keep = POINTS < 20.0
    assert_allclose(tails(POINTS[keep])[0], truth[keep, 0], rtol=1e-12)


def test_hazard(truth):
    assert_allclose(tails(POINTS)[1], truth[:, 1], rtol=1e-12)


def test_curvature(truth):
    assert_allclose(tails(POINTS)[2], truth[:, 2], rtol=1e-12)


def test_beyond_the_smallest_double():
    u = np.array([38.0, 40.0, 1e4, np.inf])
    logs, rates, bends = tails(u)
    assert_allclose(rates, 0.0, atol=1e-300)
    assert_allclose(bends, 0.0, atol=1e-290)
    assert_allclose(logs, 0.0, atol=1e-300)


def test_curvature_stays_between_0_and_1():
    value = tails(np.linspace(-1e4, 37.0, 10_001))[2]
    assert np.all(value > 0.0)
    assert np.all(value < 1.0)


def test_interval_risk_where_plain_arithmetic_does():
    above, below = (g.ravel() for g in np.meshgrid(np.linspace(-4.0, 8.0, 25), np.linspace(-3.9, 8.1, 25)))
    keep = above + below > 0.05
    above, below = above[keep], below[keep]
    # Phi(a) - Phi(-b) by the two lower tails, or the two upper ones where those are smaller: 1e-16 over 4e-4 at worst
    mass = np.where(above > below, ndtr(below) - ndtr(-above), ndtr(above) - ndtr(-below))
    assert_allclose(intervals(above, below)[0], -np.log(mass), rtol=1e-9, atol=1e-12)


def test_interval_risk_far_out_and_very_narrow():
    for above, below in ((-38.0, 41.0), (40.0, -37.0), (-200.0, 201.0)):
        # all but 1e-16 of the mass is that of the half line
        assert_allclose(intervals(np.array([above]), np.array([below]))[0], -log_ndtr(min(above, below)), rtol=1e-10)
    narrow = intervals(np.array([1.0 + 1e-9]), np.array([-1.0]))[0]
    assert_allclose(narrow, 0.5 + 0.5 * np.log(2.0 * np.pi) - np.log(1e-9), rtol=1e-8)
    wide = intervals(np.array([9.0]), np.array([10.0]))[0]
    assert_allclose(wide, ndtr(-9.0) + ndtr(-10.0), rtol=1e-10)
    assert np.all(np.isinf(intervals(np.array([-1.0, 2.0, 0.0]), np.array([1.0, -3.0, 0.0]))[0]))


def test_interval_densities_are_the_slopes():
    rng = np.random.default_rng(0)
    above = rng.uniform(-3.0, 6.0, 200)
    below = -above + rng.uniform(0.3, 6.0, 200)
    _, upper, lower = intervals(above, below)
    h = 1e-5
    by_a = (intervals(above + h, below)[0] - intervals(above - h, below)[0]) / (2 * h)
    by_b = (intervals(above, below + h)[0] - intervals(above, below - h)[0]) / (2 * h)
    assert_allclose(-upper, by_a, rtol=1e-6, atol=1e-8)
    assert_allclose(-lower, by_b, rtol=1e-6, atol=1e-8)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(-8.0, 8.0), min_size=4, max_size=4), st.floats(0.0, 1.0))
def test_interval_risk_is_convex(ends, share):
    (a, b), (c, d) = (ends[0], abs(ends[1]) + 0.1 - ends[0]), (ends[2], abs(ends[3]) + 0.1 - ends[2])
    one, other = intervals(np.array([a, c]), np.array([b, d]))[0]
    between = intervals(np.array([share * a + (1 - share) * c]), np.array([share * b + (1 - share) * d]))[0][0]
    assert between <= share * one + (1 - share) * other + 1e-9 * (1.0 + one + other)
