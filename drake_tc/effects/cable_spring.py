"""A spring along the joint: cables, hoses, a gravity compensator."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from drake_tc.effects.base import Context, EquationEffect, JointNumbers, Parameter, Plausible, Signature
from drake_tc.kernels.torque_equations import SPRING
from drake_tc.types import FloatArray

SPRING_STIFFNESS_RANGE = Plausible(
    0.0,
    2.0,
    "a passive spring pulls back towards its rest position (a negative stiffness would release energy at every "
    "deflection), and from one end of the recorded positions to the other its torque changes by at most twice the "
    "largest torque of drive and load together",
    "torque/span",
)
SPRING_PRELOAD_RANGE = Plausible(
    -1.0,
    1.0,
    "a spring cannot pull harder than drive and load together",
    "torque",
)


MOST_TURNS = 2.0
"""Range of the output over which a cable can act as a spring [turns]; cable guides of robot joints allow about one."""


class CableSpring(EquationEffect):
    """k (q - q_0) [N m], as k q - k q_0."""

    id = "cable_spring"
    torque_kind = SPRING
    title = "cable spring"
    equation = "tau_add = spring_stiffness * q + spring_preload"
    kind = "load"
    depends_on_position = True
    linear = True
    coefficients: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "spring_stiffness",
            "N*m/rad",
            description="stiffness of the spring at the joint",
            plausible=SPRING_STIFFNESS_RANGE,
        ),
        Parameter("spring_preload", "N*m", description="-k q_0", plausible=SPRING_PRELOAD_RANGE),
    )
    signature = Signature(
        x="position", split="", look_for="a straight line over the position, the same in both directions"
    )

    def obstacle(self, context: Context) -> str:
        """Not beside an unknown load, which has a column of the same form."""
        return context.taken_up or super().obstacle(context)

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """A cable does not wind up over several turns."""
        if context.turns <= MOST_TURNS or context.units.slides:
            return ""
        return (
            f"The joint turns over {context.turns:.2g} turns of its output: a cable or spring fixed to both sides "
            f"allows at most some {MOST_TURNS:g}."
        )

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 2.0 * n.part / max(n.span, 1e-9)

    def unit_coefficients(self, n: JointNumbers) -> tuple[FloatArray, ...]:
        """At rest in the middle, or at an end of the travel."""
        places = (0.0, -0.5, 0.5) if len(self.coefficients) > 1 else (0.0,)
        return tuple(np.array([1.0, share * n.span])[: len(self.coefficients)] for share in places)


class SpringBesideWeight(CableSpring):
    """k q [N] beside the unknown load of a joint that slides, whose constant force holds the preload."""

    form = "beside_weight"
    joint_types = frozenset(("prismatic",))
    equation = "tau_add = spring_stiffness * q"
    coefficients = CableSpring.coefficients[:1]

    def obstacle(self, context: Context) -> str:
        """Only a load whose force does not follow the position lacks a column of this form."""
        if context.load != "unknown":
            return "the load is known, so that the spring with a preload is looked for instead"
        return context.taken_up if context.load_follows_position else ""

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """A spring without preload."""
        return parameters["spring_stiffness"], 0.0
