"""A gear that gives under load."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, Parameter, Shape, Signals, Signature, TransmissionEffect
from drake_tc.effects.kernel import Transmission
from drake_tc.types import FloatArray


class Elasticity(TransmissionEffect):
    """q_motor = q + c tau, c the compliance [rad/(N m)].

    In a log of the link's position the motor's own friction and inertia see the rates of c tau, and the effort of a
    servo that holds the motor's position is off by c tau. The latter scales tau against J qddot, hence column two.
    """

    id = "elasticity"
    title = "elasticity of the gear"
    kind = "transmission"
    linear = True
    coefficients = (Parameter("compliance", "rad/(N*m)", 0.0), Parameter("wind_up", "-", 0.0))
    signature = Signature(
        x="acceleration", split="direction", look_for="a residual that follows the rate of the load torque"
    )

    def obstacle(self, context: Context) -> str:
        """Needs the declared inertia (or a second encoder): otherwise the drive gain takes it up."""
        if "rotor_inertia" not in context.declared:
            return "no inertia is declared that the wind-up could be held against"
        return super().obstacle(context)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The compliance c alone."""
        return (Parameter("compliance", "rad/(N*m)", 0.0),)

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """(F_v d tau/dt + J d2 tau/dt2, -J qddot) (T, 2)."""
        rate = np.gradient(signals.slow_torque, signals.period)
        curvature = np.gradient(rate, signals.period)
        motion = signals.viscous * rate + signals.rotor_inertia * curvature
        seen = 1.0 if signals.stiffness > 0.0 else 0.0
        return np.stack([motion, -seen * signals.rotor_inertia * signals.acceleration], axis=-1)

    def physical(self, theta: FloatArray, shape: Shape, gain: float) -> dict[str, float]:
        """C [rad/(N m)]: K times the wind-up of a servo, which is known far better; for other drives from the rates."""
        return {"compliance": float(theta[1]) * gain if theta[1] > 0.0 else float(theta[0])}

    def torque_scale(self, theta: FloatArray) -> float:
        """1 - c/K': the balance was divided by 1 + c/K."""
        return 1.0 - float(theta[1])

    def transmission(self, parameters: Mapping[str, float]) -> Transmission:
        """A spring without play; stiffer than 10^9 N m/rad is taken as that."""
        return Transmission(half_gap=0.0, compliance=max(parameters["compliance"], 1e-9))
