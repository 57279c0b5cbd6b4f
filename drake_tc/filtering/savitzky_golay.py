"""Savitzky–Golay estimation: a polynomial fitted to the last N samples, and its derivatives.

Source: Del Prete et al., 2016, section 2.

Plain functions for logs first, then `SavitzkyGolayFilter`, the same recursion as a Drake system.

Weights of a Savitzky–Golay estimate: a polynomial's value and derivatives by least squares.

Source: Del Prete et al., 2016, section 2.

The Savitzky-Golay window whose derivatives have the least error, from the spectrum of the log itself.

Of a channel x = s + e with white noise e of density N, a window with the frequency response H_d estimates the d-th
derivative with the expected squared error

    R = int |H_d(f) - (2 pi i f)^d|^2 S_s(f) df + N f_s/2 sum w_k^2

bias first, noise second. N is read from the upper end of the channel's spectrum S, and S_s = S - N where S stands out
of the noise. This is Mallows' risk (1973) for derivatives, with the spectrum in place of the residual: the residual of
the smoothed value says little of the error of a second derivative.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem
from scipy.fft import rfft
from scipy.signal import welch

from drake_tc.array_stage import Arrays, ArrayStage, PortMethods, places
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import FILTER, Kernel, KernelCall, copying
from drake_tc.types import Call, FloatArray, IntArray


def savgol_weights(
    window: int, order: int, at: float | None = None, derivative: int = 0, dt: float = 1.0
) -> FloatArray:
    """Weights w of the estimate w·x, x the window's samples from oldest to newest.

    With P the least-squares polynomial of `order` through x[0..N-1], w·x = d^k P/dt^k at sample `at`.
    A Legendre basis on [-1, 1] keeps the pseudo-inverse well conditioned for every order.

    Args:
        window: Number of samples N, at least order + 1.
        order: Order of the polynomial, >= 0.
        at: Where in the window, in samples from the oldest (0) to the newest (N - 1); None for the middle.
        derivative: k >= 0.
        dt: Sampling period [s].

    Returns:
        (N,) weights [1/s^k].

    Raises:
        ParamsError: A window too short for the order, a point outside it, a period that is not positive.

    Source: Savitzky and Golay, 1964.

    Example:
        >>> savgol_weights(5, 2).round(3).tolist()
        [-0.086, 0.343, 0.486, 0.343, -0.086]
    """
    at = 0.5 * (window - 1) if at is None else at
    check_window(window, order, at, dt)
    if derivative < 0:
        raise ParamsError(f"Savitzky–Golay derivative must be 0, 1, 2, ..., got {derivative}")
    if derivative > order:
        return np.zeros(window)
    half = max(0.5 * (window - 1), 0.5)
    u = (np.arange(window) - 0.5 * (window - 1)) / half
    pseudo_inverse = np.linalg.pinv(legendre.legvander(u, order))
    u_at = (at - 0.5 * (window - 1)) / half
    basis = np.eye(order + 1)
    row = legendre.legval(u_at, legendre.legder(basis, derivative)) if derivative else legendre.legval(u_at, basis)
    return np.asarray(row @ pseudo_inverse / (half * dt) ** derivative, dtype=np.float64)


def delay(window: int, dt: float, at: float | None = None) -> float:
    """Age of the causal estimate [s]: (N - 1 - at) dt; mid-window (N - 1)/2 dt.

    Raises:
        ParamsError: As `savgol_weights`.

    Example:
        >>> delay(81, 1e-3)
        0.04
    """
    at = 0.5 * (window - 1) if at is None else at
    check_window(window, 0, at, dt)
    return (window - 1 - at) * dt


def check_window(window: int, order: int, at: float, dt: float) -> None:
    """Refuse a window, order, point or period that is not possible.

    Raises:
        ParamsError: See `savgol_weights`.
    """
    if order < 0 or window < order + 1:
        raise ParamsError(
            "Savitzky–Golay needs order >= 0 and a window of at least order + 1 samples; "
            f"got order {order}, window {window}"
        )
    if not 0 <= at <= window - 1:
        raise ParamsError(f"Savitzky–Golay point must lie in the window, 0 to {window - 1}, got {at:g}")
    if not (np.isfinite(dt) and dt > 0):
        raise ParamsError(f"Savitzky–Golay period must be positive and finite [s], got {dt:g}")


_ADVANCE, _FIT = Kernel("filters", "advance"), Kernel("filters", "fit")


@dataclass(frozen=True)
class Smoothed:
    """A signal and its derivatives, all from the same polynomial.

    Attributes:
        value: (T, ...) [unit of the signal].
        first_derivative: (T, ...) [unit/s].
        second_derivative: (T, ...) [unit/s²]; zero for a polynomial of order 1.
    """

    value: FloatArray
    first_derivative: FloatArray
    second_derivative: FloatArray


def smooth(x: FloatArray, window: int, order: int, dt: float) -> Smoothed:
    """Filter a log non-causally: every sample estimated at its own time, no delay.

    Inside, sample t is estimated at index N//2 of the window around it (the middle, for odd N). The first
    and last N//2 samples are read off the polynomial of the first and the last full window, so that
    polynomials of the order are reproduced up to the ends.

    Args:
        x: (T,) or (T, n), finite, one uniform stretch.
        window: N <= T samples.
        order: Order of the polynomial.
        dt: Sampling period [s].

    Raises:
        ParamsError: A stretch shorter than the window; otherwise as `savgol_weights`.

    Example:
        >>> time = np.arange(0.0, 1.0, 0.01)
        >>> float(smooth(time**2, 15, 2, 0.01).first_derivative[50].round(6))
        1.0
    """
    x = np.asarray(x, dtype=np.float64)
    if x.shape[0] < window:
        raise ParamsError(
            f"Savitzky–Golay window: expected at least {window} samples; the stretch has only {x.shape[0]}"
        )
    return Smoothed(*(_smooth_one(x, window, order, derivative, dt) for derivative in range(3)))


def _smooth_one(x: FloatArray, window: int, order: int, derivative: int, dt: float) -> FloatArray:
    from scipy.signal import oaconvolve

    centre = window // 2
    after = window - 1 - centre
    level = x.mean(axis=0)
    weights = savgol_weights(window, order, centre, derivative, dt)[::-1]
    kernel = weights.reshape((-1,) + (1,) * (x.ndim - 1))
    out = np.empty_like(x)
    out[centre : x.shape[0] - after] = oaconvolve(x - level, kernel, mode="valid", axes=0)
    head = np.stack([savgol_weights(window, order, i, derivative, dt) for i in range(centre)]) if centre else None
    if head is not None:
        out[:centre] = np.tensordot(head, x[:window] - level, axes=1)
    if after:
        tail = np.stack([savgol_weights(window, order, centre + 1 + i, derivative, dt) for i in range(after)])
        out[x.shape[0] - after :] = np.tensordot(tail, x[-window:] - level, axes=1)
    return out + level if derivative == 0 else out


def smooth_causal(x: FloatArray, window: int, order: int, dt: float, at: float | None = None) -> Smoothed:
    """What a causal filter has after each sample: estimates that are `delay(window, dt, at)` old.

    Before the window is full it is padded with the first sample.

    Args:
        x: (T,) or (T, n), finite.
        window: N samples.
        order: Order of the polynomial.
        dt: Sampling period [s].
        at: Point of the window, in samples from the oldest; None for the middle.

    Raises:
        ParamsError: As `savgol_weights`.

    Example:
        >>> time = np.arange(0.0, 1.0, 0.01)
        >>> float(smooth_causal(time, 21, 1, 0.01).value[50].round(6))  # 0.1 s late
        0.4
    """
    from scipy.signal import lfilter

    x = np.asarray(x, dtype=np.float64)
    first = x[:1]
    outputs = []
    for derivative in range(3):
        weights = savgol_weights(window, order, at, derivative, dt)
        y = lfilter(weights[::-1], [1.0], x - first, axis=0)
        outputs.append(y + first if derivative == 0 else y)
    return Smoothed(*outputs)


class SavitzkyGolayFilter(PortMethods, LeafSystem):
    """Smoothed value and derivatives of n joints, from a polynomial through the last N samples.

    Ports:
        in  `signal`             (n,) u, read every dt.
        out `value`              (n,)
        out `first_derivative`   (n,) [1/s]
        out `second_derivative`  (n,) [1/s²]; zero for a polynomial of order 1.
        out `fault`              (n,) 1 where the last sample was not finite (or none has come yet), else 0.
        out `estimate`           (3n,) [value; first derivative; second derivative]

    Discrete state: [the window X (N, n) as a ring; the started flags b (n,); the row h of the oldest sample], the fault
    flags c (n,), and the estimate y (3n,). Per joint, every dt:

        s[k]   = u[k] where finite, else X[k]'s newest (the last good sample is held)
        X[k+1] = [X[k] without its oldest; s[k]]        once started: s[k] is put in row h, then h moves on
        X[k+1] = [s[k]; ... s[k]]                       at the first finite sample (no bump)
        c[k+1] = 1 where u[k] is not finite, else 0
        y_d[k+1] = w_d · X[k+1],   d = 0, 1, 2,  w_d = `savgol_weights(N, order, at, d, dt)`

    Outputs depend on the state only, no feedthrough: a reader just after tick k sees an estimate `delay` old;
    a discrete system of the same period, which reads X[k] during tick k, sees one that is `delay + dt` old.
    Until the first finite sample the outputs are 0 and `fault` is 1. An update costs O(N n), an output
    nothing; nothing is raised in the loop.

    Source: Del Prete et al., 2016, section 2 (N = 80, dt = 1 ms, mid-window, order 2 for encoders, 1 for IMU and F/T).

    Example:
        >>> SavitzkyGolayFilter(7, window=80, order=2, dt=1e-3).get_estimate_output_port().size()
        21
    """

    def __init__(self, size: int, window: int, order: int | Sequence[int], dt: float, at: float | None = None) -> None:
        """Declare ports, state and the periodic update.

        Args:
            size: Joints n.
            window: Samples N.
            order: Order of the polynomial, for all joints or one a joint.
            dt: Period of the update [s].
            at: Point of the window, in samples from the oldest; None for the middle.

        Raises:
            ParamsError: As `savgol_weights`, for a size below 1, and for orders of another number than n.
        """
        super().__init__()
        if size < 1:
            raise ParamsError(f"SavitzkyGolayFilter needs at least one joint, got size {size}")
        orders = (order,) * size if isinstance(order, int) else tuple(order)
        if len(orders) != size:
            raise ParamsError(f"SavitzkyGolayFilter needs one order, or one a joint ({size}), got {len(orders)}")
        self._size, self._window, self._dt = size, window, float(dt)
        self._delay = delay(window, dt, at)
        distinct = sorted(set(orders))
        weights = np.stack([[savgol_weights(window, o, at, d, dt) for o in distinct] for d in range(3)])
        doubled = np.concatenate([weights, weights], axis=2)  # any rotation is a slice
        table = np.ascontiguousarray(doubled.reshape(3 * len(distinct), 2 * window).T)
        self._weights = (table, np.array([distinct.index(o) for o in orders]))
        self._input: Any = self.DeclareVectorInputPort("signal", size)
        all_faulty: Any = np.ones(size)
        start: Any = np.append(np.zeros(window * size + size), window - 1.0)
        self._start: FloatArray = start
        memory, fault = self.DeclareDiscreteState(start), self.DeclareDiscreteState(all_faulty)
        estimate = self.DeclareDiscreteState(3 * size)
        self._memory, self._fault, self._estimate = int(memory), int(fault), int(estimate)
        for d, name in enumerate(("value", "first_derivative", "second_derivative")):
            self.DeclareVectorOutputPort(name, size, self._writer(d), {self.discrete_state_ticket(estimate)})
        self.DeclareStateOutputPort("fault", fault)
        self.DeclareStateOutputPort("estimate", estimate)
        self.DeclarePeriodicDiscreteUpdateEvent(period_sec=dt, offset_sec=0.0, update=self._update)

    @property
    def delay(self) -> float:
        """Age of the estimate just after a tick [s]."""
        return self._delay

    def coordinates(self, context: Context) -> FloatArray:
        """(N n,) the window, oldest sample first: the state without its bookkeeping (`drake_tc.analysis`)."""
        self.ValidateContext(context)
        memory = context.get_discrete_state(self._memory).value()
        ring = np.reshape(memory[: self._window * self._size], (self._window, self._size))
        return np.roll(ring, -int(memory[-1]), axis=0).ravel()

    def set_coordinates(self, context: Context, x: FloatArray) -> None:
        """Make the window (N n,) x, oldest first, and the estimate what belongs to it."""
        self.ValidateContext(context)
        memory: Any = np.array(context.get_discrete_state(self._memory).value())
        ring = np.roll(np.asarray(x).reshape(self._window, self._size), int(memory[-1]), axis=0)
        memory[: ring.size] = ring.ravel()
        estimate: Any = np.empty(3 * self._size)
        _FIT(memory, *self._weights, estimate)
        context.SetDiscreteState(self._memory, memory)
        context.SetDiscreteState(self._estimate, estimate)

    def coordinate_names(self) -> tuple[str, ...]:
        """Of `coordinates`: "input[i]@-k" is the sample of channel i that is k ticks old."""
        ages = range(self._window - 1, -1, -1)
        return tuple(f"input[{i}]@-{age}" for age in ages for i in range(self._size))

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports; the state is [window; estimate; fault flags]."""
        n, kept = self._size, self._window * self._size + self._size + 1

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            memory, estimate, fault = np.split(arrays.after, [kept, kept + 3 * n])
            signal, weights, written = arrays.inputs["signal"], self._weights, (memory, fault, estimate)

            def update(time: float) -> None:
                _ADVANCE(signal, weights, *written)

            return copying(arrays.before[kept:], arrays.out), KernelCall(FILTER, update, signal, *weights, *written)

        names = ("value", "first_derivative", "second_derivative")
        parts = {name: slice(d * n, (d + 1) * n) for d, name in enumerate((*names, "fault"))}
        start = np.concatenate([self._start, np.zeros(3 * n), np.ones(n)])
        ports = places(parts | {"estimate": slice(3 * n)})
        return ArrayStage(4 * n, ports, bind, updates=frozenset({"signal"}), start=start, period=self._dt)

    def _writer(self, derivative: int) -> Callable[[Context, Any], None]:
        """The calc function of an output with one of the three derivatives."""
        part = slice(derivative * self._size, (derivative + 1) * self._size)

        def write(context: Any, output: Any) -> None:
            output.set_value(context.get_discrete_state(self._estimate).value()[part])

        return write

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        new: Any = discrete_state
        memory, fault = new.get_mutable_value(self._memory), new.get_mutable_value(self._fault)
        estimate = new.get_mutable_value(self._estimate)
        _ADVANCE(self._input.Eval(context), self._weights, memory, fault, estimate)


LEAST_WINDOW = 5
LONGEST_SECONDS = 0.25
RATIO = 1.2
"""Of neighbouring windows among the candidates."""
ORDERS = (2, 3, 4, 5)
SEGMENT_SECONDS = 2.0
"""Of the stretches whose spectra are averaged, at most."""
LEAST_AVERAGES = 8
"""Of such stretches, which overlap by half; fewer would let chance stand out of the noise."""
NOISE_BAND = (0.5, 0.9)
"""Part of the band up to half the sampling frequency that is taken for noise."""
BAND = 1.15
"""Ratio of the frequencies at the end and in the middle of the band over which a density is averaged."""
DEVIATIONS = 4.0
"""Standard deviations by which the average must exceed the noise to count as signal."""


@dataclass(frozen=True)
class Window:
    """A Savitzky-Golay window.

    Attributes:
        samples: Odd number of samples.
        order: Of the polynomial.
    """

    samples: int
    order: int


def choose_window(channels: Sequence[tuple[FloatArray, int]], period: float) -> Window:
    """The window for several channels and derivatives at once.

    The risk of each group, added up over its channels, counts relative to the least that a window of the candidates
    has, and the sum of these over the groups is least.

    Args:
        channels: Groups (values, requested derivative), each of (T, n) finite values of one unit and one uniform
            stretch; 0 is the value itself. T is at least 20.
        period: [s].
    """
    candidates = tuple(_candidates(channels[0][0].shape[0], period))
    cost = np.zeros(len(candidates))
    for values, derivative in channels:
        spectra = [_spectrum(column, period) for column in values.T if np.ptp(column) > 0.0]
        risks = np.array([sum(_risk(each, derivative, s) for s in spectra) for each in candidates])
        least = float(risks.min())
        cost += risks / least if least > 0.0 else 0.0
    return candidates[int(np.argmin(cost))]


@dataclass(frozen=True)
class _Spectrum:
    """(F,) places k of the frequencies k/(size period) at which there is signal, its density there, and the noise's."""

    place: IntArray
    signal: FloatArray
    noise: float
    size: int
    period: float


def _candidates(samples: int, period: float) -> Iterator[Window]:
    longest = max(min(round(LONGEST_SECONDS / period), samples // 4), LEAST_WINDOW)
    size = float(LEAST_WINDOW)
    sizes = []
    while size <= longest:
        sizes.append(2 * int(size / 2.0) + 1)
        size *= RATIO
    for count in dict.fromkeys(sizes):
        for order in ORDERS:
            if count > order + 1:
                yield Window(count, order)


def _spectrum(values: FloatArray, period: float) -> _Spectrum:
    """One-sided densities of signal and noise, from averages of windows without leakage."""
    size = max(min(round(SEGMENT_SECONDS / period), 2 * values.size // (LEAST_AVERAGES + 1)), 8)
    frequency, density = welch(values, 1.0 / period, window="nuttall", nperseg=size, detrend="linear")
    upper = (frequency >= NOISE_BAND[0] * frequency[-1]) & (frequency <= NOISE_BAND[1] * frequency[-1])
    noise = float(np.mean(density[upper]))
    # weak content over a broad band stands out of the noise only where neighbouring frequencies are averaged
    low, high = (np.searchsorted(frequency, frequency * ratio) for ratio in (1.0 / BAND, BAND))
    total = np.concatenate([[0.0], np.cumsum(density)])
    count = np.maximum(high - low, 1)
    mean = (total[np.minimum(low + count, density.size)] - total[low]) / count
    limit = noise * (1.0 + DEVIATIONS / np.sqrt(count * LEAST_AVERAGES))
    there = (mean > limit) & (frequency < NOISE_BAND[0] * frequency[-1])
    return _Spectrum(np.flatnonzero(there), mean[there] - noise, noise, size, period)


@lru_cache(maxsize=4096)
def _response(window: Window, derivative: int, period: float, size: int) -> tuple[FloatArray, float]:
    """(size//2 + 1,) squared error |H_d(f) - (2 pi i f)^d|^2 at f = k/(size period), and sum w_k^2."""
    weights = savgol_weights(window.samples, window.order, None, derivative, period)
    longer = -(-window.samples // size)
    omega = 2.0 * np.pi * np.arange(size // 2 + 1) / (size * period)
    centred = rfft(weights, longer * size)[::longer] * np.exp(1j * omega * (window.samples // 2) * period)
    # convolution turns the window round: the weight of the sample at a lag belongs to exp(+i omega lag)
    return np.abs(np.conj(centred) - (1j * omega) ** derivative) ** 2, float(weights @ weights)


def _risk(window: Window, derivative: int, spectrum: _Spectrum) -> float:
    """R of the module's equation."""
    bias, squares = _response(window, derivative, spectrum.period, spectrum.size)
    seen = float(spectrum.signal @ bias[spectrum.place]) / (spectrum.size * spectrum.period)
    return seen + spectrum.noise * 0.5 / spectrum.period * squares
