"""A tick of the chain from a foot whose centre is taken to stand still, see `drake_tc.estimation.base_estimator`."""

import math
from typing import Any

import numpy as np

from drake_tc.kernels.base import state as base_state
from drake_tc.kernels.base.attitude import attitude, up_of
from drake_tc.kernels.base.sample import (
    ESTIMATOR,
    SAMPLE,
    Estimator,
    Posture,
    Sample,
    external_wrench,
    options_of,
    posture_of,
    valid_sample,
)
from drake_tc.kernels.base.state import ON, QUIET, RESTED, STARTED, YAW, Memory
from drake_tc.kernels.compiling import FLAG, OUT_VECTOR, VECTOR, helper, kernel
from drake_tc.kernels.linear_algebra import cross, dot, levelled, product, times, times_transposed, turned
from drake_tc.types import GRAVITY, FloatArray

_memory_of = helper(base_state.memory_of)


@helper
def first_up(sample: Sample, R_BI: FloatArray) -> FloatArray:
    """(3,) the vertical in B where the robot starts: by the IMU's roll and pitch, or by the accelerometer."""
    roll, pitch = sample.tilt[0], sample.tilt[1]
    if np.isfinite(roll) and np.isfinite(pitch):
        return times(R_BI, up_of(roll, pitch))
    return times(R_BI, sample.accel / max(math.sqrt(dot(sample.accel, sample.accel)), 1e-9))


@helper
def fixed_foot(
    memory: Memory, sensed: tuple[Sample, FloatArray], postures: tuple[Posture, Posture], between: FloatArray
) -> int:
    """The most loaded contact; where it is another one than before, `memory` has it stand where it is.

    Args:
        memory: Of the tick before; updated.
        sensed: Readings after validation; (k,) below zero where a contact is held off.
        postures: Contacts against the base, now and in the tick before.
        between: (k, 54) what stands between sensor and contact.
    """
    (sample, switch), (posture, last) = sensed, postures
    foot, most = 0, -math.inf
    for i in range(switch.size):
        up = times_transposed(posture.rotation[i], memory.rotation[2])
        load = external_wrench(between[i], sample.wrench[6 * i : 6 * i + 6], -GRAVITY * up)[2]
        if not switch[i] < 0.0 and load > most:
            foot, most = i, load
    if not memory.contacts[foot, ON] or not memory.scalars[STARTED]:
        memory.contacts[:] = 0.0
        memory.contacts[foot, ON] = 1.0
        for i in range(switch.size):
            memory.foot[i] = product(memory.rotation, last.rotation[i])
            memory.held[i] = memory.position + times(memory.rotation, last.position[i])
    return foot


@kernel(VECTOR, SAMPLE, ESTIMATOR, FLAG, OUT_VECTOR)
def tick(
    state: FloatArray, readings: tuple[FloatArray, ...], estimator: tuple[Any, ...], by_imu: bool, out: FloatArray
) -> None:
    """The state after one sample.

    Args:
        state: (s,) before it, see `base.state`.
        readings: See `SAMPLE`.
        estimator: See `Estimator`.
        by_imu: Whether roll, pitch and angular velocity are the IMU's.
        out: (s,) the state after it; written.
    """
    out[:] = state
    own, switch, tree = Estimator(*estimator), readings[5], estimator[4:]
    options, memory = options_of(own.settings), _memory_of(out, readings[0].size, switch.size)
    sample = valid_sample(readings, memory, options)
    posture = posture_of(sample.q, sample.qd, tree)
    last = posture
    if memory.scalars[STARTED]:
        last = posture_of(memory.q, memory.qd, tree)
    else:
        memory.rotation[:] = product(turned(memory.scalars[YAW]), levelled(first_up(sample, posture.rotation[-1])))
    foot = fixed_foot(memory, (sample, switch), (posture, last), own.between)
    rotation, rate = product(memory.foot[foot], posture.rotation[foot].T), -posture.rate[foot]
    if by_imu and sample.has_gyro:
        pose = attitude(posture, memory, sample, options, np.zeros(3))
        rotation, rate = product(turned(math.atan2(rotation[1, 0], rotation[0, 0])), pose.level), pose.rate
        memory.bias[:], memory.trail[:] = pose.bias, pose.trail
        memory.scalars[RESTED], memory.scalars[QUIET] = pose.rested, pose.quiet
    memory.scalars[STARTED], memory.scalars[YAW] = 1.0, math.atan2(rotation[1, 0], rotation[0, 0])
    memory.position[:] = memory.held[foot] - times(rotation, posture.position[foot])
    memory.velocity[:] = -(posture.velocity[foot] + cross(rate, posture.position[foot]))
    memory.rotation[:], memory.rate[:] = rotation, rate
    memory.q[:], memory.qd[:], memory.doubt[:] = sample.q, sample.qd, sample.doubt
    memory.flags[:] = 0.0
