"""The held-out error of someone who knows the true cause: the bar that a diagnosis is measured against.

He fits, by least squares on the training runs' measured signals,

    y = k1 (tau + J_declared a + u) + k2 v + k3 s

with u the true unmodelled torque and s the true bristle state, and his error is the RMS of y minus the fit on the
held-out run's motion-resolved samples (|v| > 5 times its resolution, no lost rows near), in effort units. u and s
enter noise-free; everything measured enters as the files have it, so the error is what sensors and smoothing
leave. All channels pass one Gaussian with the -3 dB frequency of a quadratic Savitzky-Golay window of 20 ms
(53 Hz), derivatives being central differences after it; it is wider only where the encoder is too coarse for the
acceleration, whose noise is kept below 5 % of its spread.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter1d

from drake_tc.joint_simulator.measurement import COMMAND_COLUMN, GRAVITY
from drake_tc.joint_simulator.spec import HELD_OUT, RigSpec
from drake_tc.types import FloatArray

SIGMA_OF_20_MS = 2.5e-3  # [s]: exp(-(2 pi 53 Hz sigma)^2/2) = 1/sqrt(2)
LEAST_RESOLUTION = 1e-3  # [rad/s]


def oracle_errors(
    spec: RigSpec, files: Mapping[str, pd.DataFrame], truths: Mapping[str, pd.DataFrame]
) -> dict[str, float]:
    """RMS errors in effort units: `heldout` of the oracle and `heldout_declared` of the declared model (u left out).

    Args:
        spec: The rig.
        files: Run to the measured table.
        truths: Run to the clean table with the same rows.
    """
    sigma = smoothing(spec, files["sine"])
    parts = {run: _signals(spec, files[run], truths[run], sigma) for run in files}
    train = np.concatenate([parts[run] for run in files if run != HELD_OUT])
    held = parts[HELD_OUT]
    return {
        "heldout": _heldout_error(train, held, with_unmodelled=1.0),
        "heldout_declared": _heldout_error(train, held, with_unmodelled=0.0),
        "smoothing_sigma": sigma,
    }


def smoothing(spec: RigSpec, table: pd.DataFrame) -> float:
    """Width sigma of the Gaussian [s]: 2.5 ms (at least 1.2 periods), times sqrt(2) until acceleration is clear.

    Encoder steps of size d, white with e = d/sqrt(12), reach the acceleration as e sqrt(3 h/(8 sqrt(pi) sigma^5)).
    """
    period = 1.0 / spec.sensors.rate_hz
    sigma = max(SIGMA_OF_20_MS, 1.2 * period)
    position = table["joint/position"].to_numpy()
    while sigma < 0.03:
        noise = spec.sensors.encoder_step * np.sqrt(period / (32.0 * np.sqrt(np.pi) * sigma**5))
        if noise < 0.05 * np.std(differences(gaussian_filter1d(position, sigma / period), 2, period)):
            break
        sigma *= np.sqrt(2.0)
    return float(sigma)


def differences(values: FloatArray, order: int, period: float) -> FloatArray:
    """The values, or their first or second derivative by central differences (T,)."""
    padded = np.pad(values, 1, mode="edge")
    if order == 1:
        return np.asarray((padded[2:] - padded[:-2]) / (2.0 * period))
    if order == 2:
        return np.asarray((padded[2:] - 2.0 * values + padded[:-2]) / period**2)
    return values


def velocity_resolution(spec: RigSpec, sigma: float) -> float:
    """RMS error of the smoothed velocity from encoder steps, e sqrt(h/(4 sqrt(pi) sigma^3)), at least 1e-3 rad/s."""
    error = spec.sensors.encoder_step / np.sqrt(12.0)
    noise = error * np.sqrt(1.0 / (spec.sensors.rate_hz * 4.0 * np.sqrt(np.pi) * sigma**3))
    return float(max(noise, LEAST_RESOLUTION))


def _heldout_error(train: FloatArray, held: FloatArray, *, with_unmodelled: float) -> float:
    """RMS of the held-out run; columns of both (T, 5): y, tau + J a, v, s, u."""

    def design(part: FloatArray) -> FloatArray:
        return np.column_stack([part[:, 1] + with_unmodelled * part[:, 4], part[:, 2], part[:, 3]])

    solution = np.linalg.lstsq(design(train), train[:, 0], rcond=None)[0]
    return float(np.sqrt(np.mean((held[:, 0] - design(held) @ solution) ** 2)))


def _signals(spec: RigSpec, table: pd.DataFrame, truth: pd.DataFrame, sigma: float) -> FloatArray:
    """y, tau + J a, v, s, u (T, 5) of one run on its motion-resolved samples, all through one kernel."""
    time = table["time"].to_numpy()
    period = 1.0 / spec.sensors.rate_hz
    grid = np.arange(time[0], time[-1], period)

    def smooth(values: FloatArray, order: int = 0) -> FloatArray:
        return differences(gaussian_filter1d(np.interp(grid, time, values), sigma / period), order, period)

    position = table["joint/position"].to_numpy()
    velocity, acceleration = smooth(position, 1), smooth(position, 2)
    command = smooth(table[f"joint/{COMMAND_COLUMN[spec.joint.drive]}"].to_numpy())
    effort = command - smooth(position) if spec.joint.drive == "position_servo" else command
    if spec.pendulum is None:
        torque = smooth(table["joint/torque"].to_numpy())
    else:
        mass, length = spec.pendulum
        torque = mass * length * (length * acceleration + GRAVITY * smooth(np.sin(position)))
    balance = torque + spec.declared_inertia * acceleration
    known = smooth(truth["bristle"].to_numpy()), smooth(truth["unmodelled"].to_numpy())
    rows = np.abs(velocity) > 5.0 * velocity_resolution(spec, sigma)
    edge = int(np.ceil(4.0 * sigma / period))
    rows[:edge] = rows[-edge:] = False
    for gap in np.flatnonzero(np.diff(time) > 2.5 * period):
        rows[(grid > time[gap] - edge * period) & (grid < time[gap + 1] + edge * period)] = False
    return np.column_stack([effort, balance, velocity, *known])[rows]
