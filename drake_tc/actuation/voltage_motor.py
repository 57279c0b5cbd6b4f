"""A motor with voltage drive behind a gear and in front of a spring, as its data sheet has it.

Source: Faraji et al., 2015, section II.A.

    (v - ke N theta') kt N/Rm = tau_co sign(theta') + tau_v theta' + Jm N^2 theta'' + tau,   tau = Ks (theta - q)

theta is the motor's angle over the gear ratio, before the spring; q the link's. An actuator model writes the same as

    v/K = F_c sign(theta') + F_v theta' + J theta'' + tau,   K = Rm/(kt N), F_v = tau_v + ke kt N^2/Rm, J = Jm N^2

so that the back-EMF is part of the viscous friction: what passes the gear tells F_v, never ke and tau_v apart.
"""

import math
from dataclasses import dataclass, fields
from typing import Any

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.errors import ParamsError

LARGEST, SMALLEST = 1e9, 1e-12
"""No number of a motor in SI is as large, and no positive one as small."""
POSITIVE = ("torque_constant", "resistance", "rotor_inertia", "gear_ratio", "stiffness", "voltage_limit")


@dataclass(frozen=True)
class VoltageMotor:
    """Motor, gear and spring of one joint.

    Attributes:
        torque_constant: kt [N m/A], of the motor's shaft.
        back_emf: ke [V s/rad], of the motor's shaft; equal to kt in SI for an ideal motor.
        resistance: Rm [Ohm].
        rotor_inertia: Jm [kg m^2], rotor and wave generator, on the motor's shaft.
        gear_ratio: N [-].
        coulomb: tau_co [N m], on the joint's side.
        viscous: tau_v [N m s/rad], on the joint's side, without the back-EMF.
        stiffness: Ks [N m/rad] of the spring.
        voltage_limit: Largest |v| [V]; infinite for none.

    Raises:
        ParamsError: a value that is not possible.
    """

    torque_constant: float
    back_emf: float
    resistance: float
    rotor_inertia: float
    gear_ratio: float
    coulomb: float
    viscous: float
    stiffness: float
    voltage_limit: float = math.inf

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            low = value >= SMALLEST if field.name in POSITIVE else value >= 0.0
            high = value <= LARGEST or (field.name == "voltage_limit" and value == math.inf)
            if not (low and high):
                sign = f"a number from {SMALLEST:g}" if field.name in POSITIVE else "a number from 0"
                sign += f" to {LARGEST:g}"
                raise ParamsError(f"{field.name}: expected {sign}, got {value!r}")

    @property
    def volts_per_torque(self) -> float:
        """K = Rm/(kt N) [V/(N m)]."""
        return self.resistance / (self.torque_constant * self.gear_ratio)

    @property
    def volts_per_speed(self) -> float:
        """Back-EMF of the joint's speed, ke N [V s/rad]."""
        return self.back_emf * self.gear_ratio

    @property
    def inertia(self) -> float:
        """J = Jm N^2 [kg m^2]."""
        return self.rotor_inertia * self.gear_ratio**2

    @property
    def damping(self) -> float:
        """F_v = tau_v + ke kt N^2/Rm [N m s/rad]."""
        return self.viscous + self.volts_per_speed / self.volts_per_torque

    def actuator_model(self, joint: str) -> ActuatorModel:
        """The actuator of the module's docstring, for `ActuatorPlant`."""
        effects = [
            EffectValue("rotor_inertia", {"rotor_inertia": self.inertia}),
            EffectValue("viscous", {"viscous": self.damping}),
            EffectValue("coulomb", {"coulomb": self.coulomb}),
            EffectValue("elasticity", {"compliance": 1.0 / self.stiffness}),
        ]
        if math.isfinite(self.voltage_limit):
            effects.append(EffectValue("saturation", {"limit": self.voltage_limit}))
        return ActuatorModel(joint, Drive("voltage", self.volts_per_torque), tuple(effects))

    def scaled(self, **factors: float) -> "VoltageMotor":
        """The same with fields multiplied: what a controller believes that is wrong by so much.

        Raises:
            ParamsError: no such field, or a result that is not possible.
        """
        values: dict[str, Any] = {field.name: getattr(self, field.name) for field in fields(self)}
        for name, factor in factors.items():
            if name not in values:
                raise ParamsError(f"motor: no field {name!r}; fields: {', '.join(values)}")
            values[name] *= factor
        return VoltageMotor(**values)
