"""The spectrum of the residual: powers, lines and the noise floor."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.noise_colour import spectral_density
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.report.plots.spectrum import banded, floor_density, spectrum_plot


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
