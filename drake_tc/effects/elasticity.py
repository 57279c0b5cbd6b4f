"""A gear that gives under load."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import (
    Context,
    JointNumbers,
    Parameter,
    Plausible,
    Shape,
    Signals,
    Signature,
    TransmissionEffect,
)
from drake_tc.effects.context import BETWEEN_ENCODERS, NO_INERTIA
from drake_tc.effects.kernel import Transmission
from drake_tc.effects.torque_sensor_gain import held_gain, is_held, scale_column
from drake_tc.types import FloatArray

COMPLIANCE_RANGE = Plausible(
    0.0,
    0.3,
    "the springs of series elastic actuators wind up by at most some 0.3 rad under the largest load, "
    "gears by milliradians",
    "1/torque",
    sliding=Plausible(
        0.0, 0.02, "belts and racks give way by at most some 20 mm under the largest load, screws by less", "1/torque"
    ),
)


class Elasticity(TransmissionEffect):
    """q_motor = q + c tau, c the compliance [rad/(N m)].

    In a log of the link's position under a servo that holds the motor's, the effort is off by c tau, and the motor's
    own friction and inertia see the rates of c tau. The first scales tau against J qddot by 1 + c/K; the balance
    divided by that reads  tau + J qddot = ... - c (F_v tau' + J tau'') + w J qddot,  w = (c/K)/(1 + c/K).

    A delay d of the effort also follows a rate, d y'/K = d (tau' + J qdddot + F_v qddot + the steps of dry friction),
    but at the full size of tau' and with the steps, where compliance has the small share c F_v of tau' and a part in
    phase with qddot. Where the drive gain is declared, fits hold 1/K_0 in place of 1/(K (1 + c/K)): the coefficient is
    c/K_0 in place of w, and its column tau (`held_gain`). With the load torque and the effort both recorded the two are
    told apart (tests/effects/test_told_apart.py). They are not where no inertia is declared, and ringing of the link
    faster than a third of the filters' band is not in the columns, because the torque's noise, differentiated twice,
    would explain itself.
    """

    id = "elasticity"
    title = "elasticity of the gear"
    equation = "q_motor = q + compliance * tau"
    kind = "transmission"
    linear = True
    coefficients = (Parameter("rates", "rad/(N*m)", 0.0), Parameter("wind_up", "-", 0.0, 0.98))
    size = ("compliance", "rad/(N*m)")
    signature = Signature(
        x="acceleration", split="direction", look_for="a residual that follows the rate of the load torque"
    )

    def obstacle(self, context: Context) -> str:
        """Needs a servo, whose effort shows the wind-up, and a declared inertia to hold it against."""
        if context.drive != "position_servo":
            two = "motor_position" in context.recorded
            return BETWEEN_ENCODERS if two else "needs a position servo whose loop is closed on the motor's encoder"
        if context.taken_up:
            return context.taken_up
        if "rotor_inertia" not in context.declared:
            return NO_INERTIA
        return super().obstacle(context)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The compliance c alone."""
        return (
            Parameter(
                "compliance",
                "rad/(N*m)",
                0.0,
                description="angle between motor and link for 1 N·m",
                plausible=COMPLIANCE_RANGE,
            ),
        )

    def balance_inertia(self, theta: FloatArray, shape: Shape, rotor_inertia: float) -> float:
        """-J w, where the drive gain is free."""
        return 0.0 if is_held(shape) else -rotor_inertia * float(theta[1])

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """(F_v dtau/dt + J d2tau/dt2, -J qddot) (T, 2), rates of the slow torque; tau at a held K_0."""
        if len(signals) < 2:
            return np.zeros((len(signals), 2))
        rate = np.gradient(signals.slow_torque, signals.period)
        curvature = np.gradient(rate, signals.period)
        motion = signals.viscous * rate + signals.rotor_inertia * curvature
        return np.stack([motion, -scale_column(signals, shape)], axis=-1)

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """The gain that fits hold."""
        return [held_gain(context)]

    def physical(self, theta: FloatArray, shape: Shape, gain: float) -> dict[str, float]:
        """The compliance c = K w of the fit, which is far better known than from the rates."""
        return {"compliance": float(theta[1]) * gain}

    def torque_scale(self, theta: FloatArray, shape: Shape) -> float:
        """1 - w = 1/(1 + c/K), where the drive gain is free."""
        return 1.0 if is_held(shape) else 1.0 - float(theta[1])

    def transmission(self, parameters: Mapping[str, float]) -> Transmission:
        """A spring without play; stiffer than 10^9 N m/rad is taken as that."""
        return Transmission(half_gap=0.0, compliance=max(parameters["compliance"], 1e-9))

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 0.1 * n.gain

    def unit_coefficients(self, n: JointNumbers) -> tuple[FloatArray, ...]:
        """See `Effect.unit_coefficients`."""
        return (np.array([1.0, 1.0 / n.gain]),)
