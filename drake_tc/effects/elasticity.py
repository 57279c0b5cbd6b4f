"""A gear that gives under load."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, Parameter, Shape, Signals, Signature, TransmissionEffect
from drake_tc.effects.kernel import Transmission
from drake_tc.types import FloatArray


class Elasticity(TransmissionEffect):
    """q_motor = q + c tau, c the compliance [rad/(N m)].

    In a log of the link's position under a servo that holds the motor's, the effort is off by c tau, and the motor's own
    friction and inertia see the rates of c tau. The first scales tau against J qddot by 1 + c/K; the balance divided by
    that reads  tau + J qddot = ... - c (F_v tau' + J tau'' - J qddot/K).
    """

    id = "elasticity"
    title = "elasticity of the gear"
    kind = "transmission"
    linear = True
    coefficients = (Parameter("compliance", "rad/(N*m)", 0.0),)
    signature = Signature(
        x="acceleration", split="direction", look_for="a residual that follows the rate of the load torque"
    )

    def obstacle(self, context: Context) -> str:
        """Needs a servo, whose effort shows the wind-up, and a declared inertia that the wind-up can be held against."""
        if context.drive != "position_servo":
            return "needs a servo that closes on the motor's side"
        if "rotor_inertia" not in context.declared:
            return "no inertia is declared that the wind-up could be held against"
        return super().obstacle(context)

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """F_v dtau/dt + J d2tau/dt2 - J qddot/K (T, 1), the rates from the slow torque."""
        if len(signals) < 2:
            return np.zeros((len(signals), 1))
        rate = np.gradient(signals.slow_torque, signals.period)
        curvature = np.gradient(rate, signals.period)
        motion = signals.viscous * rate + signals.rotor_inertia * curvature
        return np.asarray(motion - signals.stiffness * signals.rotor_inertia * signals.acceleration)[:, None]

    def torque_scale(self, theta: FloatArray, gain: float) -> float:
        """1 - c/K of the fit, = 1/(1 + c/K) of the truth."""
        return 1.0 - float(theta[0]) / gain

    def transmission(self, parameters: Mapping[str, float]) -> Transmission:
        """A spring without play; stiffer than 10^9 N m/rad is taken as that."""
        return Transmission(half_gap=0.0, compliance=max(parameters["compliance"], 1e-9))
