"""A gear that loses more torque when it is driven by its load than when it drives the load, or less."""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, EquationEffect, JointNumbers, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.context import NO_INERTIA
from drake_tc.effects.torque_sensor_gain import held_gain, is_held, scale_column
from drake_tc.kernels.torque_equations import LOAD_FRICTION
from drake_tc.types import FloatArray

DRIVING_RANGE = Plausible(
    0.0,
    1.0,
    "friction dissipates energy, and gears that drive a load are at least 50 % efficient (efficiency 1/(1 + mu))",
)
BACKDRIVEN_RANGE = Plausible(
    0.0,
    1.0,
    "friction dissipates energy, and a gear that loses all of the load's torque (mu = 1) cannot be back-driven",
)


class DirectionalEfficiency(EquationEffect):
    """mu |tau| sign(qdot) [N m] with mu_d where the joint drives its load (tau qdot > 0), mu_b where it is back-driven.

    With mu the mean and delta half of the difference of mu_d and mu_b this is  mu |tau| sign(qdot) + delta tau. The
    second part scales the load torque, as a wrong drive gain does. Where the drive gain is free, the difference shows
    only against a torque that is known without the gear: the declared inertia. The balance divided by 1 + delta reads

        y*/K' = tau + J qddot - w J qddot + mu' |tau| sign(qdot) + ...,   w = delta/(1 + delta),   mu' = mu/(1 + delta)

    so the logs cannot tell this effect from load-dependent friction together with a wrong scale of the load torque.
    Source: Wang and Kim, Directional efficiency in geared transmissions (2015): forward and backward efficiency,
    eta_f = 1/(1 + mu_d) and eta_b = 1 - mu_b. Where the drive gain is declared, the coefficients are mu and delta, and
    the column of delta is tau (`held_gain`).
    """

    id = "directional_efficiency"
    torque_kind = LOAD_FRICTION
    title = "gear efficiency that differs when the gear is back-driven"
    equation = "tau_add = (driving_friction if tau * qdot > 0 else backdriven_friction) * abs(tau) * sign(qdot)"
    kind = "friction"
    coefficients = (
        Parameter("mean_load_friction", "-", 0.0, 1.0),
        Parameter("scaled_inertia", "-", -0.9, 0.9, description="w"),
    )
    size = ("mean_load_friction", "-")
    signature = Signature(
        x="load_torque",
        split="direction",
        look_for="lines through zero whose slopes differ between the quadrants in which torque and motion agree or not",
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """mu_d and mu_b."""
        return (
            Parameter("driving_friction", "-", 0.0, 1.0, description="mu_d", plausible=DRIVING_RANGE),
            Parameter("backdriven_friction", "-", 0.0, 1.0, description="mu_b", plausible=BACKDRIVEN_RANGE),
        )

    def obstacle(self, context: Context) -> str:
        """Needs a declared inertia: without one the difference is the same as another drive gain."""
        if not context.declared.get("rotor_inertia"):
            return NO_INERTIA
        return super().obstacle(context)

    def balance_inertia(self, theta: FloatArray, shape: Shape, rotor_inertia: float) -> float:
        """-J w, where the drive gain is free."""
        return 0.0 if is_held(shape) else -rotor_inertia * float(theta[1])

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """(|tau| sign(qdot), -J qddot) (T, 2); tau in place of the second at a held K_0."""
        friction = self.equation_torque(signals, {"driving_friction": 1.0, "backdriven_friction": 1.0})
        return np.stack([friction, -scale_column(signals, shape)], axis=-1)

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """The gain that fits hold."""
        return [held_gain(context)]

    def physical(self, theta: FloatArray, shape: Shape, gain: float) -> dict[str, float]:
        """mu_d = mu + delta and mu_b = mu - delta."""
        mean, difference = map(float, theta)
        if not is_held(shape):
            difference /= 1.0 - difference
            mean *= 1.0 + difference
        return {"driving_friction": mean + difference, "backdriven_friction": mean - difference}

    def torque_scale(self, theta: FloatArray, shape: Shape) -> float:
        """1 - w = 1/(1 + delta), where the drive gain is free."""
        return 1.0 if is_held(shape) else 1.0 - float(theta[1])

    def torque(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> FloatArray:
        """(T,): see the class."""
        return self.equation_torque(signals, parameters)

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 0.1

    def unit_coefficients(self, n: JointNumbers) -> tuple[FloatArray, ...]:
        """See `Effect.unit_coefficients`."""
        return (np.array([1.0, 0.0]),)
