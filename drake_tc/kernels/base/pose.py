"""Stage 2: base position and yaw, with the centres of pressure held still in the world.

Source: Faraji et al., 2015, eq. 9 to 12.

With a_i = R' x_i^b the centre of pressure from the base, in the world's axes but for the yaw D, p_i where it is held,
and W_i weights:

    min over x, D:  sum_i W_i |x + R_z(D) a_i - p_i|^2 + W_0 |x - x_pred|^2 - 2 Q cos(D - D_ref)

For given D, x is the weighted mean; for the contacts alone what is left of the cost is -2 (A cos D + B sin D) with

    A = sum W_i (a~_i . p~_i)_xy + Q cos D_ref
    B = sum W_i (a~_i x p~_i)_z + Q sin D_ref,   D = atan2(B, A)

(~: less the weighted mean), the one of two roots that is the minimum, and the nearer to D_ref. D may be the whole yaw
or, with a_i turned by the last one, its increment. Ours differs from the paper's in one thing: the prediction x_pred
takes no part in the yaw. The arm between it and a single contact would turn errors of the velocity into yaw, which the
gyro knows better.

`outputs` is what the estimator shows of its state.
"""

import math
from typing import NamedTuple

import numpy as np

from drake_tc.kernels.base import state as base_state
from drake_tc.kernels.base.attitude import Attitude, filter_times
from drake_tc.kernels.base.contacts import Stance
from drake_tc.kernels.base.sample import FLAT, Given
from drake_tc.kernels.base.state import GROUND, HELD_FOR, PAIRED, STARTED, YAW
from drake_tc.kernels.base.velocity import Motion
from drake_tc.kernels.compiling import INDEX, OUT_VECTOR, VECTOR, WHOLE, helper, kernel
from drake_tc.kernels.linear_algebra import product, remainder, times, turned, wxyz_into
from drake_tc.types import FloatArray, IntArray

_LEAST_ARM = 0.05
"""Distance of contacts from their middle below which their direction says less about yaw [m]."""
_YOUNG = 0.1
"""For so long a new reference is averaged, where it disagrees with the others: one tick's encoders are noisy [s]."""
_START = 0.2
"""What the first yaw counts for, in time on two contacts [s]."""


class Place(NamedTuple):
    """Result of the pose update.

    Attributes:
        position: (3,) [m]. yaw: [rad]. rotation: (3, 3) R_WB.
        held: (k, 3) references [m]. held_for: (k,) ticks since each was taken. ground: Height of a level ground [m].
        bias: What the contacts add to the gyro's bias about the vertical, negative [rad/s]. paired: Of `BaseState`.
        inconsistent: Whether the references were taken anew.
    """

    position: FloatArray
    yaw: float
    rotation: FloatArray
    held: FloatArray
    held_for: FloatArray
    ground: float
    bias: float
    paired: float
    inconsistent: bool


@helper
def solve_yaw(arm: FloatArray, held: FloatArray, weight: FloatArray, gyro: float, trust: float) -> tuple[float, float]:
    """(yaw [rad], what the contacts alone say less what the gyro says [rad]); the gyro's with fewer than two contacts.

    Args:
        arm: (k, 3) a_i [m].
        held: (k, 3) p_i [m].
        weight: (k,) W_i >= 0.
        gyro: D_ref [rad].
        trust: Q over sum W_i |a~_i|^2, which counts as that of `_LEAST_ARM` where it is less; positive or infinite.
    """
    total = ax = ay = px = py = even = odd = spread = 0.0
    count = 0
    for i in range(weight.size):
        w = weight[i]
        if w > 0.0:
            count, total = count + 1, total + w
            ax, ay, px, py = ax + w * arm[i, 0], ay + w * arm[i, 1], px + w * held[i, 0], py + w * held[i, 1]
    if count < 2 or trust == math.inf:
        return gyro, 0.0
    ax, ay, px, py = ax / total, ay / total, px / total, py / total
    for i in range(weight.size):
        w = weight[i]
        if w > 0.0:
            x, y, u, v = arm[i, 0] - ax, arm[i, 1] - ay, held[i, 0] - px, held[i, 1] - py
            even += w * (x * u + y * v)
            odd += w * (x * v - y * u)
            spread += w * (x * x + y * y)
    apart = remainder(math.atan2(odd, even) - gyro)
    q = trust * max(spread, total * _LEAST_ARM * _LEAST_ARM)
    return math.atan2(odd + q * math.sin(gyro), even + q * math.cos(gyro)), apart


@helper
def solve_position(
    arm: FloatArray, held: FloatArray, weight: FloatArray, predicted: FloatArray, trust: float
) -> tuple[FloatArray, FloatArray]:
    """(x (3,), p_i - a_i - x (k, 3)) [m]: the weighted mean of what contacts and prediction say, and what is left.

    Args:
        arm: (k, 3) R_z(D) a_i [m].
        held: (k, 3) p_i [m].
        weight: (k,) W_i over their sum.
        predicted: (3,) x_pred [m].
        trust: W_0 over that sum.
    """
    gap, shift = held - (predicted + arm), np.zeros(3)
    for i in range(weight.size):
        shift += weight[i] * gap[i]
    shift /= 1.0 + trust
    return predicted + shift, gap - shift


@helper
def carried_references(given: Given, pressure: FloatArray, back: FloatArray) -> FloatArray:
    """(k, 3) where the references are as the centres of pressure move over their soles [m].

    Args:
        given: Beside the sample.
        pressure: (k, 2) centres of pressure [m].
        back: Of `Sinking`.
    """
    soles, before, options = given.soles, given.before, given.options
    held = before.held.copy()
    for i in range(held.shape[0]):
        foot, dx, dy = before.foot[i], pressure[i, 0] - before.pressure[i, 0], pressure[i, 1] - before.pressure[i, 1]
        for a in range(3):
            if a < 2 or not (options.level and soles[i, FLAT]):
                held[i, a] += foot[a, 0] * dx + foot[a, 1] * dy + foot[a, 2] * back[i]
    return held


@helper
def heading(
    given: Given, pose: Attitude, arm: FloatArray, held: FloatArray, weight: FloatArray
) -> tuple[float, float, bool]:
    """(yaw [rad], constant of the bias [s], whether the contacts contradict the gyro); arguments as in `find_place`."""
    before, options = given.before, given.options
    dt, told = options.period, before.scalars[YAW] + pose.turn
    yaw_time, bias_time = options.yaw_time, options.yaw_bias_time
    if options.quick_start:
        yaw_time, bias_time = filter_times(_START + before.scalars[PAIRED] * dt, yaw_time, bias_time)
    yaw, apart = solve_yaw(arm, held, weight, told, yaw_time / dt)
    astray = abs(apart) > options.slip_turn
    return remainder(told if astray else yaw), bias_time, astray


@helper
def adapt_known(given: Given, held: FloatArray, gap: FloatArray, weight: FloatArray, age: FloatArray) -> None:
    """The usual tick: every contact is known, and near its reference, which adapts slowly; `held` is updated.

    Args:
        given: Beside the sample.
        held: (k, 3) references [m].
        gap: (k, 3) how far each is from where the others have it [m].
        weight: (k,) loads [N].
        age: (k,) ticks since each was taken.
    """
    options = given.options
    k, dt = weight.size, options.period
    adapt, known = min(1.0, dt / options.anchor_time), weight.sum()
    mean = np.zeros(3)
    for i in range(k):
        mean += weight[i] * gap[i] / known
    for i in range(k):
        share = adapt
        held[i] -= share * gap[i]
        if options.quick_start and k > 1 and age[i] * dt < _YOUNG:
            held[i] -= (gap[i] - mean) / (age[i] + 2.0)
        if options.level and given.soles[i, FLAT]:
            held[i, 2] = given.before.scalars[GROUND]


@helper
def take_anew(
    given: Given, references: tuple[FloatArray, ...], loads: tuple[FloatArray, FloatArray], astray: bool
) -> float:
    """Contacts that do not count take their reference from where they are, all of them if they are astray.

    Args:
        given: Beside the sample.
        references: (k, 3) where they are [m], where the contacts are [m], (k,) ticks since each was taken; updated.
        loads: (k,) of the contacts that are known, and of those that count [N].
        astray: Whether they contradict gyro or each other.

    Returns:
        Height of a level ground [m]: where the first loaded soles are; NaN as long as there is none.
    """
    (held, here, age), (weight, bearing), soles, options = references, loads, given.soles, given.options
    k = weight.size
    ground: float = given.before.scalars[GROUND]
    if options.level:
        total = height = 0.0
        for i in range(k):
            total += bearing[i] * soles[i, FLAT]
            height += bearing[i] * soles[i, FLAT] * here[i, 2]
        if ground != ground and total > 0.0:
            ground = height / total
        for i in range(k):
            if ground == ground and soles[i, FLAT]:
                here[i, 2] = ground
    adapt = min(1.0, options.period / options.anchor_time)
    for i in range(k):
        share = adapt if weight[i] > 0.0 and not astray else 1.0
        held[i] += share * (here[i] - held[i])
        if not share < 1.0:
            age[i] = -1.0
    return ground


@helper
def find_place(given: Given, stance: Stance, motion: Motion) -> Place:
    """Position and yaw; contacts that do not count, and new ones, take their reference from them."""
    before, options, posture, pose = given.before, given.options, stance.sunk.posture, stance.pose
    k, dt, pressure = given.soles.shape[0], options.period, motion.found.pressure
    held = carried_references(given, pressure, stance.sunk.back)
    weight, arm = motion.weight.copy(), np.empty((k, 3))
    every = True
    for i in range(k):
        if stance.loads.new[i]:
            weight[i] = 0.0
        every = every and weight[i] > 0.0
        R = posture.rotation[i]
        arm[i] = posture.position[i] + R[:, 0] * pressure[i, 0] + R[:, 1] * pressure[i, 1]
        arm[i] = times(pose.level, arm[i])
    known = weight.sum()
    yaw, bias_time, astray = heading(given, pose, arm, held, weight)
    turn = turned(yaw)
    rotation, spun = product(turn, pose.level), np.empty((k, 3))
    for i in range(k):
        spun[i] = times(turn, arm[i])
    position, gap = before.position.copy(), np.zeros((k, 3))
    if before.scalars[STARTED]:
        position += 0.5 * dt * (times(before.rotation, before.velocity) + times(rotation, motion.found.velocity))
    placed = known > 0.0 and not astray
    if placed:
        position, gap = solve_position(spun, held, weight / known, position, options.position_time / dt)
        limit = options.slip_distance**2
        for i in range(k):
            far = gap[i, 0] ** 2 + gap[i, 1] ** 2 + gap[i, 2] ** 2 > limit
            astray = astray or (weight[i] > 0.0 and far)
    age, ground = before.contacts[:, HELD_FOR].copy(), before.scalars[GROUND]
    if placed and every and not astray:
        adapt_known(given, held, gap, weight, age)
    else:
        ground = take_anew(given, (held, position + spun, age), (weight, motion.weight), astray)
    correction = remainder(yaw - (before.scalars[YAW] + pose.turn))
    paired = before.scalars[PAIRED] + (1.0 if correction != 0.0 else 0.0)
    return Place(position, yaw, rotation, held, age + 1.0, ground, correction / bias_time, paired, astray)


_memory_of = helper(base_state.memory_of)


@kernel(VECTOR, WHOLE, WHOLE, INDEX, OUT_VECTOR)
def outputs(state: FloatArray, n: int, k: int, order: IntArray, out: FloatArray) -> None:
    """[base pose (7); q (n); base velocity (6); qd (n); 0], then the same in the plant's order, into `out`.

    Args:
        state: (s,) see `base.state`.
        n: Joints.
        k: Contacts.
        order: (nq + nv,) where each of the plant's [q; v] is in the first part.
        out: (14 + 2n + nq + nv,) written.
    """
    memory = _memory_of(state, n, k)
    wxyz_into(out, memory.rotation)
    out[4:7], out[7 : 7 + n] = memory.position, memory.q
    out[7 + n : 10 + n] = times(memory.rotation, memory.rate)
    out[10 + n : 13 + n] = times(memory.rotation, memory.velocity)
    out[13 + n : 13 + 2 * n] = memory.qd
    out[13 + 2 * n] = 0.0
    for i in range(order.size):
        out[14 + 2 * n + i] = out[order[i]]
