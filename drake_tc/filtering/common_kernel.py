"""One smooth kernel for all channels of a log: what holds between channels holds after filtering.

Convolution of many long signals with one short kernel, whose spectrum is computed once.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from drake_tc.errors import ParamsError
from drake_tc.types import BoolArray, FloatArray, IntArray

_SPLINE_ORDER = 8
_SIGMA_PER_BOX: float = math.sqrt(_SPLINE_ORDER / 12.0)
_WIDTH_PER_SIGMA = 4.63


@dataclass(frozen=True)
class CommonKernel:
    """A low-pass kernel k and its own exact derivatives k', k'', for a log's signals on a uniform clock.

    Every channel and every derivative passes the same H, so that a linear relation between signals and
    derivatives (a torque balance with J qddot, a current lag) survives, and no delay appears between them:

        smooth(x) = k ∗ x,   derivative(x) = k' ∗ x = k ∗ ẋ,   second_derivative(x) = k'' ∗ x = k ∗ ẍ
        k = β − σ²/2 β'',   H(ω) = sinc(ω b/2)^8 (1 + σ² ω²/2),   sinc(z) = sin(z)/z,   σ² = 8 b²/12

    β: B-spline of degree 7 on eight boxes of width b, a whole number of samples. Its transform has eightfold
    zeros at the sampling frequency: on samples the derivatives are free of aliasing to (f/f_sampling)^8, and
    the term in β'' makes k reproduce polynomials up to order 3 exactly. The support, ±4b, is compact: nothing
    is cut off.

    Attributes:
        width_s: Requested width [s]: that of the Savitzky–Golay window of order 2 with the same −3 dB frequency
            (about 1.06/width). It is rounded to whole boxes; `actual_width_s` tells the result.
        period: Sampling period [s].

    Raises:
        ParamsError: A width or a period that is not positive.

    Example:
        >>> kernel = CommonKernel(0.05, 1e-3)
        >>> time = np.arange(0.0, 1.0, 1e-3)
        >>> rate = kernel.derivative(3.0 * time)
        >>> round(float(rate[500]), 6)
        3.0
    """

    width_s: float
    period: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.width_s) and self.width_s > 0 and np.isfinite(self.period) and self.period > 0):
            raise ParamsError(
                "CommonKernel needs a positive width and period [s]; "
                f"got width {self.width_s:g}, period {self.period:g}"
            )

    @cached_property
    def box(self) -> int:
        """Samples b of one of the eight boxes."""
        return max(1, round(self.width_s / (_WIDTH_PER_SIGMA * _SIGMA_PER_BOX * self.period)))

    @property
    def actual_width_s(self) -> float:
        """Width after rounding to whole boxes [s]."""
        return float(_WIDTH_PER_SIGMA * _SIGMA_PER_BOX * self.box * self.period)

    @property
    def margin(self) -> int:
        """Samples at each end of a stretch whose result also depends on how the signal was extended."""
        return _SPLINE_ORDER // 2 * self.box - 1

    def gain(self, frequency_hz: FloatArray) -> FloatArray:
        """H at the frequencies (F,) [Hz], dimensionless; real, for the kernel is even."""
        omega = 2 * np.pi * np.asarray(frequency_hz, dtype=np.float64)
        box_s = self.box * self.period
        sigma = _SIGMA_PER_BOX * box_s
        return np.asarray(np.sinc(omega * box_s / (2 * np.pi)) ** _SPLINE_ORDER * (1 + 0.5 * (sigma * omega) ** 2))

    @property
    def kernels(self) -> tuple[FloatArray, ...]:
        """k, k', k'' on the samples -margin ... margin: weights of the three convolutions."""
        return tuple(each.weights for each in _convolutions(self.box, self.margin, self.period))

    def smooth(self, x: FloatArray, segments: Sequence[slice] | None = None) -> FloatArray:
        """Filter: k ∗ x, (T,) to (T,).

        Args:
            x: Samples; need not be finite outside `segments`.
            segments: Contiguous stretches, each filtered by itself; NaN between them. None: all of x.
        """
        return self._apply(x, segments, 0)

    def derivative(self, x: FloatArray, segments: Sequence[slice] | None = None) -> FloatArray:
        """First derivative: k' ∗ x [unit/s]; arguments as `smooth`."""
        return self._apply(x, segments, 1)

    def second_derivative(self, x: FloatArray, segments: Sequence[slice] | None = None) -> FloatArray:
        """Second derivative: k'' ∗ x [unit/s²]; arguments as `smooth`."""
        return self._apply(x, segments, 2)

    def valid(self, samples: int, segments: Sequence[slice] | None = None) -> BoolArray:
        """Where the result owes nothing to the extension at the ends, (T,)."""
        mask = np.zeros(samples, dtype=np.bool_)
        for segment in [slice(0, samples)] if segments is None else segments:
            start, stop, _ = segment.indices(samples)
            mask[start + self.margin : max(stop - self.margin, start + self.margin)] = True
        return mask

    def _apply(self, x: FloatArray, segments: Sequence[slice] | None, derivative: int) -> FloatArray:
        x = np.asarray(x, dtype=np.float64)
        if segments is None:
            return self._convolve(x, derivative)
        out = np.full_like(x, np.nan)
        for segment in segments:
            out[segment] = self._convolve(x[segment], derivative)
        return out

    def _convolve(self, x: FloatArray, derivative: int) -> FloatArray:
        """Convolve one stretch, extended by odd reflection (2 x_end − x), its mean taken off first."""
        if x.size == 0:
            return x.copy()
        level = float(x.mean())
        centred = x - level
        if x.size > 1:
            extended = np.pad(centred, self.margin, mode="reflect", reflect_type="odd")
        else:
            extended = np.pad(centred, self.margin, mode="edge")
        y = _convolutions(self.box, self.margin, self.period)[derivative].inner(extended)
        return np.asarray(y + level if derivative == 0 else y)


_BLOCK_PER_KERNEL = 16
"""Length of a block over that of the kernel; the cost changes by a few per cent between 4 and 64."""


@dataclass(frozen=True, eq=False)
class BlockConvolution:
    """y_t = sum_i h_i x_{t-i} for a symmetric range of i, by overlap-save.

    Source: Oppenheim and Schafer, Discrete-Time Signal Processing (1999), section 8.7.

    Attributes:
        weights: (2 m + 1,) h_{-m} ... h_m.
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
        lost = self.weights.size - 1
        count = max(x.size - lost, 0)
        return np.asarray(self._blocks(x)[:, lost:].reshape(-1)[:count]) if count else np.zeros(0)

    def places(self, rows: IntArray) -> IntArray:
        """Where `at` finds samples (N,) of the convolution, counted from the first one that `inner` gives."""
        lost = self.weights.size - 1
        block, within = np.divmod(rows, self._size - lost)
        return np.asarray(block * self._size + lost + within)

    def at(self, x: FloatArray, places: IntArray) -> FloatArray:
        """The convolution (N,) of a signal (T,) at some of its samples alone.

        Args:
            x: (T,) signal.
            places: (N,) of the samples, from `places`.
        """
        return np.asarray(self._blocks(x).reshape(-1)[places]) if x.size >= self.weights.size else np.zeros(0)

    @cached_property
    def _total(self) -> float:
        return float(self.weights.sum())

    def _blocks(self, x: FloatArray) -> FloatArray:
        """(B, size) circular convolution of each block of a signal (T,).

        The mean is taken off first, so that rounding errors are relative to what varies.
        """
        lost = self.weights.size - 1
        step = self._size - lost
        blocks = -(-(x.size - lost) // step)
        level = float(x.sum()) / x.size
        padded = np.zeros(blocks * step + lost)
        np.subtract(x, level, out=padded[: x.size])
        (stride,) = padded.strides
        parts = np.ndarray((blocks, self._size), np.float64, padded, strides=(step * stride, stride))
        spectrum = rfft(parts, axis=1)
        spectrum *= self._spectrum
        return np.asarray(irfft(spectrum, self._size, axis=1) + level * self._total)


@lru_cache(maxsize=32)
def _convolutions(box: int, margin: int, period: float) -> tuple[BlockConvolution, ...]:
    """With k, k' and k'' of a common kernel."""
    from scipy.interpolate import BSpline

    knots = (np.arange(_SPLINE_ORDER + 1) - 0.5 * _SPLINE_ORDER) * box
    spline = BSpline.basis_element(knots, extrapolate=False)
    # basis_element sums to 1 over shifts of one box: divide by b for a unit integral.
    grid = np.arange(-margin, margin + 1, dtype=np.float64)
    sigma2 = (_SIGMA_PER_BOX * box) ** 2
    beta = [spline.derivative(d)(grid) / box for d in range(5)]
    return tuple(BlockConvolution((beta[d] - 0.5 * sigma2 * beta[d + 2]) / period**d) for d in range(3))
