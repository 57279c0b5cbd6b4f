"""Savitzky–Golay estimation: a polynomial fitted to the last N samples, and its derivatives (EQUATIONS A1).

Plain functions first (weights, logs), then `SavitzkyGolayFilter`, the same recursion as a Drake system.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem
from scipy.signal import lfilter, oaconvolve

from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray


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

    Source: EQUATIONS A1; Savitzky and Golay, 1964.
    """
    at = 0.5 * (window - 1) if at is None else at
    _check(window, order, at, dt)
    if derivative < 0:
        raise ParamsError(f"Savitzky–Golay derivative must be 0, 1, 2, ...; got {derivative}")
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
    """
    at = 0.5 * (window - 1) if at is None else at
    _check(window, 0, at, dt)
    return (window - 1 - at) * dt


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
    """
    x = np.asarray(x, dtype=np.float64)
    if x.shape[0] < window:
        raise ParamsError(f"Savitzky–Golay window of {window} samples wanted; the stretch has only {x.shape[0]}")
    return Smoothed(*(_smooth_one(x, window, order, derivative, dt) for derivative in range(3)))


def _smooth_one(x: FloatArray, window: int, order: int, derivative: int, dt: float) -> FloatArray:
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
    """
    x = np.asarray(x, dtype=np.float64)
    first = x[:1]
    outputs = []
    for derivative in range(3):
        weights = savgol_weights(window, order, at, derivative, dt)
        y = lfilter(weights[::-1], [1.0], x - first, axis=0)
        outputs.append(y + first if derivative == 0 else y)
    return Smoothed(*outputs)


def _check(window: int, order: int, at: float, dt: float) -> None:
    if order < 0 or window < order + 1:
        raise ParamsError(
            "Savitzky–Golay needs order >= 0 and a window of at least order + 1 samples; "
            f"got order {order}, window {window}"
        )
    if not 0 <= at <= window - 1:
        raise ParamsError(f"Savitzky–Golay point must lie in the window, 0 to {window - 1}; got {at:g}")
    if not (np.isfinite(dt) and dt > 0):
        raise ParamsError(f"Savitzky–Golay period must be positive and finite [s]; got {dt:g}")


class SavitzkyGolayFilter(LeafSystem):  # type: ignore[misc, unused-ignore]
    """Smoothed value and derivatives of n joints, from a polynomial through the last N samples.

    Ports:
        in  `signal`             (n,) u, read every dt.
        out `value`              (n,)
        out `first_derivative`   (n,) [1/s]
        out `second_derivative`  (n,) [1/s²]
        out `fault`              (n,) 1 where the last sample was not finite (or none has come yet), else 0.

    Discrete state: the window X (N, n) oldest first, the fault flags c (n,), the started flags b (n,).
    Per joint, every dt:

        s[k]   = u[k] where finite, else X[k]'s newest (the last good sample is held)
        X[k+1] = [X[k] without its oldest; s[k]]        once started
        X[k+1] = [s[k]; ... s[k]]                       at the first finite sample (no bump)
        c[k+1] = 1 where u[k] is not finite, else 0
        y_d[k] = w_d · X[k],   d = 0, 1, 2,  w_d = `savgol_weights(N, order, at, d, dt)`

    Outputs depend on the state only, no feedthrough: a reader just after tick k sees an estimate `delay` old;
    a discrete system of the same period, which reads X[k] during tick k, sees one that is `delay + dt` old.
    Until the first finite sample the outputs are 0 and `fault` is 1. An update costs O(N n); nothing is
    raised in the loop.

    Source: EQUATIONS A1 (paper: N = 80, dt = 1 ms, mid-window, order 2 for encoders, 1 for IMU and F/T).
    """

    def __init__(self, size: int, window: int, order: int, dt: float, at: float | None = None) -> None:
        """Declare ports, state and the periodic update.

        Args:
            size: Joints n.
            window: Samples N.
            order: Order of the polynomial.
            dt: Period of the update [s].
            at: Point of the window, in samples from the oldest; None for the middle.

        Raises:
            ParamsError: As `savgol_weights`, and for a size below 1.
        """
        super().__init__()
        if size < 1:
            raise ParamsError(f"SavitzkyGolayFilter needs at least one joint; got size {size}")
        self._size, self._window = size, window
        self._weights = tuple(savgol_weights(window, order, at, d, dt) for d in range(3))
        self._delay = delay(window, dt, at)
        self._input = self.DeclareVectorInputPort("signal", size)
        self._samples: Any = self.DeclareDiscreteState(window * size)
        all_faulty: Any = np.ones(size)
        self._fault: Any = self.DeclareDiscreteState(all_faulty)
        self._started: Any = self.DeclareDiscreteState(size)
        names = ("value", "first_derivative", "second_derivative")
        on_samples = {self.discrete_state_ticket(self._samples)}
        for name, weights in zip(names, self._weights, strict=True):
            self.DeclareVectorOutputPort(name, size, self._calc(weights), prerequisites_of_calc=on_samples)
        on_fault = {self.discrete_state_ticket(self._fault)}
        self.DeclareVectorOutputPort("fault", size, self._calc_fault, prerequisites_of_calc=on_fault)
        self.DeclarePeriodicDiscreteUpdateEvent(period_sec=dt, offset_sec=0.0, update=self._update)

    @property
    def delay(self) -> float:
        """Age of the estimate just after a tick [s]."""
        return self._delay

    def _calc(self, weights: FloatArray) -> Callable[[Context, Any], None]:
        def calc(context: Context, output: Any) -> None:
            samples = _state(context, self._samples).reshape(self._window, self._size)
            output.SetFromVector(weights @ samples)

        return calc

    def _calc_fault(self, context: Context, output: Any) -> None:
        output.SetFromVector(_state(context, self._fault))

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        u = np.asarray(self._input.Eval(context), dtype=np.float64)
        samples = _state(context, self._samples).reshape(self._window, self._size)
        started = _state(context, self._started) > 0.5
        finite = np.isfinite(u)
        shifted = np.concatenate([samples[1:], np.where(finite, u, samples[-1])[None]])
        first = finite & ~started
        shifted[:, first] = u[first]
        new: Any = discrete_state
        new.set_value(self._samples, shifted.ravel())
        new.set_value(self._fault, np.where(finite, 0.0, 1.0))
        new.set_value(self._started, np.where(finite | started, 1.0, 0.0))


def _state(context: Any, index: Any) -> FloatArray:
    return np.asarray(context.get_discrete_state(index).value(), dtype=np.float64)
