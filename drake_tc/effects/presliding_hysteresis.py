"""Friction that has to be wound up after every reversal."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from drake_tc.effects.base import Context, EquationEffect, JointNumbers, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.kernels.torque_equations import HYSTERESIS
from drake_tc.types import FloatArray

PRESLIDING_RANGE = Plausible(
    0.0,
    1.2,
    "the bristles carry a share of the sliding friction (Dahl, 1968), here with 20 % for the error of both estimates",
    "coulomb",
)
PRESLIDING_TRAVEL_RANGE = Plausible(
    0.0,
    0.2,
    "geared joints reach full sliding friction within milliradians to some tenths of a radian (Dahl, "
    "1968; Armstrong-Hélouvry et al., 1994)",
)

SLIDING_TRAVEL_RANGE = Plausible(
    0.0,
    0.02,
    "guides and screws reach full sliding friction within some 10 to 100 micrometres, belts and seals within "
    "millimetres",
)
SHORTEST_SLIDE = 1.5e-4
"""Shortest presliding travel [m] that is fitted."""


class PreslidingHysteresis(EquationEffect):
    """F_p (z - sign(qdot)) [N m]: the share F_p of the Coulomb friction acts through a soft bristle z.

    Dahl (1968), exponent 1: dz/ds = (1 - z sign(qdot))/s_p over the travel s, so between reversals
    z = d + (z_0 - d) exp(-s/s_p), d = sign(qdot), z_0 what the last reversal left. After full sliding z_0 = -d.
    """

    id = "presliding_hysteresis"
    joint_types = frozenset(("revolute",))
    torque_kind = HYSTERESIS
    title = "presliding hysteresis"
    equation = "tau_add = presliding * (z - sign(qdot)); presliding_travel * ddq(z) = 1 - z * sign(qdot)"
    kind = "friction"
    coefficients = (
        Parameter(
            "presliding",
            "N*m",
            0.0,
            description="part of the Coulomb friction that builds up over the travel",
            plausible=PRESLIDING_RANGE,
        ),
    )
    shapes = (
        Parameter(
            "presliding_travel",
            "rad",
            1.5e-3,
            1.0,
            0.01,
            description="travel after a reversal over which the missing part falls to 1/e",
            plausible=PRESLIDING_TRAVEL_RANGE,
        ),
    )
    signature = Signature(
        x="travel",
        split="direction",
        look_for="a deficit right after reversals that dies out with the distance moved",
    )

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Starting points that cover what the logs excite."""
        span = context.position_span[1] - context.position_span[0]
        return [{"presliding_travel": float(s)} for s in np.geomspace(2e-3, 0.25 * span, 8)]

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """F_p; the travel is in the state."""
        return (parameters["presliding"],)

    def hysteresis(self, signals: Signals, shape: Shape) -> FloatArray:
        """Over a log z (T,) follows every reversal; at one instant (period 0) full sliding precedes."""
        d = signals.direction
        decay = np.exp(-signals.travel / shape["presliding_travel"])
        left = -d if signals.period == 0.0 else _left_by_reversals(d, decay)
        return np.asarray(d + (left - d) * decay)

    def hysteresis_travel(self, parameters: Mapping[str, float]) -> float:
        """s_p: the Dahl state takes over the share F_p of the Coulomb friction, after any reversals."""
        return parameters["presliding_travel"]

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 2.0 * n.friction


class SlidingPresliding(PreslidingHysteresis):
    """The same over the travel of a joint that slides [m], of which guides and screws need less than gears in rad."""

    form = "sliding"
    joint_types = frozenset(("prismatic",))
    shapes = (
        Parameter(
            "presliding_travel",
            "rad",
            SHORTEST_SLIDE,
            0.1,
            1e-3,
            description="travel after a reversal over which the missing part falls to 1/e",
            plausible=SLIDING_TRAVEL_RANGE,
        ),
    )

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Starting points that cover what the logs excite."""
        span = context.position_span[1] - context.position_span[0]
        return [{"presliding_travel": float(s)} for s in np.geomspace(2e-4, max(0.25 * span, 4e-4), 8)]


def _left_by_reversals(direction: FloatArray, decay: FloatArray) -> FloatArray:
    """z_0 (T,) for each sample: what the bristle was at the last reversal; 0 before the first.

    A design smooths the direction of motion. The bristle remembers strokes, which end where the sign changes.
    """
    sign = np.sign(direction)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(sign) != 0.0) + 1])
    lengths = np.diff(np.append(starts, direction.size))
    ends = starts + lengths - 1
    left, z = [], 0.0
    for way, kept in zip(sign[ends].tolist(), decay[ends].tolist(), strict=True):
        left.append(z)
        z = way + (z - way) * kept
    return np.repeat(left, lengths)
