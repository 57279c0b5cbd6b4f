"""Stage 2 of a tick: base position and yaw, and what the contacts hold from now on."""

import math
from dataclasses import dataclass

import numpy as np

from drake_tc.estimation.base.attitude import Attitude
from drake_tc.estimation.base.kinematics import Posture
from drake_tc.estimation.base.pose import solve_position, solve_yaw, turned
from drake_tc.estimation.base.stage_one import Loads, Motion, Setting
from drake_tc.estimation.base.state import BaseState
from drake_tc.types import FloatArray

_LEAST_ARM = 0.05
"""Distance of contacts from their middle below which their direction says less about yaw [m]."""


@dataclass(frozen=True, eq=False)
class Place:
    """What stage 2 finds.

    Attributes:
        position: (3,) [m]. yaw: [rad]. rotation: (3, 3) R_WB.
        held: (k, 3) references [m]. ground: Height of a level ground [m].
        correction: How much of the yaw the contacts asked for against the gyro [rad].
        inconsistent: Whether the references were taken anew.
    """

    position: FloatArray
    yaw: float
    rotation: FloatArray
    held: FloatArray
    ground: float
    correction: float
    inconsistent: bool


def find_place(
    setting: Setting, state: BaseState, posture: Posture, pose: Attitude, loads: Loads, motion: Motion
) -> Place:
    """Position and yaw; contacts that do not count, and new ones, take their reference from them.

    Args:
        setting: Worked out once.
        state: Before the tick.
        posture: Contacts against the base.
        pose: Orientation.
        loads: What the contacts carry.
        motion: Of stage 1.
    """
    spec, dt = setting.spec, setting.spec.period
    level, R = pose.level, posture.rotation[:-1]
    held = state.held + (state.foot[:, :, :2] @ (motion.pressure - state.pressure)[:, :, None])[:, :, 0]
    if setting.level:
        held[setting.at, 2] = state.held[setting.at, 2]
    weight = motion.weight
    if any(loads.new):
        weight = np.where(loads.new, 0.0, weight)
    weights = weight.tolist()
    known = sum(weights)
    arm = (posture.position[:-1] + (R[:, :, :2] @ motion.pressure[:, :, None])[:, :, 0]) @ level.T
    told, trust = state.yaw + pose.turn, spec.yaw_time / dt
    yaw, apart = solve_yaw(arm, held, weight, told, trust, _LEAST_ARM)
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
    ground = state.ground
    if gap is not None and not astray and all(weights):
        held = held - adapt * gap  # the usual tick: every contact is known, and near its reference
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
    correction = math.remainder(yaw - told, math.tau)
    return Place(position, yaw, rotation, held, ground, correction, astray)


def _ground(ground: float, here: FloatArray, weight: FloatArray) -> float:
    """Height of a level ground [m]: where the first loaded soles are; NaN as long as there is none."""
    total = float(weight.sum())
    if ground == ground or not total > 0.0:
        return ground
    return float(weight @ here[:, 2]) / total
