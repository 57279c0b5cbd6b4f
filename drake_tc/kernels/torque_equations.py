"""Equations of torque effects, each once: on arrays for a log, on numbers for a joint at one instant, and compiled.

Functions without a decorator, which call no other, as in `equations`. Each gives (level [N m], damping [N m s/rad],
rest [N m]) of

    torque = level direction + damping v + rest

from the position q [rad], the velocity v [rad/s], the direction in [-1, 1], the load torque tau [N m], the temperature
[deg C], the effect's own hysteretic state z in [-1, 1] and its numbers n. Each of these, and each of the numbers, may
be an array.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

REFERENCE_CELSIUS = 25.0
"""T at which parameters of friction that follows the temperature hold [deg C]."""


def constant(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """Level n0, damping n1 and rest n2."""
    return n[0], n[1], n[2]


def stribeck(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """Level n0 exp(-(|v|/n1)^n2)."""
    return n[0] * np.exp(-((np.abs(v) / n[1]) ** n[2])), 0.0, 0.0


def power(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """Level n0 |v|^n1."""
    return n[0] * np.abs(v) ** n[1], 0.0, 0.0


def quadratic(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """Damping n0 |v|."""
    return 0.0, n[0] * np.abs(v), 0.0


def asymmetry(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """Level n0 direction and damping n1 sign(v)."""
    return n[0] * direction, n[1] * np.copysign(1.0, v), 0.0


def load_friction(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """Level mu |tau|; mu is n0 where the joint drives its load (tau direction > 0), else n1."""
    drives = tau * direction > 0.0
    return (n[0] * drives + n[1] * (1.0 - drives)) * np.abs(tau), 0.0, 0.0


def load_stribeck(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """Level n0 |tau| exp(-|v|/n1)."""
    return n[0] * np.abs(tau) * np.exp(-np.abs(v) / n[1]), 0.0, 0.0


def friction_wave(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """Level n0 cos(n2 q) + n1 sin(n2 q)."""
    return n[0] * np.cos(n[2] * q) + n[1] * np.sin(n[2] * q), 0.0, 0.0


def friction_line(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """Level n0 (q - n1), with q - n1 kept within [-n2, n2]."""
    return n[0] * np.maximum(-n[2], np.minimum(n[2], q - n[1])), 0.0, 0.0


def thermal(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """Level n0 w and damping n1 w; w = (1 - exp(-n2 (T - 25)))/n2."""
    warmth = -np.expm1(-n[2] * (celsius - REFERENCE_CELSIUS)) / n[2]
    return n[0] * warmth, n[1] * warmth, 0.0


def hysteresis(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """n0 z in place of n0 direction: level -n0 and rest n0 z."""
    return -n[0], 0.0, n[0] * z


def wave(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """Rest n0 cos(n2 q) + n1 sin(n2 q)."""
    return 0.0, 0.0, n[0] * np.cos(n[2] * q) + n[1] * np.sin(n[2] * q)


def spring(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """Rest n0 q + n1."""
    return 0.0, 0.0, n[0] * q + n[1]


def pendulum(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """Rest n0 sin(q - n1) + n2."""
    return 0.0, 0.0, n[0] * np.sin(q - n[1]) + n[2]


def load_share(q: Any, v: Any, direction: Any, tau: Any, celsius: Any, z: Any, n: Any) -> Any:
    """Rest n0 tau."""
    return 0.0, 0.0, n[0] * tau


EQUATIONS: tuple[Callable[..., Any], ...] = (
    constant,
    stribeck,
    power,
    quadratic,
    asymmetry,
    load_friction,
    load_stribeck,
    friction_wave,
    friction_line,
    thermal,
    hysteresis,
    wave,
    spring,
    pendulum,
    load_share,
)
"""By their kind."""
(
    CONSTANT,
    STRIBECK,
    POWER,
    QUADRATIC,
    ASYMMETRY,
    LOAD_FRICTION,
    LOAD_STRIBECK,
    FRICTION_WAVE,
    FRICTION_LINE,
    THERMAL,
    HYSTERESIS,
    WAVE,
    SPRING,
    PENDULUM,
    LOAD_SHARE,
) = range(len(EQUATIONS))
"""Kinds of torque effects."""
