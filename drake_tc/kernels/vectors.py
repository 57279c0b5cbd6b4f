"""Vectors (3,) and rotations (3, 3), each result a new array."""

import math

import numpy as np

from drake_tc.kernels.compiling import helper
from drake_tc.types import FloatArray


@helper
def times(R: FloatArray, a: FloatArray) -> FloatArray:
    """R a."""
    out = np.empty(3)
    for i in range(3):
        out[i] = R[i, 0] * a[0] + R[i, 1] * a[1] + R[i, 2] * a[2]
    return out


@helper
def times_transposed(R: FloatArray, a: FloatArray) -> FloatArray:
    """R^T a."""
    out = np.empty(3)
    for i in range(3):
        out[i] = R[0, i] * a[0] + R[1, i] * a[1] + R[2, i] * a[2]
    return out


@helper
def product(R: FloatArray, S: FloatArray) -> FloatArray:
    """R S."""
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            out[i, j] = R[i, 0] * S[0, j] + R[i, 1] * S[1, j] + R[i, 2] * S[2, j]
    return out


@helper
def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """A x b."""
    out = np.empty(3)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out


@helper
def dot(a: FloatArray, b: FloatArray) -> float:
    """A . b of two vectors of any length."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@helper
def turned(yaw: float) -> FloatArray:
    """R_z(yaw)."""
    out = np.zeros((3, 3))
    c, s = math.cos(yaw), math.sin(yaw)
    out[0, 0], out[0, 1], out[1, 0], out[1, 1], out[2, 2] = c, -s, s, c, 1.0
    return out


@helper
def levelled(up: FloatArray) -> FloatArray:
    """R_y(pitch) R_x(roll) of the body in whose axes the world's vertical is `up` (3,), of unit length."""
    roll = math.atan2(up[1], up[2])
    sp = min(1.0, max(-1.0, -up[0]))
    cp = math.sqrt(1.0 - sp * sp)
    sr, cr = math.sin(roll), math.cos(roll)
    out = np.empty((3, 3))
    out[0, 0], out[0, 1], out[0, 2] = cp, sp * sr, sp * cr
    out[1, 0], out[1, 1], out[1, 2] = 0.0, cr, -sr
    out[2, 0], out[2, 1], out[2, 2] = -sp, cp * sr, cp * cr
    return out


@helper
def remainder(angle: float) -> float:
    """The angle less the nearest whole number of turns, in [-pi, pi]."""
    turns: float = np.rint(angle / math.tau)
    return angle - math.tau * turns


@helper
def wxyz_into(out: FloatArray, R: FloatArray) -> None:
    """The quaternion [w x y z] of a rotation into out[:4], of unit length; by its largest part (Shepperd, 1978)."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace >= R[0, 0] and trace >= R[1, 1] and trace >= R[2, 2]:
        out[0], out[1], out[2], out[3] = 1.0 + trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    elif R[0, 0] >= R[1, 1] and R[0, 0] >= R[2, 2]:
        out[0], out[1] = R[2, 1] - R[1, 2], 1.0 - (trace - 2.0 * R[0, 0])
        out[2], out[3] = R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]
    elif R[1, 1] >= R[2, 2]:
        out[0], out[1] = R[0, 2] - R[2, 0], R[0, 1] + R[1, 0]
        out[2], out[3] = 1.0 - (trace - 2.0 * R[1, 1]), R[1, 2] + R[2, 1]
    else:
        out[0], out[1] = R[1, 0] - R[0, 1], R[0, 2] + R[2, 0]
        out[2], out[3] = R[1, 2] + R[2, 1], 1.0 - (trace - 2.0 * R[2, 2])
    length = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2 + out[3] ** 2)
    sign = -1.0 if out[0] < 0.0 else 1.0
    for i in range(4):
        out[i] *= sign / length
