"""Motor and link on the two sides of a gear with play or softness, over one step.

The two sides are stepped together, finer than the plant, the link by its own inertia and by the load that its last
step showed; the plant then gets the *mean* torque that passed the gear. Neither a stiff contact nor an impact
inside the step can then make the plant unstable.

    J omega' = thrust - friction - tau,      M v' = tau - load,      tau = (deadband(theta - q, b/2) + t_d d/dt(.))/c

t_d gives the closed gear a damping ratio of `CONTACT_DAMPING`; a closed gear never pulls across its gap.
"""

import math
from dataclasses import dataclass

from drake_tc.actuation.model import ActuatorModel
from drake_tc.errors import ParamsError
from drake_tc.kernels.equations import gear_torque

CONTACT_DAMPING = 0.05
"""Damping ratio of the two inertias on the closed gear."""
RESOLUTION = 0.25
"""Largest product of the sub-step and the closed gear's angular frequency."""
MOST_SUB_STEPS = 40
"""A gear that would need more is taken to be as soft as these can follow."""


@dataclass(frozen=True)
class Gear:
    """Two inertias with a gap and a spring between them; see the module.

    Attributes:
        half_gap: b/2 [rad].
        compliance: c [rad/(N m)].
        motor_inertia: J [kg m^2].
        link_inertia: M [kg m^2].
        contact_time: t_d [s].
        sub_step: [s].
        sub_steps: Number of them in one step.
    """

    half_gap: float
    compliance: float
    motor_inertia: float
    link_inertia: float
    contact_time: float
    sub_step: float
    sub_steps: int

    def twist(self, torque: float) -> float:
        """Lead of the motor [rad] when the gear passes `torque` [N m] at rest."""
        return torque * self.compliance + (math.copysign(self.half_gap, torque) if torque else 0.0)

    def torque(self, twist: float, rate: float) -> float:
        """What the gear passes [N m] when the motor leads by `twist` [rad] and gains on the link by `rate` [rad/s]."""
        return gear_torque(twist, rate, self.half_gap, self.compliance, self.contact_time)


def gear_of(model: ActuatorModel, link_inertia: float, period: float) -> Gear | None:
    """The gear of a model with TransmissionEffects (gaps and compliances in series), or None without.

    Raises:
        ParamsError: motor or link has no inertia.
    """
    parts = [effect.transmission(parameters) for effect, parameters in model.transmission_effects]
    if not parts:
        return None
    if model.inertia <= 0.0 or link_inertia <= 0.0:
        side = "rotor_inertia > 0 in the model" if model.inertia <= 0.0 else "a link with inertia > 0"
        names = ", ".join(effect.key for effect, _ in model.transmission_effects)
        raise ParamsError(f"joint {model.joint!r}: {names} needs {side}: the motor moves apart from the link")
    compliance = sum(part.compliance for part in parts)
    reduced = model.inertia * link_inertia / (model.inertia + link_inertia)
    compliance = max(compliance, (period / (MOST_SUB_STEPS * RESOLUTION)) ** 2 / reduced)
    frequency = 1.0 / math.sqrt(compliance * reduced)
    sub_steps = max(1, math.ceil(period * frequency / RESOLUTION - 1e-9))
    return Gear(
        half_gap=sum(part.half_gap for part in parts),
        compliance=compliance,
        motor_inertia=model.inertia,
        link_inertia=link_inertia,
        contact_time=2.0 * CONTACT_DAMPING / frequency,
        sub_step=period / sub_steps,
        sub_steps=sub_steps,
    )
