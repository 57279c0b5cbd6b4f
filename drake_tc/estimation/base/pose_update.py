"""The pose update of a tick: base position and yaw, and what the contacts hold from now on."""

import math
from typing import NamedTuple

import numpy as np

from drake_tc.estimation.base.attitude import Attitude
from drake_tc.estimation.base.imu_filters import filter_times
from drake_tc.estimation.base.kinematics import Posture
from drake_tc.estimation.base.pose import solve_position, solve_yaw, turned
from drake_tc.estimation.base.sinking import Sinking
from drake_tc.estimation.base.state import CONTACT_MEMORY, BaseState
from drake_tc.estimation.base.velocity_update import Loads, Motion, Setting
from drake_tc.types import FloatArray

_LEAST_ARM = 0.05
"""Distance of contacts from their middle below which their direction says less about yaw [m]."""
_YOUNG = 0.1
"""For so long a new reference is averaged, where it disagrees with the others: one tick's encoders are noisy [s]."""
_START = 0.2
"""What the first yaw counts for, in time on two contacts [s]."""
_HELD_FOR = CONTACT_MEMORY.index("held_for")


class Place(NamedTuple):
    """Result of the pose update.

    Attributes:
        position: (3,) [m]. yaw: [rad]. rotation: (3, 3) R_WB.
        held: (k, 3) references [m]. held_for: k ticks since each was taken. ground: Height of a level ground [m].
        bias: What the contacts add to the gyro's bias about the vertical, negative [rad/s]. paired: Of `BaseState`.
        inconsistent: Whether the references were taken anew.
    """

    position: FloatArray
    yaw: float
    rotation: FloatArray
    held: FloatArray
    held_for: list[float]
    ground: float
    bias: float
    paired: float
    inconsistent: bool


def find_place(
    setting: Setting,
    state: BaseState,
    posture: Posture,
    pose: Attitude,
    loads: Loads,
    motion: Motion,
    sunk: Sinking | None,
) -> Place:
    """Position and yaw; contacts that do not count, and new ones, take their reference from them.

    Args:
        setting: Worked out once.
        state: Before the tick.
        posture: Contacts against the base.
        pose: Orientation.
        loads: What the contacts carry.
        motion: Of stage 1.
        sunk: How soft soles give way; None: they are rigid.
    """
    spec, dt = setting.spec, setting.spec.period
    level, R = pose.level, posture.rotation[:-1]
    held = state.held + (state.foot[:, :, :2] @ (motion.pressure - state.pressure)[:, :, None])[:, :, 0]
    if sunk is not None:
        held += state.foot[:, :, 2] * sunk.back[:, None]
    if setting.level:
        held[setting.at, 2] = state.held[setting.at, 2]
    weight = motion.weight
    if any(loads.new):
        weight = np.where(loads.new, 0.0, weight)
    weights = weight.tolist()
    known = sum(weights)
    arm = (posture.position[:-1] + (R[:, :, :2] @ motion.pressure[:, :, None])[:, :, 0]) @ level.T
    told = state.yaw + pose.turn
    yaw_time, yaw_bias_time = spec.yaw_time, spec.yaw_bias_time
    if spec.quick_start:
        yaw_time, yaw_bias_time = filter_times(_START + state.paired * dt, yaw_time, yaw_bias_time)
    yaw, apart = solve_yaw(arm, held, weight, told, yaw_time / dt, _LEAST_ARM)
    astray = abs(apart) > spec.slip_turn
    yaw = math.remainder(told if astray else yaw, math.tau)
    heading = turned(yaw)
    rotation = heading @ level
    spun = arm @ heading.T
    position = state.position
    if state.started:
        position = position + 0.5 * dt * (state.rotation @ state.velocity + rotation @ motion.velocity)
    gap = None
    if known > 0.0 and not astray:
        position, gap = solve_position(spun, held, weight / known, position, spec.position_time / dt)
        limit = spec.slip_distance**2
        far = zip(gap.tolist(), weights, strict=True)
        astray = any(w > 0.0 and x * x + y * y + z * z > limit for (x, y, z), w in far)
    adapt = min(1.0, dt / spec.anchor_time)
    held_for = state.contacts[:, _HELD_FOR].tolist()
    ground = state.ground
    if gap is not None and not astray and all(weights):
        held = held - adapt * gap  # the usual tick: every contact is known, and near its reference
        if spec.quick_start and min(held_for) * dt < _YOUNG and len(weights) > 1:
            apart = gap - weight @ gap / known
            held = held - np.array([[1.0 / (n + 2.0) if n * dt < _YOUNG else 0.0] for n in held_for]) * apart
        if setting.level:
            held[setting.at, 2] = ground
    else:
        here = position + spun
        if setting.level:
            ground = _ground(ground, here, motion.weight * setting.flat)
            if ground == ground:
                here[setting.at, 2] = ground
        share = np.array([[adapt if w > 0.0 and not astray else 1.0] for w in weights])
        held = held + share * (here - held)
        held_for = [n if s < 1.0 else -1.0 for n, s in zip(held_for, share[:, 0].tolist(), strict=True)]
    correction = math.remainder(yaw - told, math.tau)
    age = [n + 1.0 for n in held_for]
    paired = state.paired + float(correction != 0.0)
    return Place(position, yaw, rotation, held, age, ground, correction / yaw_bias_time, paired, astray)


def _ground(ground: float, here: FloatArray, weight: FloatArray) -> float:
    """Height of a level ground [m]: where the first loaded soles are; NaN as long as there is none."""
    total = float(weight.sum())
    if ground == ground or not total > 0.0:
        return ground
    return float(weight @ here[:, 2]) / total
