"""The truth signal: what the declared model leaves unexplained in noise-free channels, in newton metres.

    u = y/K - (tau + J_declared a + B v + C s)

with y, tau, a, v as the rig's sensors would give them without noise, K, B, C the true constants and s the true
bristle state. One formula for every cause, of mechanics, drive or sensor: whatever it is, u is what it does.
"""

from dataclasses import dataclass

import numpy as np

from drake_tc.joint_simulator.physics import Record
from drake_tc.joint_simulator.reference import random_walk
from drake_tc.joint_simulator.spec import RUNS
from drake_tc.types import BoolArray, FloatArray

GRAVITY = 9.81
WALK_TIME = 30.0  # [s]: after it, a wandering sensor has the standard deviation that its cause states
MOVING_SPEED = 0.02  # [rad/s]: below it, strength is not measured


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


def unmodelled_torque(record: Record, log: CleanLog) -> FloatArray:
    """U of the module's equation, (T,) [N m]."""
    joint = record.spec.joint
    modelled = log.torque + record.spec.declared_inertia * log.acceleration
    modelled = modelled + joint.damping * log.velocity + joint.coulomb * log.bristle
    return np.asarray(log.effort / joint.gain - modelled)


def beyond_refit(records: list[Record]) -> float:
    """RMS [N m] of u over moving samples, after refitting gain, viscous and Coulomb in all the runs together.

    The refit is the projection onto [tau + J a, v, s]: a joint whose K, B, C were wrong could not be told from it.
    """
    columns, targets = [], []
    for record in records:
        log = clean_log(record)
        moving: BoolArray = np.abs(log.velocity) > MOVING_SPEED
        unknown = unmodelled_torque(record, log)
        known = log.torque + record.spec.declared_inertia * log.acceleration
        columns.append(np.stack([known, log.velocity, log.bristle], axis=1)[moving])
        targets.append(unknown[moving])
    design, target = np.concatenate(columns), np.concatenate(targets)
    solution = np.linalg.lstsq(design, target, rcond=None)[0]
    return float(np.sqrt(np.mean((target - design @ solution) ** 2)))
