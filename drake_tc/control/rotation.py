"""Rotations as laws and tasks measure them: matrix, quaternion, rotation vector."""

import math

import numpy as np

from drake_tc.types import FloatArray


def rotation_matrix(quaternion: FloatArray) -> FloatArray:
    """R of a quaternion [w x y z] of any length but zero, which gives NaN."""
    w, x, y, z = quaternion.tolist()
    square = w * w + x * x + y * y + z * z
    s = 2.0 / square if square > 0.0 else np.nan
    return np.array(
        [
            [1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)],
        ]
    )


def quaternion_of(rotation: FloatArray) -> FloatArray:
    """[w x y z] of R, w >= 0; accurate at all angles, as it starts from its largest part."""
    (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
    squares = (1.0 + a + e + i, 1.0 + a - e - i, 1.0 - a + e - i, 1.0 - a - e + i)  # 4 w^2, 4 x^2, 4 y^2, 4 z^2
    largest = max(range(4), key=squares.__getitem__)
    if largest == 0:
        parts = (squares[0], h - f, c - g, d - b)
    elif largest == 1:
        parts = (h - f, squares[1], b + d, c + g)
    elif largest == 2:
        parts = (c - g, b + d, squares[2], f + h)
    else:
        parts = (d - b, c + g, f + h, squares[3])
    length = math.copysign(2.0 * math.sqrt(squares[largest]), parts[0])
    return np.array(parts) / length


def rotation_vector(rotation: FloatArray) -> FloatArray:
    """log(R) (3,): axis times angle in [0, pi] [rad]."""
    w, x, y, z = quaternion_of(rotation).tolist()
    sine = math.sqrt(x * x + y * y + z * z)
    if sine == 0.0:
        return np.zeros(3)
    scale = 2.0 * math.atan2(sine, w) / sine
    return np.array([scale * x, scale * y, scale * z])
