"""The spectrum of the residual: powers, lines and the noise floor; correlations with gaps against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.noise_colour import spectral_density
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.report.plots.spectrum import (
    Correlation,
    Gridded,
    autocorrelation,
    banded,
    cross_correlation,
    floor_density,
    on_grid,
    outside,
    spectrum_plot,
)
from drake_tc.report.words import correlation_words


def test_bands_average_the_density() -> None:
    frequency = np.linspace(0.0, 100.0, 20_001)
    middle, mean = banded(frequency, 3.0 * frequency, 1.0, 64.0)
    assert_allclose(mean, 3.0 * middle, rtol=1e-9)
    assert middle.size == 12 * 6
    assert np.all((middle >= 1.0) & (middle <= 64.0))


def test_empty_bands_are_left_out() -> None:
    middle, mean = banded(np.array([1.0, 2.0, 50.0]), np.array([1.0, 4.0, 9.0]), 1.0, 64.0)
    assert_allclose(middle, [1.0, 2.0, 50.0])
    assert_allclose(mean, [1.0, 4.0, 9.0])


def test_the_floors_density_has_the_floors_power(joint: JointResult) -> None:
    samples = joint.heldout.samples
    frequency = spectral_density(samples, joint.heldout.after)[0]
    density = floor_density(joint, samples, frequency)
    assert np.all(density >= 0.0)
    assert_allclose(np.sqrt(np.sum(density) * (frequency[1] - frequency[0])), joint.noise_floor, rtol=1e-9)
    assert density[-1] < 1e-3 * density.max()  # the filters pass nothing there


@pytest.mark.parametrize("hertz", [3.0, 11.0])
def test_a_line_is_marked_with_its_frequency(joint: JointResult, hertz: float) -> None:
    split = joint.heldout
    time = split.samples.signals.time[split.samples.rows]
    noise = 1e-4 * np.random.default_rng(0).normal(size=time.size)
    after = 1e-2 * np.sin(2.0 * np.pi * hertz * time) + noise
    plot = spectrum_plot(replace(joint, heldout=DataSplit(split.samples, noise, after)), "x")
    assert plot is not None
    (line,) = plot.lines
    assert f"The residual after has a line at {hertz:.3g}"[:35] in line
    assert "Hz" in plot.svg and "noise floor" in plot.svg


def test_white_noise_has_no_line(joint: JointResult) -> None:
    split = joint.heldout
    noise = np.random.default_rng(1).normal(size=split.after.size)
    plot = spectrum_plot(replace(joint, heldout=DataSplit(split.samples, noise, 0.5 * noise)), "x")
    assert plot is not None and plot.lines == []


def ar1(rng: np.random.Generator, size: int, memory: float) -> np.ndarray:
    noise = rng.normal(size=size)
    out = np.zeros(size)
    for i in range(1, size):
        out[i] = memory * out[i - 1] + noise[i]
    return out - out.mean()


def gridded(values: np.ndarray, present: np.ndarray | None = None) -> Gridded:
    mask = np.ones(values.size) if present is None else present
    return Gridded((values * mask,), (mask,), 0.01)


def test_without_gaps_it_is_numpys_correlation() -> None:
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=400), rng.normal(size=400)
    x, y = x - x.mean(), y - y.mean()
    ours = cross_correlation(gridded(y), gridded(x), 0.2)
    full = np.correlate(y, x, "full")[400 - 1 - 20 : 400 + 20]
    pairs = 400 - np.abs(np.arange(-20, 21))
    assert_allclose(ours.value, full / pairs / (x.std() * y.std()), rtol=1e-9, atol=1e-12)  # same sums, by FFT
    assert_allclose(ours.lag, 0.01 * np.arange(-20, 21), atol=1e-12)


def test_a_positive_lag_means_that_the_residual_follows() -> None:
    signal = np.random.default_rng(1).normal(size=3000)
    residual = np.roll(signal, 7)
    found = cross_correlation(gridded(residual), gridded(signal), 0.3)
    assert_allclose(found.lag[np.nanargmax(found.value)], 0.07, atol=1e-9)


def test_gaps_do_not_bend_the_correlation() -> None:
    rng = np.random.default_rng(2)
    series = ar1(rng, 60_000, 0.9)
    present = np.repeat(rng.random(600) > 0.4, 100).astype(float)
    found = autocorrelation(gridded(series, present), 0.2)
    assert_allclose(found.value, 0.9 ** np.arange(21), atol=0.06)  # three standard errors of an AR(1) this long
    assert_allclose(found.band[1], 1.96 / np.sqrt(np.sum(present[1:] * present[:-1])), rtol=1e-9)


def test_bands_hold_95_per_cent_of_independent_but_autocorrelated_series() -> None:
    rng = np.random.default_rng(3)
    inside, white = [], []
    for _ in range(150):
        pair = cross_correlation(gridded(ar1(rng, 1500, 0.9)), gridded(ar1(rng, 1500, 0.85)), 0.4)
        inside.append(np.mean(np.abs(pair.value) <= pair.band))
        white.append(np.mean(np.abs(pair.value) <= 1.96 / np.sqrt(1500)))
    assert_allclose(np.mean(inside), 0.95, atol=0.04)  # the band is itself estimated from 1500 samples
    assert np.mean(white) < 0.65


def test_few_pairs_say_nothing() -> None:
    present = np.zeros(500)
    present[:40] = 1.0
    found = autocorrelation(gridded(np.random.default_rng(4).normal(size=500), present), 0.3)
    assert np.isfinite(found.value[:11]).all()
    assert np.isnan(found.value[11:]).all()


def test_rows_land_on_their_grid(joint: JointResult) -> None:
    side = joint.train
    grid = on_grid(side.samples, side.after)
    assert len(grid.values) == 2
    assert sum(int(m.sum()) for m in grid.present) == side.after.size
    power = sum(float(np.sum(v**2)) for v in grid.values)
    assert_allclose(power, float(np.sum((side.after - side.after.mean()) ** 2)), rtol=1e-9)


def test_a_thinned_correlation_is_broken_where_pairs_are_too_few() -> None:
    lag = 0.01 * np.arange(2000.0)
    value = np.where((lag > 5.0) & (lag < 9.0), np.nan, np.cos(lag))
    thin = Correlation(lag, value, np.full(lag.size, 0.1)).thinned(100)
    assert thin.lag.size < 110
    broken = np.isnan(thin.value)
    assert_allclose(thin.lag[broken], [5.01])
    assert np.all(np.isnan(thin.band) == broken)


def test_a_correlation_outside_its_band_and_no_structure_are_explained_together(joint: JointResult) -> None:
    lag = np.linspace(-1.0, 1.0, 200)
    band, chance = np.full(200, 0.11), np.where(np.arange(200) < 10, 0.2, 0.05)
    assert outside("velocity", Correlation(lag, chance, band)) is None
    found = outside("velocity", Correlation(lag, np.where(lag > 0.0, -0.28 * lag, 0.0), band))
    assert found is not None and (found.value, found.lag) == (-0.28, 1.0)
    assert outside("velocity", Correlation(lag, np.where(lag > 0.0, -0.28 * lag, 0.0), band), reach=1.0) is None
    left = replace(joint.unexplained, structured=False, fraction=0.03)
    said = correlation_words([found], left)
    assert (
        "velocity (−0.28 at a lag of 1.0 s, band ±0.11)" in said and "(3.0\u00a0% of its variance) is too small" in said
    )
    assert correlation_words([found], replace(left, structured=True)) == "" == correlation_words([], left)
