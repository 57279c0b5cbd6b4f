"""Torque effects whose kernel ignores its arguments: their parts are taken once, at compile time."""

from drake_tc.actuation.model import ActuatorModel
from drake_tc.effects.base import TorqueEffect
from drake_tc.effects.coulomb import Coulomb
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.effects.rotor_inertia import RotorInertia
from drake_tc.effects.thermal_friction import REFERENCE_CELSIUS
from drake_tc.effects.viscous import Viscous

CONSTANT: frozenset[type[TorqueEffect]] = frozenset({Viscous, Coulomb, RotorInertia})
"""Effects whose level, damping and rest depend on nothing but their parameters."""


def split_parts(model: ActuatorModel) -> tuple[TorqueParts, tuple[TorqueKernel, ...]]:
    """The sum of a model's constant parts, and the kernels that have to be evaluated at every instant."""
    level = damping = rest = 0.0
    kernels = []
    for effect, parameters in model.torque_effects:
        kernel = effect.kernel(parameters)
        if type(effect) in CONSTANT:
            a, b, c = kernel(0.0, 0.0, 0.0, 0.0, REFERENCE_CELSIUS, 0.0)
            level, damping, rest = level + a, damping + b, rest + c
        else:
            kernels.append(kernel)
    return (level, damping, rest), tuple(kernels)
