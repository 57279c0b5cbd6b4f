"""From clean channels to what a logger writes: sampling, jitter, lost rows, quantisation, noise."""

import numpy as np
import pandas as pd

from drake_tc.joint_simulator.balance import CleanLog
from drake_tc.joint_simulator.physics import CHANNELS
from drake_tc.joint_simulator.reference import LOG_PERIOD, BandNoise
from drake_tc.joint_simulator.spec import RigSpec, Sensors
from drake_tc.types import BoolArray, FloatArray

CLEAN_COLUMNS = tuple(name for name in CHANNELS if name != "motor_velocity")
COMMAND_COLUMN = {"position_servo": "position_command", "current": "current", "voltage": "voltage"}


def sample_clean(log: CleanLog, unmodelled: FloatArray, sensors: Sensors, rng: np.random.Generator) -> pd.DataFrame:
    """The clean channels at the logger's instants, and the truth signal `unmodelled` beside them.

    Args:
        log: (T,) at 1 kHz.
        unmodelled: (T,) [N m].
        sensors: Rate, jitter, lost rows.
        rng: Of this run's sensors.

    Returns:
        One row a written row; columns `time`, `CLEAN_COLUMNS`, `unmodelled`.
    """
    every = round(1.0 / (LOG_PERIOD * sensors.rate_hz))
    time = log.time[::every]
    if sensors.jitter > 0.0:
        shift = rng.uniform(-sensors.jitter, sensors.jitter, time.size) * every * LOG_PERIOD
        time = np.clip(time + shift, log.time[0], log.time[-1])
    time = time[_kept_rows(time.size, sensors.lost, rng)]
    table = {"time": time}
    for name in CLEAN_COLUMNS:
        table[name] = np.interp(time, log.time, getattr(log, name))
    table["unmodelled"] = np.interp(time, log.time, unmodelled)
    return pd.DataFrame(table)


def measured(clean: pd.DataFrame, spec: RigSpec, rng: np.random.Generator) -> pd.DataFrame:
    """The file's columns from the clean ones: canonical names, quantised and noisy."""
    sensors, n = spec.sensors, len(clean)
    time = clean["time"].to_numpy()
    position = clean["position"].to_numpy() + _band_noise(time, sensors.position_band, sensors, rng)
    command = clean["command"].to_numpy() + _band_noise(time, sensors.command_band, sensors, rng)
    table = {"time": np.round(time, 6), "joint/position": _quantised(position, sensors.encoder_step)}
    if spec.motor_position:
        table["joint/motor_position"] = _quantised(clean["motor_position"].to_numpy(), sensors.encoder_step)
    table[f"joint/{COMMAND_COLUMN[spec.joint.drive]}"] = np.round(command, 9)
    if spec.pendulum is None:
        table["joint/torque"] = np.round(_sensor_reading(clean["torque"].to_numpy(), time, sensors, rng), 6)
    heat = clean["temperature"].to_numpy() + rng.normal(0.0, sensors.temperature_noise, n)
    table["joint/temperature"] = np.round(heat + sensors.temperature_drift * time / 30.0, 2)
    return pd.DataFrame(table)


def _sensor_reading(torque: FloatArray, time: FloatArray, sensors: Sensors, rng: np.random.Generator) -> FloatArray:
    """What the torque sensor reads (T,) [N m]: gain and bias, noise, a random walk, noise in a band."""
    noise = coloured_noise(time, sensors.torque_noise, sensors.torque_noise_time, rng)
    steps = np.sqrt(np.diff(time, prepend=time[0]))
    walk = np.cumsum(rng.standard_normal(time.size) * steps) * sensors.torque_walk / np.sqrt(30.0)
    band = _band_noise(time, sensors.torque_band, sensors, rng)
    return np.asarray((1.0 + sensors.torque_gain) * torque + sensors.torque_bias + noise + walk + band)


def _band_noise(time: FloatArray, rms: float, sensors: Sensors, rng: np.random.Generator) -> FloatArray:
    """Noise (T,) of the given RMS between the limits of `band_hz`; nothing is drawn where the RMS is zero."""
    if rms <= 0.0:
        return np.zeros(time.size)
    return rms * BandNoise.draw([[int(rng.integers(2**31))]], *sensors.band_hz).over(time)


def coloured_noise(time: FloatArray, rms: float, correlation: float, rng: np.random.Generator) -> FloatArray:
    """Noise (T,) of the given RMS: white, or first-order with autocorrelation exp(-dt/correlation)."""
    white = rng.standard_normal(time.size)
    if correlation <= 0.0:
        return np.asarray(rms * white)
    keep = np.exp(-np.diff(time, prepend=time[0]) / correlation)
    noise = np.empty_like(white)
    last = white[0]
    for i in range(white.size):
        last = keep[i] * last + np.sqrt(1.0 - keep[i] ** 2) * white[i]
        noise[i] = last
    return np.asarray(rms * noise)


def _quantised(position: FloatArray, step: float) -> FloatArray:
    return np.asarray(np.round(np.round(position / step) * step, 9))


def _kept_rows(count: int, lost: float, rng: np.random.Generator) -> BoolArray:
    """(count,) booleans: half of the losses are single rows, half are bursts of about 20 rows."""
    kept = np.ones(count, dtype=bool)
    if lost > 0.0:
        kept &= rng.random(count) > lost / 2
        for start in rng.integers(0, count, max(1, round(lost / 2 * count / 20))):
            kept[start : start + int(rng.integers(5, 36))] = False
        kept[[0, -1]] = True
    return kept
