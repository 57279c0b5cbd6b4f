"""Mass and centre of mass beyond an F/T sensor, and the sensor's bias, from static postures.

Source: Del Prete et al., 2016, Algorithm 1.

A part of mass m and centre of mass c that hangs free at rest, gravity being g, is read by the sensor (all in S) as

    f = m g + b_f                         unknowns m, b_f
    t = (m c) x g + b_t = -[g]x (m c) + b_t          unknowns m c, b_t

Both are linear and share no unknown; each is a least squares of its own, with its own noise. The inertia about c does
not act at rest: statics cannot tell it. A bias is told from a weight by turning the sensor against gravity.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t as student

from drake_tc.errors import IdentificationError
from drake_tc.estimation.torque_model import GRAVITY
from drake_tc.types import FloatArray

WORST_CONDITION = 100.0
"""Condition number of the postures' columns, in units of g, above which they do not excite all parameters."""


@dataclass(frozen=True, eq=False)
class EndEffectorFit:
    """What static postures say; `_ci95` are half widths of 95 % confidence intervals.

    Attributes:
        mass: m [kg].
        com: c (3,) in the sensor frame [m].
        force_bias: b_f (3,) [N].
        torque_bias: b_t (3,) [N m].
        mass_ci95: [kg].
        com_ci95: (3,) [m], to first order in the errors of m c and m.
        force_bias_ci95: (3,) [N].
        torque_bias_ci95: (3,) [N m].
        force_noise: Standard deviation of the forces' residuals [N].
        torque_noise: Of the torques' residuals [N m].
        condition: Larger condition number of the two problems.
    """

    mass: float
    com: FloatArray
    force_bias: FloatArray
    torque_bias: FloatArray
    mass_ci95: float
    com_ci95: FloatArray
    force_bias_ci95: FloatArray
    torque_bias_ci95: FloatArray
    force_noise: float
    torque_noise: float
    condition: float


def identify_end_effector(gravity: FloatArray, wrench: FloatArray) -> EndEffectorFit:
    """Fit m, c and the bias.

    Args:
        gravity: (T, 3) g in the sensor frame [m/s^2], pointing down (`sensor_gravity`).
        wrench: (T, 6) readings [f; t], free of contact, each the mean over a posture at rest [N, N m].

    Raises:
        IdentificationError: Shapes that do not fit, values that are not finite, fewer than three postures, postures
            that do not turn the sensor against gravity enough (the message names what suffers and the condition
            number), or a mass that is not positive.
    """
    gravity, wrench = np.asarray(gravity, dtype=np.float64), np.asarray(wrench, dtype=np.float64)
    postures = gravity.shape[0]
    if gravity.shape != (postures, 3) or wrench.shape != (postures, 6):
        raise IdentificationError(
            f"end-effector: expected gravity (T, 3) and wrench (T, 6), got {gravity.shape} and {wrench.shape}"
        )
    if not (np.all(np.isfinite(gravity)) and np.all(np.isfinite(wrench))):
        raise IdentificationError("end-effector: expected finite gravity and wrench; some are not")
    if postures < 3:
        raise IdentificationError(f"end-effector: expected at least 3 static postures, got {postures}")
    bias = np.tile(np.eye(3), (postures, 1))
    forces = _fit(np.column_stack([gravity.ravel(), bias]), wrench[:, :3].ravel(), "mass and force bias")
    turning = np.concatenate([_minus_skew(g) for g in gravity])
    torques = _fit(np.column_stack([turning, bias]), wrench[:, 3:].ravel(), "centre of mass and torque bias")
    mass, moment = float(forces.value[0]), torques.value[:3]
    if not mass > 0.0:
        raise IdentificationError(f"end-effector: expected a positive mass; the postures give {mass:.3g} kg")
    com = moment / mass
    return EndEffectorFit(
        mass=mass,
        com=com,
        force_bias=forces.value[1:],
        torque_bias=torques.value[3:],
        mass_ci95=float(forces.ci95[0]),
        com_ci95=np.hypot(torques.ci95[:3], com * forces.ci95[0]) / mass,
        force_bias_ci95=forces.ci95[1:],
        torque_bias_ci95=torques.ci95[3:],
        force_noise=forces.noise,
        torque_noise=torques.noise,
        condition=max(forces.condition, torques.condition),
    )


def sensor_gravity(rotations: FloatArray, accel: FloatArray) -> FloatArray:
    """G in the sensor frame (T, 3) [m/s^2], from an IMU at rest.

    g_S = -9.81 R_SI a / |a|: at rest the accelerometer reads -g; its length is not trusted, its direction is.

    Args:
        rotations: (T, 3, 3) R_SI, the IMU's axes in the sensor's, by the joints between them.
        accel: (T, 3) accelerometer readings in I [m/s^2].

    Raises:
        IdentificationError: An accelerometer that reads nothing.
    """
    size = np.linalg.norm(accel, axis=1)
    if not np.all(size > 0.0):
        raise IdentificationError(
            "end-effector: expected accelerometer readings of gravity; some are zero or not finite"
        )
    return np.asarray(-GRAVITY * np.einsum("tij,tj->ti", rotations, accel / size[:, None]))


@dataclass(frozen=True, eq=False)
class _Fit:
    value: FloatArray
    ci95: FloatArray
    noise: float
    condition: float


def _fit(matrix: FloatArray, target: FloatArray, what: str) -> _Fit:
    """Ordinary least squares; its columns of gravity are scaled to the biases' unit for the condition number."""
    scale = np.where(np.arange(matrix.shape[1]) < matrix.shape[1] - 3, GRAVITY, 1.0)
    scaled = matrix / scale
    condition = float(np.linalg.cond(scaled))
    if not condition < WORST_CONDITION:
        raise IdentificationError(
            f"end-effector: the postures do not tell {what} apart (condition number {condition:.3g}, expected below "
            f"{WORST_CONDITION:g}): turn the sensor further against gravity, about two axes"
        )
    solution: Any = np.linalg.lstsq(scaled, target, rcond=None)[0]
    freedom = target.size - scaled.shape[1]
    noise = float(np.sqrt(np.sum((target - scaled @ solution) ** 2) / freedom))
    deviation = noise * np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled)))
    return _Fit(solution / scale, student.ppf(0.975, freedom) * deviation / scale, noise, condition)


def _minus_skew(g: FloatArray) -> FloatArray:
    """A with A c = c x g."""
    return np.array([[0.0, g[2], -g[1]], [-g[2], 0.0, g[0]], [g[1], -g[0], 0.0]])
