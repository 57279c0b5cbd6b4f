"""Convolution of many long signals with one short kernel, whose spectrum is computed once."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from drake_tc.types import FloatArray, IntArray

_BLOCK_PER_KERNEL = 16
"""Length of a block over that of the kernel; the cost changes by a few per cent between 4 and 64."""


@dataclass(frozen=True, eq=False)
class BlockConvolution:
    """y_t = sum_i h_i x_{t-i} for a symmetric range of i, by overlap-save.

    Source: Oppenheim and Schafer, Discrete-Time Signal Processing (1999), section 8.7.

    Attributes:
        weights: (2 m + 1,) h_{-m} ... h_m, which add up to 1: a low-pass.
    """

    weights: FloatArray

    @property
    def margin(self) -> int:
        """Samples m at each end of a signal for which there is no result."""
        return self.weights.size // 2

    @cached_property
    def _size(self) -> int:
        return int(next_fast_len(_BLOCK_PER_KERNEL * self.weights.size, real=True))

    @cached_property
    def _spectrum(self) -> FloatArray:
        return np.asarray(rfft(self.weights, self._size))

    def inner(self, x: FloatArray) -> FloatArray:
        """The convolution where all of the kernel lies on the signal, (T,) to (T - 2 m,)."""
        return self.at(x, self.places(np.arange(max(x.size - self.weights.size + 1, 0))))

    def places(self, rows: IntArray) -> IntArray:
        """Where `at` finds samples (N,) of the convolution, counted from the first one that `inner` gives."""
        lost = self.weights.size - 1
        block, within = np.divmod(rows, self._size - lost)
        return np.asarray(block * self._size + lost + within)

    def at(self, x: FloatArray, places: IntArray) -> FloatArray:
        """The convolution (N,) of a signal (T,) at some of its samples alone.

        The mean is taken off first, so that rounding errors are relative to what varies.

        Args:
            x: (T,) signal.
            places: (N,) of the samples, from `places`.
        """
        lost = self.weights.size - 1
        count = x.size - lost
        if count <= 0:
            return np.zeros(0)
        step = self._size - lost
        blocks = -(-count // step)
        level = float(x.mean())
        padded = np.zeros(blocks * step + lost)
        np.subtract(x, level, out=padded[: x.size])
        spectrum = rfft(np.lib.stride_tricks.sliding_window_view(padded, self._size)[::step], axis=1)
        spectrum *= self._spectrum
        return np.asarray(irfft(spectrum, self._size, axis=1).reshape(-1)[places] + level)
