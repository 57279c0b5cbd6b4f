"""What no check of sensors can tell within a given time, whatever its rule: bounds to hold a check's delay against.

A gyro beside feet that turn: over N samples of period h, the yaw angle of the feet by kinematics minus the integral of
the gyro is

    y_k = c + b t_k + A cos(w t_k) + B sin(w t_k) + e_k,    e white with deviation s

where b is the gyro's bias and the sinusoid the turning of the feet themselves on soft soles, of unknown amplitude and
phase. With X the (N, 4) matrix of these columns, no unbiased estimate of b has a smaller deviation than (Cramér-Rao)

    s sqrt([(X'X)^-1]_bb)

A foot beside one whose load is not known: a sole of stiffness K under a load F gives way by F/K, and rises by as much
when the load goes over to other contacts. A rise below dF/K of a foot whose load is known within dF is therefore either
the loss of the contact or a shift of load.
"""

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray


def bias_deviation(duration: float, period: float, noise: float, turning_hz: float = 0.0) -> float:
    """Least standard deviation of an unbiased estimate of a gyro's bias beside feet that may turn [rad/s].

    Args:
        duration: Of the window [s].
        period: Of the samples [s].
        noise: Standard deviation s of a sample of the angle [rad].
        turning_hz: w/(2 pi), frequency at which the feet may turn [Hz]; 0: they stand.

    Raises:
        ParamsError: fewer samples than unknowns, or a number that is not positive.
    """
    if not (duration > 0.0 and period > 0.0 and noise > 0.0 and turning_hz >= 0.0):
        raise ParamsError(
            "bias_deviation: expected duration, period and noise > 0 and turning_hz >= 0,"
            f" got {duration:g}, {period:g}, {noise:g} and {turning_hz:g}"
        )
    count = round(duration / period) + 1
    half = 0.5 * (count - 1) * period
    t = np.linspace(-half, half, count)
    w = 2.0 * np.pi * turning_hz
    others = np.stack([np.ones(count), np.cos(w * t), np.sin(w * t)] if w else [np.ones(count)], axis=1)
    if count <= others.shape[1] + 1:
        raise ParamsError(f"bias_deviation: expected at least {others.shape[1] + 2} samples, got {count}")
    # [(X'X)^-1]_bb is one over the square of what the other columns leave of the column t
    basis = np.linalg.qr(others / np.linalg.norm(others, axis=0))[0]
    rest = t - basis @ (basis.T @ t)
    rest -= basis @ (basis.T @ rest)  # once more, for rounding
    return float(noise / np.linalg.norm(rest))


def bias_resolved_after(
    bias: float, period: float, noise: float, turning_hz: float = 0.0, *, deviations: float = 3.0, longest: float = 10.0
) -> float:
    """Shortest window in which a bias exceeds so many least standard deviations [s]; infinite beyond `longest`.

    Args:
        bias: |b| [rad/s].
        period: Of the samples [s].
        noise: Standard deviation of a sample of the angle [rad].
        turning_hz: Frequency at which the feet may turn [Hz]; 0: they stand.
        deviations: By which a check must exceed the noise so that it hardly ever gives a false alarm [-].
        longest: Window up to which is looked [s].
    """
    for count in range(6, round(longest / period) + 1):
        if deviations * bias_deviation(count * period, period, noise, turning_hz) <= bias:
            return count * period
    return float("inf")


def recoil(load: float, stiffness: float) -> float:
    """How far a sole rises as it gives up a load, F/K [m].

    Args:
        load: dF [N], within which the load is not known.
        stiffness: K of the sole [N/m].
    """
    return load / stiffness


def rise_resolved_after(time: FloatArray, rise: FloatArray, load: float, stiffness: float, delay: float = 0.0) -> float:
    """From when on the rise of a foot exceeds what a shift of load can cause [s]; infinite where it never does.

    Args:
        time: (T,) since the command to lift the foot [s].
        rise: (T,) commanded rise of the foot [m]; a foot that follows late rises later still.
        load: Within which the load on the foot is not known [N].
        stiffness: Of its sole [N/m].
        delay: From the command to the drives [s].
    """
    beyond = np.flatnonzero(rise > recoil(load, stiffness))
    return float(time[beyond[0]]) + delay if beyond.size else float("inf")
