"""Friction that grows with the square of the speed."""

from drake_tc.effects.base import Context, EquationEffect, JointNumbers, Parameter, Plausible, Signature
from drake_tc.kernels.torque_equations import QUADRATIC

QUADRATIC_VISCOUS_RANGE = Plausible(
    0.0,
    1.0,
    "churning and windage grow with the square of the speed and dissipate energy; friction that flattens "
    "with the speed is a power law below 1",
    "torque/speed^2",
)


class QuadraticViscous(EquationEffect):
    """F_q qdot |qdot| [N m]."""

    id = "quadratic_viscous"
    torque_kind = QUADRATIC
    title = "quadratic viscous friction"
    equation = "tau_add = quadratic_viscous * qdot * abs(qdot)"
    kind = "friction"
    coefficients = (
        Parameter(
            "quadratic_viscous",
            "N*m*s^2/rad^2",
            description="friction torque at 1 rad/s that grows with the square of the velocity",
            plausible=QUADRATIC_VISCOUS_RANGE,
        ),
    )
    signature = Signature(
        x="velocity", split="", look_for="an S that steepens (or flattens) towards the highest speeds"
    )

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        speed = max(n.speed, 1e-9)
        return max(n.part, 0.2 * n.viscous * speed) / speed**2
