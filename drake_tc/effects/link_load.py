"""What is not known of the links' inertial parameters, as a part of one joint's load."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from drake_tc.effects.base import Context, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.equation_effect import EquationEffect
from drake_tc.kernels.torque_equations import CONSTANT
from drake_tc.types import FloatArray

WEIGHT_RANGE = Plausible(-np.inf, np.inf, "what the other joints know of the links bounds it")


class LinkLoad(EquationEffect):
    """sum_k theta_k L_k(t) [N m]: load torques of the links along the directions that the other joints leave open.

    The columns come with the log (`Signals.links`), as they depend on the motion of all joints. Each theta_k has the
    unit variance that the other joints and the robot file leave it (`problem.shared.open_directions`). No search looks
    for it, and no model file holds it: the links' parameters are reported for the whole robot.
    """

    id = "link_load"
    torque_kind = CONSTANT
    title = "inertial parameters of the links"
    kind = "load"
    linear = True
    signature = Signature(x="position", split="", look_for="one curve for both directions of motion")

    def __reduce__(self) -> tuple[object, tuple[int]]:
        return link_load, (len(self.coefficients),)

    def obstacle(self, context: Context) -> str:
        """Only a rig whose links are fitted has it."""
        return "the links are not fitted"

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """L (T, r); 0 where the log does not tell it."""
        size = len(self.coefficients)
        return np.zeros((len(signals), size)) if signals.links is None else signals.links

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """Zeros: it is part of the load."""
        return 0.0, 0.0, 0.0


@lru_cache
def link_load(size: int) -> LinkLoad:
    """The effect with this many directions."""
    weights = tuple(Parameter(f"direction_{k + 1}", "N*m", plausible=WEIGHT_RANGE) for k in range(size))
    made: LinkLoad = type(f"LinkLoad{size}", (LinkLoad,), {"coefficients": weights, "__doc__": LinkLoad.__doc__})()
    return made
