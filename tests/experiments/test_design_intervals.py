"""The interval that a design states is that of least squares with its coloured noise."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.experiments.design.criteria import Parameters
from drake_tc.experiments.design.intervals import NoiseDensity, standard_deviations
from drake_tc.experiments.design.joint import MotionColumns
from drake_tc.experiments.design.known import joint_from_logs
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig

STEP = 5e-3


@pytest.fixture(scope="module")
def known(demo):
    rig = load_rig(demo[0])
    return joint_from_logs(rig, load_runs(demo[1], rig), rig.joints[0])[0]


def columns_of(joint):
    time = np.arange(0.0, 10.0, STEP)
    waves = [(0.4, 0.3), (0.1, 1.1), (0.05, 2.3)]
    motion = np.zeros((4, time.size))
    for amplitude, hz in waves:
        turn = 2.0 * np.pi * hz
        for order in range(4):
            motion[order] += amplitude * turn**order * np.sin(turn * time + 0.5 * np.pi * order)
    return MotionColumns(joint, motion, STEP, sharp=True)


def test_filtered_white_noise_has_the_density(known):
    """Second moments in the time domain: white noise through the two kernels and their derivatives."""
    period, viscous, inertia, held = known.context.period, known.numbers.viscous, 0.6, 400.0
    density = NoiseDensity(replace(known, noise=1.0), known.resolution, held, inertia)
    first, second = (CommonKernel(width, period) for width in (known.kernel_width, known.final_width))
    k = [np.convolve(first.kernels[d], second.kernels[0]) for d in (0, 1, 2)]
    position = known.resolution.position_noise * (held * k[0] + viscous * k[1] + inertia * k[2])
    torque = known.resolution.torque_noise * k[0]
    for frequency in (0.5, 3.0, 8.0):
        wave = np.exp(-2j * np.pi * frequency * period * np.arange(k[0].size))
        parts = abs(position @ wave) ** 2 + abs(torque @ wave) ** 2
        # the share of one frequency in the variance; derivatives of the kernels are those of sampled signals
        share = parts * period / (position @ position + torque @ torque)
        assert_allclose(density.at(np.array([frequency]))[0], share, rtol=0.03)


def test_the_interval_is_that_of_simulated_noise(known):
    """Monte Carlo: noise of the density in 2000 experiments of three periods, fitted by least squares."""
    joint = replace(known, noise=0.2)
    columns = columns_of(joint)
    criterion = Parameters(joint, (), 30.0)
    found = standard_deviations(criterion, columns)
    s = columns.signals
    held = float(np.sqrt(np.mean(s.load_slope**2))) + 1.0 / joint.numbers.gain
    density = NoiseDensity(joint, joint.resolution, held, s.rotor_inertia + s.link_inertia)
    z, size, rng = criterion.columns(columns), 3 * columns.weight.size, np.random.default_rng(4)
    root = np.sqrt(density.at(np.fft.rfftfreq(size, STEP)) / STEP)
    noise = np.fft.irfft(root * np.fft.rfft(rng.normal(size=(2000, size)), axis=1), size, axis=1)
    weighted = np.tile(columns.weight[:, None] * z, (3, 1))
    errors = np.linalg.solve(weighted.T @ np.tile(z, (3, 1)), weighted.T @ noise.T)
    # a standard deviation of 2000 draws is known to 1.6 %; three times this
    assert_allclose(np.std(errors, axis=1), found, rtol=0.05)


def test_without_a_log_the_noise_is_not_known(known):
    joint = replace(known, resolution=None)
    assert standard_deviations(Parameters(joint, (), 30.0), columns_of(joint)) is None
