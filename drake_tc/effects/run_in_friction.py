"""Friction that is higher at the start of a run and settles while the lubricant is worked."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from drake_tc.effects.base import Context, EquationEffect, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.kernels.torque_equations import CONSTANT
from drake_tc.types import FloatArray

RUN_IN_COULOMB_RANGE = Plausible(
    -1.0,
    1.0,
    "friction stays positive while it settles, and cannot exceed the largest torques of drive and load together",
    "torque",
)
RUN_IN_VISCOUS_RANGE = Plausible(
    -1.0,
    1.0,
    "friction stays positive while it settles, and cannot exceed the largest torques of drive and load together",
    "torque/speed",
)
RUN_IN_TIME_RANGE = Plausible(
    0.1,
    10000.0,
    "a lubricant settles within seconds to hours",
)

LEAST_SETTLED = 0.1
"""Share of this friction that must be gone at the end of the longest run. With less of its curve, it is a straight line
over time, and its size, its time and the friction of a warm joint cannot be told apart."""


class RunInFriction(EquationEffect):
    """(F_c0 sign(qdot) + F_v0 qdot) exp(-t/T) [N m], t since the start of the run.

    Friction that is added (or missing) at the start of a run. It models a lubricant that warms up while no temperature
    is recorded.
    A simulation at one instant (period 0) has no start: there the effect has settled to 0.
    """

    id = "run_in_friction"
    torque_kind = CONSTANT
    title = "friction that settles during a run"
    equation = "tau_add = (run_in_coulomb * sign(qdot) + run_in_viscous * qdot) * exp(-t / run_in_time)"
    kind = "friction"
    coefficients = (
        Parameter(
            "run_in_coulomb",
            "N*m",
            description="Coulomb friction at the start of a run beyond that of a warm joint",
            plausible=RUN_IN_COULOMB_RANGE,
        ),
        Parameter(
            "run_in_viscous",
            "N*m*s/rad",
            description="viscous friction at the start of a run beyond that of a warm joint",
            plausible=RUN_IN_VISCOUS_RANGE,
        ),
    )
    shapes = (
        Parameter(
            "run_in_time", "s", 0.1, 1e4, 2.0, description="time in which it falls to 1/e", plausible=RUN_IN_TIME_RANGE
        ),
    )
    signature = Signature(x="time", split="direction", look_for="a fan that closes with the time since the start")

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Seconds to minutes."""
        return [{"run_in_time": t} for t in (1.0, 3.0, 10.0, 60.0)]

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """It must settle within the longest run."""
        settled = -math.expm1(-context.duration / parameters["run_in_time"])
        if settled >= LEAST_SETTLED:
            return ""
        return (
            f"With run_in_time {parameters['run_in_time']:.3g} s, {100.0 * settled:.2g} % of this friction is gone "
            f"after the longest run of {context.duration:.3g} s. With less than {100.0 * LEAST_SETTLED:.0f} %, it was "
            "not seen to settle."
        )

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 2): see the class."""
        if signals.period == 0.0:
            return np.zeros((len(signals), 2))
        left = np.exp(-signals.time / shape["run_in_time"])
        return np.stack([signals.direction * left, signals.velocity * left], axis=-1)

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """Zeros: at an instant it has settled."""
        return 0.0, 0.0, 0.0
