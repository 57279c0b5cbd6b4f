"""A robot's positions moved on their manifold: for motions of the model itself, without a plant."""

import math

import numpy as np

from drake_tc.tsid.model import TsidModel
from drake_tc.types import FloatArray


def moved(model: TsidModel, q: FloatArray, v: FloatArray, dt: float) -> FloatArray:
    """Q (+) dt v (nq,), its quaternion of length 1: where a constant v leads; a floating base turns exactly.

    Args:
        model: Of the robot; says where joints stand in q and v.
        q: (nq,) [quaternion, p of a floating base; joints].
        v: (nv,) [omega, velocity of a floating base, in the world's axes; joints].
        dt: [s].
    """
    there = q.copy()
    there[model.positions] += dt * v[model.actuated]
    if model.robot.fixed_base:
        return there
    there[4:7] += dt * v[3:6]
    turn = dt * v[:3]
    half = 0.5 * math.sqrt(float(turn @ turn))
    scalar, vector = math.cos(half), 0.5 * float(np.sinc(half / math.pi)) * turn
    there[0] = scalar * q[0] - vector @ q[1:4]
    there[1:4] = scalar * q[1:4] + q[0] * vector + np.cross(vector, q[1:4])
    there[:4] /= np.linalg.norm(there[:4])
    return there
