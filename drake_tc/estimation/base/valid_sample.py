"""Validation of one sample: missing readings and encoder spikes are replaced by the previous estimate, and flagged."""

import math
from typing import NamedTuple

import numpy as np

from drake_tc.estimation.base.spec import BaseEstimatorSpec
from drake_tc.estimation.base.state import FLAGS, BaseState, Readings
from drake_tc.types import BoolArray, FloatArray

LARGEST = 1e6
"""No reading in SI units is as large; one that is counts as missing."""
_SPIKE = FLAGS.index("encoder_spike")
_FORGET = 0.05
"""In which a speed that is no longer measured dies away [s]."""
_PATIENCE = 5
"""Ticks after which a step of an encoder that persists is taken as real."""


class ValidSample(NamedTuple):
    """A sample without gaps: the fields of `Readings`, and flags of what was replaced.

    Attributes:
        q, qd, gyro, accel, tilt, wrench: As in `Readings`; `tilt` may be NaN, the others are finite.
        doubt: (n,) ticks for which each encoder has been rejected.
        has_gyro, has_accel: Whether gyro and accelerometer have readings.
        encoder_missing, encoder_spike, imu_missing, wrench_missing: What was wrong.
    """

    q: FloatArray
    qd: FloatArray
    gyro: FloatArray
    accel: FloatArray
    tilt: FloatArray
    wrench: FloatArray
    doubt: FloatArray
    has_gyro: bool
    has_accel: bool
    encoder_missing: bool
    encoder_spike: bool
    imu_missing: bool
    wrench_missing: bool


def _is_finite(values: FloatArray) -> bool:
    return bool(np.abs(values).max(initial=0.0) < LARGEST)


def _jumps(q: FloatArray, state: BaseState, spec: BaseEstimatorSpec) -> BoolArray:
    """(n,) where an encoder steps by more than its speed explains."""
    step: BoolArray = np.abs(q - state.q) > spec.encoder_spike + 2.0 * spec.period * (1.0 + np.abs(state.qd))
    return step


def valid_sample(readings: Readings, state: BaseState, spec: BaseEstimatorSpec) -> ValidSample:
    """The sample without gaps.

    Missing encoders move on at their speed, or at their last one, which dies away; a missing gyro reads its bias, a
    missing wrench nothing. An encoder that jumps by more than `encoder_spike` and twice what its speed explains
    is rejected for five ticks, and so is its speed, also in the tick after it.
    """
    q, qd, doubt = readings.q, readings.qd, state.doubt
    dt, first = spec.period, not state.started
    step, gyro, accel, wrench = q - state.q, readings.gyro, readings.accel, readings.wrench
    size = q @ q + qd @ qd + gyro @ gyro + accel @ accel + np.vdot(wrench, wrench)
    if size < LARGEST**2 and not first and not state.flags[_SPIKE] and step @ step < spec.encoder_spike**2:
        return ValidSample(
            q,
            qd,
            readings.gyro,
            readings.accel,
            readings.tilt,
            readings.wrench,
            doubt,
            True,
            True,
            False,
            False,
            False,
            False,
        )
    whole = _is_finite(q) and _is_finite(qd)
    spike = False
    if not whole:
        good, moving = np.abs(q) < LARGEST, np.abs(qd) < LARGEST
        qd = np.where(moving, qd, math.exp(-dt / _FORGET) * state.qd)
        q = np.where(good, q, state.q + dt * np.where(good, 0.0, qd))
    if not first:
        jump = _jumps(q, state, spec)
        if jump.any() or doubt.any():
            jump &= doubt < _PATIENCE
            after = jump | ((doubt > 0.0) & (doubt < _PATIENCE))
            spike = bool(after.any())
            q = np.where(jump, state.q, q)
            qd = np.where(after, state.qd, qd)
            doubt = np.where(jump, doubt + 1.0, 0.0)
    has_gyro, has_accel = _is_finite(readings.gyro), _is_finite(readings.accel)
    wrench_missing = not _is_finite(readings.wrench)
    return ValidSample(
        q=q,
        qd=qd,
        gyro=readings.gyro if has_gyro else state.bias,
        accel=readings.accel if has_accel else np.zeros(3),
        tilt=readings.tilt,
        wrench=np.where(np.abs(readings.wrench) < LARGEST, readings.wrench, 0.0) if wrench_missing else readings.wrench,
        doubt=doubt,
        has_gyro=has_gyro,
        has_accel=has_accel,
        encoder_missing=not whole,
        encoder_spike=spike,
        imu_missing=not (has_gyro and has_accel),
        wrench_missing=wrench_missing,
    )
