"""Known three-piece curves are found again; what cannot be found is refused or reported."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import IdentificationError
from drake_tc.identification.asymmetric import fit_piecewise, fit_three_pieces


def curve(tau, breaks=(-3.0, 2.0), slopes=(0.1, 1.5, 0.2), offset=0.4):
    points = np.array([-1e3, breaks[0], breaks[1], 1e3])
    values = np.array(
        [
            offset + slopes[1] * breaks[0] + slopes[0] * (-1e3 - breaks[0]),
            offset + slopes[1] * breaks[0],
            offset + slopes[1] * breaks[1],
            offset + slopes[1] * breaks[1] + slopes[2] * (1e3 - breaks[1]),
        ]
    )
    return np.interp(tau, points, values)


def test_a_known_curve_is_found_again():
    tau = np.linspace(-10, 10, 2001)
    fit = fit_three_pieces(tau, curve(tau), breaks=(-4.0, 3.0), max_rounds=60)
    assert fit.converged
    assert_allclose(fit.breaks, (-3, 2), atol=1e-4)
    assert_allclose(fit.slopes, (0.1, 1.5, 0.2), atol=1e-4)
    assert_allclose(fit(tau), curve(tau), atol=1e-3)


def test_it_is_found_within_noise_from_the_papers_start():
    rng = np.random.default_rng(0)
    tau = rng.uniform(-6, 6, 5000)
    truth = {"breaks": (-0.8, 0.9), "slopes": (0.05, 1.0, 0.07), "offset": 0.1}
    fit = fit_three_pieces(tau, curve(tau, **truth) + 0.01 * rng.normal(size=5000))
    assert_allclose(fit.breaks, truth["breaks"], atol=0.05)
    assert_allclose(fit.slopes, truth["slopes"], atol=0.05)
    assert fit.rms < 0.015


def test_the_curve_is_continuous_even_when_not_at_rest():
    tau = np.linspace(-10, 10, 801)
    fit = fit_three_pieces(tau, curve(tau), breaks=(-6.0, 6.0), max_rounds=1)
    assert not fit.converged
    for point in fit.breaks:
        assert_allclose(*fit(np.array([point - 1e-9, point + 1e-9])), atol=1e-7)


def test_the_middle_slope_is_bounded_and_says_so():
    tau = np.linspace(-10, 10, 801)
    fit = fit_three_pieces(tau, curve(tau), breaks=(-3.0, 2.0), middle_slope=(0.0, 1.0))
    assert fit.middle_at_bound
    assert_allclose(fit.slopes[1], 1.0, rtol=1e-9)


def test_each_sign_of_the_velocity_has_its_own_curve():
    rng = np.random.default_rng(1)
    tau, velocity = rng.uniform(-6, 6, 4000), rng.choice([-1.0, 0.0, 1.0], 4000)
    effort = np.where(velocity > 0, curve(tau, offset=0.4), curve(tau, offset=-0.4))
    fit = fit_piecewise(tau, velocity, effort, breaks=(-2.5, 2.5))
    assert_allclose([fit.forward.offset, fit.backward.offset], [0.4, -0.4], atol=0.02)
    moving = velocity != 0
    assert_allclose(fit(tau, velocity)[moving], effort[moving], atol=0.05)
    assert_allclose(fit(np.zeros(1), np.zeros(1)), 0, atol=0.02)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"breaks": (1.0, -1.0)}, "rising"),
        ({"breaks": (-20.0, 20.0)}, "excitation too poor"),
        ({"middle_slope": (1.0, 0.0)}, "rising"),
    ],
)
def test_bad_starts_are_refused(options, message):
    tau = np.linspace(-10, 10, 101)
    with pytest.raises(IdentificationError, match=message):
        fit_three_pieces(tau, curve(tau), **options)
