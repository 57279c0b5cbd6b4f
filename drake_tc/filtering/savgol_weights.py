"""Weights of a Savitzky–Golay estimate: a polynomial's value and derivatives by least squares.

Source: Del Prete et al., 2016, section 2.
"""

import numpy as np
from numpy.polynomial import legendre

from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray


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
