"""A lag of the effort is told from a low-pass that only takes out noise."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.selection.joint_problem import best_shape
from drake_tc.diagnosis.selection.lag_or_noise import Backwards, is_noise
from drake_tc.diagnosis.selection.shape_refinement import refine
from drake_tc.effects.base import plain_signals
from drake_tc.effects.current_lag import CurrentLag

from ..rigs import Joint, Problem, problem

LAG = CurrentLag()


def band_noise(size: float, highest_hz: float):
    def extra(m):
        rng = np.random.default_rng(round(1e6 * abs(float(m.q[0]))))
        spectrum = np.fft.rfft(rng.standard_normal(m.time.size))
        spectrum[np.fft.rfftfreq(m.time.size, float(m.time[1])) > highest_hz] = 0.0
        noise = np.fft.irfft(spectrum, m.time.size)
        return size * noise / np.std(noise)

    return extra


def with_lag(p: Problem, lag: float) -> Columns:
    """The effort that a drive of this lag needs: y = y* + T dy*/dt, with the effort as recorded for y*."""
    effort = p.samples.signals.effort
    ahead = effort + lag * np.gradient(effort, p.samples.signals.period)
    return Columns(replace(p.samples, signals=replace(p.samples.signals, effort=ahead)))


def verdict(columns: Columns, p: Problem) -> bool:
    start = fit(columns, p.declared)
    found = refine(columns, best_shape(columns, start, LAG, p.context))
    assert found.cv_rms < 0.95 * start.cv_rms  # the lag pays either way
    return is_noise(columns, found, found.terms[-1])


@pytest.mark.parametrize("highest_hz", [20.0, 60.0])
def test_a_torque_that_no_column_records_is_no_lag(highest_hz):
    p = problem(Joint(torque_noise=0.05, extra=band_noise(1.0, highest_hz)), runs=2)
    assert verdict(p.columns, p)


@pytest.mark.parametrize("noise", [0.0, 0.2])
@pytest.mark.parametrize("lag", [0.006, 0.02])
def test_a_lag_is_a_lag(lag, noise):
    p = problem(Joint(torque_noise=0.05, extra=band_noise(noise, 60.0)), runs=2)
    assert not verdict(with_lag(p, lag), p)


def test_other_effects_are_not_asked():
    p = problem(Joint(), runs=1)
    assert not is_noise(p.columns, p.baseline, p.baseline.terms[0])


def test_backwards_is_the_filter_on_the_turned_signal():
    effort = np.random.default_rng(0).standard_normal(300).cumsum()
    signals = replace(plain_signals(300, {}), period=0.002)
    effort[0] = effort[-1] = 0.0
    pole = np.exp(-0.002 / 0.01)
    found = Backwards(LAG).transform(effort, signals, {"lag": 0.01})
    share = (1.0 - pole) / (0.002 / 0.01)
    expected = lfilter([1.0 - share, share - pole], [1.0, -pole], effort[::-1])[::-1]
    assert_allclose(found, expected, atol=1e-12 * np.abs(effort).max())
    assert Term(Backwards(LAG), {"lag": 0.01}).cache_key != Term(LAG, {"lag": 0.01}).cache_key
