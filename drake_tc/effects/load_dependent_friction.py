"""Friction that grows with the load on the gear."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Parameter, Plausible, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.types import FloatArray

LOAD_FRICTION_RANGE = Plausible(
    0.0,
    1.0,
    "gears that are driven are at least 50 % efficient (efficiency 1/(1 + mu)); catalogues of harmonic "
    "and planetary gears give 60 to 97 %",
)


class LoadDependentFriction(TorqueEffect):
    """mu |tau| sign(qdot) [N m], tau the transmitted torque on the link side (inertia of the link included)."""

    id = "load_dependent_friction"
    title = "load-dependent friction"
    equation = "tau_add = load_friction * abs(tau) * sign(qdot)"
    kind = "friction"
    coefficients = (
        Parameter(
            "load_friction",
            "-",
            0.0,
            1.0,
            description="friction torque for 1 N·m of load",
            plausible=LOAD_FRICTION_RANGE,
        ),
    )
    signature = Signature(
        x="load_torque", split="direction", look_for="a V for one direction, an inverted V for the other"
    )

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 1): see the class."""
        return (np.abs(signals.load_torque) * signals.direction)[:, None]

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The same at one instant."""
        mu = parameters["load_friction"]

        def parts(q: float, v: float, direction: float, tau: float, celsius: float, hysteresis: float) -> TorqueParts:
            return mu * abs(tau), 0.0, 0.0

        return parts
