"""The normal's tail functions against 150-digit arithmetic."""

from decimal import Decimal, getcontext

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.tsid.robust.gaussian_tail import curvature, hazard, hazard_of, log_cdf, risk_of, scaled_cdf

getcontext().prec = 150
PI = Decimal(
    "3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798214808651"
)


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
    assert_allclose(log_cdf(POINTS[keep]), truth[keep, 0], rtol=1e-12)


def test_hazard(truth):
    assert_allclose(hazard(POINTS), truth[:, 1], rtol=1e-12)


def test_curvature(truth):
    assert_allclose(curvature(POINTS), truth[:, 2], rtol=1e-12)


def test_both_from_one_function(truth):
    keep = np.abs(POINTS) < 12.0
    cdf = scaled_cdf(POINTS[keep])
    assert_allclose(hazard_of(cdf), truth[keep, 1], rtol=1e-12)
    assert_allclose(risk_of(POINTS[keep], cdf), -truth[keep, 0].sum(), rtol=1e-13, atol=1e-12)


def test_beyond_the_smallest_double():
    u = np.array([38.0, 40.0, 1e4, np.inf])
    assert_allclose(hazard(u), 0.0, atol=1e-300)
    assert_allclose(curvature(u), 0.0, atol=1e-290)
    assert_allclose(log_cdf(u), 0.0, atol=1e-300)


def test_curvature_stays_between_0_and_1():
    value = curvature(np.linspace(-1e4, 37.0, 100_001))
    assert np.all(value > 0.0)
    assert np.all(value < 1.0)
