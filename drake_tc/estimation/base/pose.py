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
"""

import math

import numpy as np

from drake_tc.types import FloatArray


def solve_yaw(
    arm: FloatArray, held: FloatArray, weight: FloatArray, gyro: float, trust: float, least: float = 0.0
) -> tuple[float, float]:
    """(yaw [rad], what the contacts alone say less what the gyro says [rad]); the gyro's with fewer than two contacts.

    Args:
        arm: (k, 3) a_i [m].
        held: (k, 3) p_i [m].
        weight: (k,) W_i >= 0.
        gyro: D_ref [rad].
        trust: Q over sum W_i |a~_i|^2; positive or infinite.
        least: Distance of the contacts from their mean below which Q is no smaller [m].
    """
    rows = [
        (w, a[0], a[1], p[0], p[1])
        for w, a, p in zip(weight.tolist(), arm.tolist(), held.tolist(), strict=True)
        if w > 0.0
    ]
    if len(rows) < 2 or trust == math.inf:
        return gyro, 0.0
    total = ax = ay = px = py = 0.0
    for w, x, y, u, v in rows:
        total += w
        ax, ay, px, py = ax + w * x, ay + w * y, px + w * u, py + w * v
    ax, ay, px, py = ax / total, ay / total, px / total, py / total
    even = odd = spread = 0.0
    for w, x, y, u, v in rows:
        x, y, u, v = x - ax, y - ay, u - px, v - py
        even += w * (x * u + y * v)
        odd += w * (x * v - y * u)
        spread += w * (x * x + y * y)
    apart = math.remainder(math.atan2(odd, even) - gyro, math.tau)
    q = trust * max(spread, total * least * least)
    return math.atan2(odd + q * math.sin(gyro), even + q * math.cos(gyro)), apart


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
    gap = held - (predicted + arm)
    shift = weight @ gap / (1.0 + trust)
    return predicted + shift, gap - shift


def turned(yaw: float) -> FloatArray:
    """R_z(yaw), (3, 3)."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def levelled(up: FloatArray) -> FloatArray:
    """R_y(pitch) R_x(roll), (3, 3), of the body in whose axes the world's vertical is `up` (3,), of unit length."""
    roll = math.atan2(up[1], up[2])
    sp = min(1.0, max(-1.0, -float(up[0])))
    cp = math.sqrt(1.0 - sp * sp)
    sr, cr = math.sin(roll), math.cos(roll)
    return np.array([[cp, sp * sr, sp * cr], [0.0, cr, -sr], [-sp, cp * sr, cp * cr]])
