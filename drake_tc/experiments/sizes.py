"""How large an effect is: one number by which its strength is told, and what that number does to the torque balance.

A check asks how small an effect may be and still be found, a design which effects it shall show, and a rehearsal how
much of an effect to put in. All three use the number that `size_of` names, which is a parameter that reports show.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from drake_tc.config.joint_units import JointUnits
from drake_tc.effects.base import Context, DriveEffect, Effect
from drake_tc.effects.library import LIBRARY
from drake_tc.types import FloatArray

PAYLOAD_ARM = 0.035
"""Inertia over first moment of a typical payload [kg m^2/(N m)]: a point mass at 0.35 m has l/g."""


@dataclass(frozen=True)
class JointNumbers:
    """The declared model of a joint in numbers, with which sizes are compared.

    Attributes:
        gain: K [effort/(N m)].
        viscous: F_v [N m s/rad], at least 0.
        coulomb: F_c [N m], at least 0.
        inertia: Rotor and link together [kg m^2].
        torque: Largest torque that the motor delivers [N m].
        effort: Largest effort.
        speed: Largest speed [rad/s].
        span: Positions that the motion covers [rad].
        rotor: Of `inertia`, the rotor's part, declared or fitted [kg m^2].
    """

    gain: float
    viscous: float
    coulomb: float
    inertia: float
    torque: float
    effort: float
    speed: float
    span: float
    rotor: float = 0.0


@dataclass(frozen=True)
class Size:
    """The number that tells how strong an effect is.

    Attributes:
        name: Of the parameter, as in reports.
        unit: With the drive's own unit in place of "effort".
        typical: Size from which on the effect matters to the user of a model.
        in_shape: Whether it is a shape parameter, in which the balance is not linear.
        falling: Whether a smaller number is a stronger effect (the limit of a saturation).
    """

    name: str
    unit: str
    typical: float
    in_shape: bool = False
    falling: bool = False


NAMES: Mapping[str, tuple[str, str]] = {
    "payload.declared_gain": ("payload_share", "-"),
    "payload.sliding": ("payload_mass", "kg*m^2"),
    "elasticity": ("compliance", "rad/(N*m)"),
    "velocity_sign_switch": ("switch", "-"),
    "servo_integrator": ("integral_rate", "1/s"),
    "torque_ripple": ("amplitude", "N*m"),
    "position_dependent_friction": ("amplitude", "N*m"),
    "encoder_eccentricity.shared": ("amplitude", "rad"),
    "encoder_eccentricity.separate": ("amplitude", "rad"),
    "encoder_ripple": ("amplitude", "rad"),
    "position_dependent_load": ("level", "N*m"),
    "directional_efficiency": ("mean_load_friction", "-"),
    "winding_temperature": ("back_emf_damping", "N*m*s/rad"),
}
"""Size of the effects whose size is not simply their first parameter: name and unit."""


def size_name(effect: Effect) -> tuple[str, str]:
    """Name and unit of the number that tells how strong an effect is."""
    parameter = effect.parameters[0] if effect.parameters else None
    return NAMES.get(effect.key, (parameter.name, parameter.unit) if parameter else ("size", "-"))


def sizes_found(parameters: Mapping[str, Mapping[str, float | None]]) -> dict[str, float]:
    """Sizes of effects by id, without their signs, from their parameters as a report lists them by id."""
    out = {}
    for member in LIBRARY:
        value = parameters.get(member.id, {}).get(size_name(member)[0])
        if value:
            out[member.id] = abs(float(value))
    return out


def size_of(effect: Effect, numbers: JointNumbers, context: Context, units: JointUnits | None = None) -> Size:
    """Name, unit and typical value of an effect's size on a joint; `units` are those of the context if not given.

    The typical value is a tenth of the joint's own friction or about 5 % of its torque, a delay or a lag of 3 ms, and a
    play of the gear of 1 mrad or 0.1 mm, unless less than that costs 5 % of the torque of a stiff servo.
    """
    name, unit = size_name(effect)
    in_shape = not effect.coefficients and bool(effect.shapes)
    if effect.key == "current_lag.winding":
        in_shape, name, unit = True, "lag", "s"
    unit = (context.units if units is None else units).of(unit)
    typical = _typical(effect.key, numbers, context)
    return Size(name, unit, typical, in_shape, effect.id == "saturation")


def _typical(key: str, n: JointNumbers, context: Context) -> float:
    """The typical size; 5 % of the largest torque in the effect's own unit where no other is listed."""
    part = 0.05 * n.torque
    friction = 0.2 * n.coulomb if n.coulomb > 0.02 * n.torque else part
    speed, duration = max(n.speed, 1e-9), context.duration if math.isfinite(context.duration) else 30.0
    play = 1e-4 if context.units.slides else 1e-3
    values = {
        "rotor_inertia": 0.1 * n.inertia if n.inertia > 0.0 else part / max(speed, 1.0),
        "stribeck": 2.0 * friction,
        "quadratic_viscous": max(part, 0.2 * n.viscous * speed) / speed**2,
        "torque_sensor_bias": friction,
        "effort_bias": friction,
        "encoder_offset": n.gain * part if context.drive == "position_servo" else 0.01,
        "deadzone": 0.05 * n.effort,
        "saturation": 0.8 * n.effort,
        "saturation.supply": 0.8 * n.effort / max(context.supply_voltage, 1.0) if context.supply_voltage > 0.0 else 0.0,
        "load_dependent_friction": 0.1,
        "torque_sensor_drift": friction / duration,
        "torque_sensor_gain": 0.1,
        "velocity_sign_switch": 0.05,
        "servo_integrator": 0.2,
        "delay.command": 3e-3,
        "delay.loop": 3e-3,
        "delay.torque_sensor": 3e-3,
        "delay.position_sensor": 3e-3,
        "current_lag": 3e-3,
        "current_lag.winding": 3e-3,
        "payload": part,
        "payload.sliding": 0.1 * n.inertia if n.inertia > 0.0 else part,
        "cable_spring.beside_weight": 2.0 * part / max(n.span, 1e-9),
        "cable_spring": 2.0 * part / max(n.span, 1e-9),
        "asymmetric_friction": friction,
        "asymmetric_friction.coulomb": friction,
        "thermal_friction": 0.01 * max(n.coulomb, part),
        "presliding_hysteresis": 2.0 * friction,
        "torque_ripple": friction,
        "position_dependent_friction": friction,
        "position_dependent_friction.linear": 2.0 * friction / max(n.span, 1e-9),
        "backlash": min(play, n.gain * 2.0 * part) if context.drive == "position_servo" else play,
        "elasticity": 0.1 * n.gain,
        "encoder_eccentricity.shared": n.gain * part if context.drive == "position_servo" else 2e-3,
        "encoder_eccentricity.separate": 2e-3,
        "encoder_ripple": 1e-3,
        "directional_efficiency": 0.1,
        "position_dependent_load": part,
    }
    return values.get(key, part)


def directions(effect: Effect, numbers: JointNumbers) -> tuple[FloatArray, ...]:
    """Coefficients theta (k,) of size 1: one for each phase or place that the effect may have, all equally likely.

    Empty for an effect whose size is a shape parameter.
    """
    count, k = len(effect.coefficients), numbers.gain
    if not count:
        return ()
    ratio = numbers.viscous / numbers.coulomb if numbers.coulomb > 0.0 else 0.0
    known: Mapping[str, tuple[float, ...]] = {
        "payload": (1.0, PAYLOAD_ARM),
        "payload.sliding": (0.0, 1.0),
        "elasticity": (1.0, 1.0 / k),
        "asymmetric_friction": (1.0, ratio),
        "thermal_friction": (-1.0, -ratio),
        "velocity_sign_switch": (1.0 / k,),
        "servo_integrator": (1.0 / k,),
        "directional_efficiency": (1.0, 0.0),
    }
    if effect.key == "cable_spring":  # at rest in the middle, or at an end of the travel
        return tuple(np.array([1.0, share * numbers.span]) for share in (0.0, -0.5, 0.5))
    if effect.key in known:
        return (np.array(known[effect.key]),)
    if count == 1:
        return (np.ones(1),)
    return tuple(np.eye(count))


def strengths(effect: Effect, size: Size, context: Context) -> FloatArray:
    """Sizes (g,) of an effect whose size is a shape parameter, weakest first, that a search would try."""
    values = sorted({float(shape[size.name]) for shape in effect.shape_grid(context)})
    return np.array(values[::-1] if size.falling else values)


def acts_through_shape(effect: Effect) -> bool:
    """Whether an effect changes the effort and adds no column (delay, lag, dead zone, saturation)."""
    return isinstance(effect, DriveEffect) and not effect.coefficients and bool(effect.shapes)


def is_late(effect: Effect) -> bool:
    """Whether the effect is a delay or a lag of the drive."""
    return isinstance(effect, DriveEffect) and effect.id in ("delay", "current_lag")
