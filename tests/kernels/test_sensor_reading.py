"""The reading of a tick, channel by channel by hand: scale, offset, steps, ages, and what is stuck."""

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from drake_tc.kernels.calls import Kernel

READING = Kernel("sensors", "reading")
PLAIN, NOTHING = np.array([[1.0, 1.0], [0.0, 0.0]]), np.zeros(0)


def read(truth, row, *, ring=NOTHING, last=NOTHING, channels=PLAIN, layout=(0, 0)):
    out = np.empty(2)
    READING(np.array(truth), np.array(row), (ring, last), (channels, np.array(layout)), out)
    return out


def test_scale_offset_and_steps():
    channels = np.array([[2.0, 1.0], [0.5, 0.0]])
    assert_array_equal(read([1.3, 0.1], [0.0, 0.0, 0.1, -1.0], channels=channels), [2.5, -0.9])  # 2.7 to the step
    assert_array_equal(read([0.625, 0.0], [0.0, 0.0, 0.0, 0.0], channels=channels), [1.0, 0.0])  # a half to the even
    lost = read([1.0, 2.0], [0.0, 0.0, np.nan, 0.0])
    assert np.isnan(lost[0])
    assert lost[1] == 2.0


def test_latency_and_ages_read_the_ring():
    ring = np.array([10.0, 11.0, 20.0, 21.0, 30.0, 31.0])  # ticks 3, 4, 5 of two channels, before tick 6
    late = [6.0, 0.0, 0.0, 0.0]
    assert_array_equal(read([40.0, 41.0], late, ring=ring, layout=(1, 0)), [30.0, 31.0])
    aged = [6.0, 0.0, 0.0, 0.0, 2.0, 0.0]
    assert_array_equal(read([40.0, 41.0], aged, ring=ring, layout=(1, 4)), [10.0, 31.0])
    assert_array_equal(read([40.0, 41.0], aged, ring=ring, layout=(0, 4)), [20.0, 41.0])


def test_a_stuck_channel_repeats_its_last_finite_reading():
    row = [6.0, 1.0, 0.0, 0.0, 1.0, 1.0]
    assert_allclose(read([4.0, 5.0], row, last=np.array([1.0, np.nan])), [1.0, 5.0], rtol=0)
