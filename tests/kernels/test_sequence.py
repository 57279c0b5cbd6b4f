"""Several kernels in one call do what they do one by one; what cannot be passed by its address is refused."""

import numba
import numpy as np
import pytest

from drake_tc.kernels.calls import COPY_AFTER, COPY_BELOW, GATHER, KernelCall, above, copying, gathering, sequences

NEEDS_COMPILER = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")


@NEEDS_COMPILER
def test_neighbours_become_one_call_and_the_order_stays():
    source, middle, target = np.arange(4.0), np.zeros(4), np.zeros(2)

    def double(time):
        middle[:] *= 2.0 + time

    calls = sequences(
        [copying(source, middle), gathering(middle, np.array([3, 1]), target), double, copying(middle, source)]
    )
    assert len(calls) == 3
    for call in calls:
        call(1.0)
    np.testing.assert_array_equal(target, [3.0, 1.0])
    np.testing.assert_array_equal(source, [0.0, 3.0, 6.0, 9.0])


@NEEDS_COMPILER
def test_a_sequence_reads_its_arrays_anew_each_time():
    source, target = np.zeros(3), np.zeros(3)
    (both,) = sequences([copying(source, target), copying(target, np.zeros(3))])
    for value in (1.0, np.nan, -2.0):
        source[:] = value
        both(0.0)
        np.testing.assert_array_equal(target, np.full(3, value))


@pytest.mark.parametrize("wrong", [np.zeros((4, 4))[:, 1], np.zeros(3, dtype=np.float32), np.zeros((2, 3)).T])
def test_arrays_that_an_address_does_not_describe_are_refused(wrong):
    with pytest.raises(TypeError, match="contiguous array of float64 or int64"):
        KernelCall(GATHER, lambda time: None, wrong, np.arange(3), np.zeros(3))


@NEEDS_COMPILER
def test_what_a_limit_or_a_time_decides():
    source, marks, shown = np.array([1.0, np.nan, 3.0]), np.zeros(3), np.zeros(3)
    asked = []
    call = KernelCall(COPY_AFTER, asked.append, source, shown, 0.5)
    (both,) = sequences([above(source, 1.0, marks), call])
    both(0.499)
    np.testing.assert_array_equal(marks, [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(shown, np.zeros(3))
    both(0.5)
    np.testing.assert_array_equal(shown, source)
    assert not asked


@NEEDS_COMPILER
def test_a_copy_below_a_limit_is_left_to_python_at_the_limit():
    source, watched, target, last = np.arange(2.0), np.zeros(3), np.full(2, 9.0), np.zeros(2)
    asked = []
    usual = KernelCall(COPY_BELOW, asked.append, source, target, watched, 2.0)
    (both,) = sequences([usual, copying(source, last)])
    watched[:] = 1.0, np.nan, -5.0
    both(1.0)
    np.testing.assert_array_equal(target, source)
    assert not asked
    source[:], watched[2] = 7.0, 2.0
    both(3.0)
    assert asked == [3.0]
    np.testing.assert_array_equal(target, [0.0, 1.0])
    np.testing.assert_array_equal(last, source)  # what follows still runs
