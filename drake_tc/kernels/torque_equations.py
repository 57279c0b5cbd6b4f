"""Equations of torque effects, each once: on arrays for a log, on numbers for a joint at one instant, and compiled.

Functions without a decorator, which call no other, as in `equations`. Each gives (level [N m], damping [N m s/rad],
rest [N m]) of

    torque = level direction + damping v + rest

from the joint's state s and the effect's numbers n. Each part of the state, and each of the numbers, may be an array.

Places in the tables of n joints' feedforward; imports nothing, so that tables are built without Numba.

`joints` (n, 14) has a row a joint, `inverses` (I, 2) the kind (`joint_layout`) and the parameter of each drive effect
that is undone, in this order, `terms` (E, 4) each torque effect (`joint_layout`), `values` the numbers of these; those
of the first joint first.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

REFERENCE_CELSIUS = 25.0
"""T at which parameters of friction that follows the temperature hold [deg C]."""


class JointState(NamedTuple):
    """What the equations of one effect see: numbers of one joint at one instant, or arrays.

    Attributes:
        q: Position [rad].
        v: Velocity [rad/s].
        direction: In [-1, 1].
        tau: Load torque [N m].
        celsius: Temperature [deg C].
        z: Hysteretic state of the effect in [-1, 1].
    """

    q: Any
    v: Any
    direction: Any
    tau: Any
    celsius: Any
    z: Any


def constant(s: JointState, n: Any) -> Any:
    """Level n0, damping n1 and rest n2."""
    return n[0], n[1], n[2]


def stribeck(s: JointState, n: Any) -> Any:
    """Level n0 exp(-(|v|/n1)^n2)."""
    return n[0] * np.exp(-((np.abs(s.v) / n[1]) ** n[2])), 0.0, 0.0


def power(s: JointState, n: Any) -> Any:
    """Level n0 |v|^n1."""
    return n[0] * np.abs(s.v) ** n[1], 0.0, 0.0


def quadratic(s: JointState, n: Any) -> Any:
    """Damping n0 |v|."""
    return 0.0, n[0] * np.abs(s.v), 0.0


def asymmetry(s: JointState, n: Any) -> Any:
    """Level n0 direction and damping n1 sign(v)."""
    return n[0] * s.direction, n[1] * np.copysign(1.0, s.v), 0.0


def load_friction(s: JointState, n: Any) -> Any:
    """Level mu |tau|; mu is n0 where the joint drives its load (tau direction > 0), else n1."""
    drives = s.tau * s.direction > 0.0
    return (n[0] * drives + n[1] * (1.0 - drives)) * np.abs(s.tau), 0.0, 0.0


def load_stribeck(s: JointState, n: Any) -> Any:
    """Level n0 |tau| exp(-|v|/n1)."""
    return n[0] * np.abs(s.tau) * np.exp(-np.abs(s.v) / n[1]), 0.0, 0.0


def friction_wave(s: JointState, n: Any) -> Any:
    """Level n0 cos(n2 q) + n1 sin(n2 q)."""
    return n[0] * np.cos(n[2] * s.q) + n[1] * np.sin(n[2] * s.q), 0.0, 0.0


def friction_line(s: JointState, n: Any) -> Any:
    """Level n0 (q - n1), with q - n1 kept within [-n2, n2]."""
    return n[0] * np.maximum(-n[2], np.minimum(n[2], s.q - n[1])), 0.0, 0.0


def thermal(s: JointState, n: Any) -> Any:
    """Level n0 w and damping n1 w; w = (1 - exp(-n2 (T - 25)))/n2."""
    warmth = -np.expm1(-n[2] * (s.celsius - REFERENCE_CELSIUS)) / n[2]
    return n[0] * warmth, n[1] * warmth, 0.0


def hysteresis(s: JointState, n: Any) -> Any:
    """n0 z in place of n0 direction: level -n0 and rest n0 z."""
    return -n[0], 0.0, n[0] * s.z


def wave(s: JointState, n: Any) -> Any:
    """Rest n0 cos(n2 q) + n1 sin(n2 q)."""
    return 0.0, 0.0, n[0] * np.cos(n[2] * s.q) + n[1] * np.sin(n[2] * s.q)


def spring(s: JointState, n: Any) -> Any:
    """Rest n0 q + n1."""
    return 0.0, 0.0, n[0] * s.q + n[1]


def pendulum(s: JointState, n: Any) -> Any:
    """Rest n0 sin(q - n1) + n2."""
    return 0.0, 0.0, n[0] * np.sin(s.q - n[1]) + n[2]


def load_share(s: JointState, n: Any) -> Any:
    """Rest n0 tau."""
    return 0.0, 0.0, n[0] * s.tau


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


GAIN, LEVEL, DAMPING, REST, INERTIA, COMPLIANCE, HALF_GAP, SMOOTHING, INVERSES, INVERSES_END, LIMIT, SERVO = range(12)
"""K; constant parts of the effects; J; lead of a servo over a soft gear and its play; width of smoothed jumps; rows of
its inverses; largest torque; 1 for a position servo."""
TERMS, TERMS_END = 12, 13
"""Rows of its torque effects."""
COLUMNS = 14
