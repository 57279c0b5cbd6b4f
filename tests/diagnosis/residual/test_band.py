"""The band in which the model explains the effort: noise above a frequency ends it there."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.residual.over_time import shared_band
from drake_tc.diagnosis.residual.unexplained import DataSplit

from ..rigs import Joint, record, rig_of

JOINT = Joint(duration=60.0, period=4e-3)


@pytest.fixture(scope="module")
def samples() -> Samples:
    """Rows without gaps at reversals, so that no power leaks between frequencies."""
    made = build_samples([record(JOINT)], rig_of(JOINT), "joint", width_s=0.02)
    rows = np.arange(500, len(made.signals) - 500, 2)
    block = (rows - rows[0]) // 125
    return replace(made, rows=rows, run=np.zeros_like(rows), block=block, row_period=2 * JOINT.period)


def split(samples: Samples, low_hz: float, high_hz: float, rms: float) -> DataSplit:
    """A residual of the given RMS [A], even between two frequencies."""
    size = len(samples.signals)
    spectrum = np.fft.rfft(np.random.default_rng(0).standard_normal(size))
    frequency = np.fft.rfftfreq(size, samples.signals.period)
    spectrum[(frequency < low_hz) | (frequency > high_hz)] = 0.0
    noise = np.fft.irfft(spectrum, size)[samples.rows]
    left = rms * noise / np.std(noise)
    return DataSplit(samples, left, left)


def test_the_band_ends_where_the_noise_begins(samples: Samples) -> None:
    noisy = split(samples, 4.1, 12.0, 0.5)
    found = shared_band(noisy, noisy)
    assert found is not None
    assert 3.1 <= found.limit_hz <= 4.1  # the third of an octave in which the noise begins
    assert found.heldout < 0.02 * 0.5
    assert found.train == found.heldout


def test_what_is_left_in_the_band_is_counted(samples: Samples) -> None:
    below, above = split(samples, 0.3, 0.6, 0.02), split(samples, 4.1, 12.0, 0.5)
    both = replace(below, before=below.after + above.after, after=below.after + above.after)
    found = shared_band(both, both)
    assert found is not None
    assert_allclose(found.heldout, 0.02, rtol=0.1)  # the ends of the record leak a little of the power above


def test_a_model_that_explains_next_to_nothing_has_no_band(samples: Samples) -> None:
    effort = samples.reduce(samples.signals.effort)
    found = shared_band(*(DataSplit(samples, effort, effort),) * 2)
    assert found is not None
    assert found.limit_hz == 0.0
    assert np.isnan(found.train)
    assert np.isnan(found.heldout)


def test_a_model_that_explains_all_frequencies_shares_the_whole_band(samples: Samples) -> None:
    nothing = np.zeros_like(samples.reduce(samples.signals.effort))
    assert shared_band(*(DataSplit(samples, nothing, nothing),) * 2) is None
