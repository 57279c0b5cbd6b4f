"""Residuals whose noise grows with the speed are weighted to one level, and figures are told of them as they are."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.data.clocks import TimingScatter
from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.diagnosis.problem.regression import noise_floor
from drake_tc.diagnosis.residual.over_time import loud_stretches
from drake_tc.diagnosis.residual.unexplained import DataSplit, Unexplained, with_equal_noise

from ..rigs import Joint, Problem, problem

LOUD = 30.0
"""Variance by the scatter in the fast stretch, over that of all other noise."""


@pytest.fixture(scope="module")
def known() -> Problem:
    return problem(Joint(duration=40.0, period=4e-3, torque_noise=0.25))


def scattering(known: Problem) -> tuple[Columns, np.ndarray]:
    """The columns with a scatter that acts in one tenth of the rows, and its variance [(N m)^2] by row."""
    samples = known.samples
    fast = np.arange(samples.rows.size) % samples.rows.size < samples.rows.size // 10
    other = samples.floor.torque(float(known.baseline.beta[0]), float(known.baseline.beta[1])) ** 2
    moments = np.zeros((fast.size, 3, 3))
    moments[fast, 2, 2] = LOUD * other
    floor = replace(samples.floor, timing=moments.mean(axis=0))
    resolution = replace(samples.resolution, timing=TimingScatter(1e-4, 1e-6, 1.0, 2.0))
    return Columns(replace(samples, timing=moments, floor=floor, resolution=resolution)), moments[:, 2, 2]


def test_the_floor_has_the_mean_of_the_moments(known):
    columns, variance = scattering(known)
    quiet = noise_floor(Columns(known.samples), known.baseline)
    expected = np.sqrt(quiet**2 + known.baseline.gain**2 * np.mean(variance))
    assert noise_floor(columns, known.baseline) == pytest.approx(expected, rel=1e-12)


def test_noise_of_the_expected_size_is_equally_loud_once_weighted(known):
    columns, variance = scattering(known)
    gain, quiet = known.baseline.gain, noise_floor(Columns(known.samples), known.baseline)
    size = np.sqrt(quiet**2 + gain**2 * variance)
    after = size * np.random.default_rng(0).standard_normal(size.size)
    split = DataSplit(columns.samples, 2.0 * after, after)
    assert loud_stretches(split, 3.0, quiet)  # the fast stretch, taken as it is
    equal = with_equal_noise((split, split), known.baseline, noise_floor(columns, known.baseline))
    weighted = equal.splits[0]
    np.testing.assert_allclose(weighted.before, 2.0 * weighted.after)
    np.testing.assert_allclose(weighted.weight * after, weighted.after)
    fast = variance > 0.0
    levels = [np.sqrt(np.mean(weighted.after[rows] ** 2)) / equal.floors[0] for rows in (fast, ~fast)]
    # a few hundred and a few thousand independent values
    np.testing.assert_allclose(levels, 1.0, atol=0.12)
    assert loud_stretches(weighted, 3.0, quiet) == ()
    assert equal.heldout == pytest.approx(np.sqrt(np.mean(size**2)), rel=0.02)
    left = Unexplained(9.0, 9.0, False, 0.01, 0.0, False, (), explainable_rms=3.0)
    told = equal.unweighted(left, split, equal.floors[1])
    assert told.floors == pytest.approx(np.sqrt(np.mean(after**2)) / equal.heldout, rel=1e-9)


def test_without_scatter_nothing_is_weighted(known):
    after = np.random.default_rng(0).standard_normal(known.samples.rows.size)
    split = DataSplit(known.samples, after, after)
    equal = with_equal_noise((split, split), known.baseline, 1.0)
    assert equal.splits[0] is split
    assert equal.splits[1] is split
    assert equal.floors == (equal.heldout, equal.heldout)
    left = Unexplained(9.0, 9.0, False, 0.01, 0.0, False, ())
    assert equal.unweighted(left, split, 1.0) is left
    assert equal.unweighted_floor(1.7) == 1.7
