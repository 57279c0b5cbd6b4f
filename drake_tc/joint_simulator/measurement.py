"""From clean channels to what a logger writes: sampling, jitter, lost rows, quantisation, noise."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from drake_tc.joint_simulator.physics import CHANNELS, Record
from drake_tc.joint_simulator.reference import LOG_PERIOD, BandNoise, random_walk
from drake_tc.joint_simulator.spec import RUNS, RigSpec, Sensors
from drake_tc.types import BoolArray, FloatArray

GRAVITY = 9.81
WALK_TIME = 30.0  # [s]: after it, a wandering sensor has the standard deviation that its cause states


@dataclass(frozen=True)
class CleanLog:
    """What ideal encoders and torque sensors would log, biases and eccentricities included; every array (T,).

    Attributes:
        time: [s].
        position, velocity, acceleration: Logged side [rad, rad/s, rad/s^2].
        motor_position: [rad].
        command: q_d [rad] or effort.
        effort: y: q_d - position, or the effort.
        torque: Of the sensor, or of the pendulum model that the rig file gives [N m].
        bristle: s in [-1, 1].
        temperature: [deg C].
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    motor_position: FloatArray
    command: FloatArray
    effort: FloatArray
    torque: FloatArray
    bristle: FloatArray
    temperature: FloatArray


def clean_log(record: Record) -> CleanLog:
    """Apply the sensor causes of the rig to its true signals."""
    spec, signal, causes = record.spec, record.channels, record.spec.causes
    q, v, a = signal["position"], signal["velocity"], signal["acceleration"]
    time = np.linspace(0.0, spec.duration, q.size, endpoint=False)
    if "encoder_eccentricity" in causes:
        e, phase = causes["encoder_eccentricity"]["amplitude"], causes["encoder_eccentricity"]["phase"]
        wave, slope = e * np.sin(q + phase), e * np.cos(q + phase)
        q, v, a = q + wave, v * (1.0 + slope), a * (1.0 + slope) - wave * v * v
    if "encoder_offset" in causes:
        q = q + causes["encoder_offset"]["offset"]
    servo = spec.joint.drive == "position_servo"
    effort = signal["command"] - q if servo else signal["command"]
    if spec.pendulum is not None:
        mass, length = spec.pendulum
        torque = mass * length * (length * a + GRAVITY * np.sin(q))
    else:
        torque = _sensor_torque(record, time)
    motor = signal["motor_position"]
    return CleanLog(time, q, v, a, motor, signal["command"], effort, torque, signal["bristle"], signal["temperature"])


def _sensor_torque(record: Record, time: FloatArray) -> FloatArray:
    signal, causes = record.channels, record.spec.causes
    torque = signal["torque"]
    if "payload" in causes:
        mass, arm = causes["payload"]["mass"], causes["payload"]["arm"]
        carried = mass * arm * (arm * signal["acceleration"] + GRAVITY * np.sin(signal["position"]))
        torque = torque - carried
    if "torque_sensor_gain" in causes:
        torque = torque * (1.0 + causes["torque_sensor_gain"]["error"])
    if "torque_sensor_bias" in causes:
        torque = torque + causes["torque_sensor_bias"]["bias"]
    if "torque_sensor_drift" in causes:
        torque = torque + causes["torque_sensor_drift"]["rate"] * time
    if "wandering_sensor" in causes:
        wander = causes["wandering_sensor"]
        seed = [int(wander["noise_seed"]), RUNS.index(record.run)]
        torque = torque + wander["walk"] * random_walk(time, record.spec.duration, seed) / np.sqrt(WALK_TIME)
    return np.asarray(torque)


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
