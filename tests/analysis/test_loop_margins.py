"""Margins of all channels of a cut: against each channel with the others closed in A, and of loops that do nothing."""

import warnings
from dataclasses import fields

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.analysis.sampled import SampledSystem, loop_margins
from drake_tc.control.stability_margins import frequency_grid, margins
from drake_tc.errors import ParamsError

DT = 0.01
NAMES = tuple(f"control:torque[{i}]" for i in range(3))


def coupled(seed: int = 0) -> SampledSystem:
    """A stable loop of three channels that act on each other, cut open; D is not zero."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(8, 8))
    a *= 0.9 / np.abs(np.linalg.eigvals(a)).max()
    b, c, d = rng.normal(size=(8, 3)), 0.1 * rng.normal(size=(3, 8)), 0.05 * rng.normal(size=(3, 3))
    while True:
        cut = SampledSystem(a, b, c, d, DT, tuple(f"x[{i}]" for i in range(8)), NAMES, NAMES)
        if cut.closed().spectral_radius < 1.0:
            return cut
        c, d = 0.7 * c, 0.7 * d


@pytest.mark.parametrize("seed", range(2))
def test_each_channel_has_the_margins_of_the_loop_with_the_others_closed(seed):
    cut = coupled(seed)
    grid = frequency_grid(DT)
    found = loop_margins(cut)
    assert tuple(found) == NAMES
    for i, name in enumerate(NAMES):
        one = cut.closed([k for k in range(3) if k != i])
        expected = margins(lambda omega, one=one: -one.response(omega)[:, 0, 0], DT, grid)
        for field in fields(expected):
            assert_allclose(getattr(found[name], field.name), getattr(expected, field.name), rtol=1e-6)


def test_a_gain_margin_is_where_that_channel_alone_brings_the_loop_to_its_border():
    cut = coupled()
    for i, found in enumerate(loop_margins(cut).values()):
        if np.isfinite(found.gain_margin):
            scale = np.ones(3)
            scale[i] = found.gain_margin
            scaled = SampledSystem(
                cut.a, cut.b, scale[:, None] * cut.c, scale[:, None] * cut.d, DT, cut.states, NAMES, NAMES
            )
            assert_allclose(np.min(np.abs(np.abs(scaled.closed().eigenvalues) - 1.0)), 0.0, atol=1e-8)


def test_channels_are_named_as_in_bode_plots():
    cut = coupled()
    every = loop_margins(cut)
    chosen = loop_margins(cut, ["control:torque[2]", 0])
    assert repr(chosen) == repr({NAMES[2]: every[NAMES[2]], NAMES[0]: every[NAMES[0]]})  # some are NaN
    omega = np.array([1.0, 10.0])
    assert_allclose(cut.loop_response("control:torque")(omega), cut.loop_response(0)(omega))
    for name in ("control:torque[3]", "control:speed", 3, -1):
        with pytest.raises(ParamsError, match=r"expected one of control:torque\[0\], .*or its number"):
            loop_margins(cut, [name])


def test_a_stuck_joint_has_infinite_margins_and_warns_of_nothing():
    """Its command moves nothing: L is zero at every frequency."""
    names = NAMES[:1]
    stuck = SampledSystem(
        np.eye(1) * 0.5, np.ones((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)), DT, ("x",), names, names
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (found,) = loop_margins(stuck).values()
    assert (found.gain_margin, found.phase_margin, found.delay_margin) == (np.inf, np.inf, np.inf)
    assert np.isnan(found.crossover) and np.isnan(found.phase_crossover)
    assert found.sensitivity_peak == 1.0
