"""One convolution of many signals with one kernel, against numpy's and against two passes of the common kernel."""

import numpy as np
import pytest

from drake_tc.filtering.common_kernel import BlockConvolution, CommonKernel

ROUNDING = 1e-12  # of signals of size 1 to 30: a few thousand rounding errors


@pytest.mark.parametrize("size", [45, 46, 719, 720, 5000])
def test_it_is_the_convolution_where_the_kernel_lies_on_the_signal(size):
    kernel = CommonKernel(0.02, 1e-3)
    filter_ = BlockConvolution(np.convolve(kernel.kernels[0], kernel.kernels[0]))
    x = np.cumsum(np.random.default_rng(size).standard_normal(size)) + 7.0
    expected = np.convolve(x, filter_.weights, "valid") if size >= filter_.weights.size else np.zeros(0)
    assert filter_.inner(x).size == max(size - 2 * filter_.margin, 0)
    np.testing.assert_allclose(filter_.inner(x), expected, rtol=0.0, atol=ROUNDING * 30.0)


def test_two_kernels_in_one_pass_give_what_two_passes_give():
    light, final = CommonKernel(0.02, 1e-3), CommonKernel(0.05, 1e-3)
    both = BlockConvolution(np.convolve(light.kernels[0], final.kernels[0]))
    t = np.arange(6000) * 1e-3
    x = np.sin(9.0 * t) * np.sign(np.cos(2.0 * t)) + 40.0
    assert both.margin == light.margin + final.margin
    twice = final.smooth(light.smooth(x))[both.margin : -both.margin]
    np.testing.assert_allclose(both.inner(x), twice, rtol=0.0, atol=ROUNDING * 40.0)


def test_a_signal_shorter_than_the_kernel_has_no_result():
    assert BlockConvolution(np.full(9, 1.0 / 9.0)).inner(np.ones(8)).size == 0


def test_some_rows_have_what_all_rows_have():
    kernel = CommonKernel(0.02, 1e-3)
    filter_ = BlockConvolution(kernel.kernels[0])
    x = np.cumsum(np.random.default_rng(0).standard_normal(5000))
    rows = np.array([0, 3, 718, 719, 720, 4000, 5000 - 2 * filter_.margin - 1])
    np.testing.assert_array_equal(filter_.at(x, filter_.places(rows)), filter_.inner(x)[rows])
