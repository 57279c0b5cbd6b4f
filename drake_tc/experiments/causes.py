"""Effects as the independent simulator (`joint_simulator`) has them: from size to the numbers of a cause, and back.

The simulator shares no formula with the effects; this table is the only place at which the two meet, and it holds
nothing but names and units.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from drake_tc.effects.library import effect
from drake_tc.errors import ParamsError
from drake_tc.joint_simulator.amplitudes import draw_cause
from drake_tc.joint_simulator.spec import Joint, RigSpec
from drake_tc.types import GRAVITY

Values: TypeAlias = Mapping[str, float]
NEAR_AXIS = 0.02
"""Where a payload of a given size hangs, as a share of the pendulum's length; its own inertia is then negligible."""


@dataclass(frozen=True)
class Cause:
    """How a cause's numbers give the size of the effect that it is.

    Attributes:
        name: Of the cause in the simulator.
        amplitude: Its parameter that grows with the size.
        per_amplitude: (numbers, joint, pendulum) to the size divided by the amplitude.
    """

    name: str
    amplitude: str
    per_amplitude: Callable[[Values, Joint, tuple[float, float] | None], float]


def _one(v: Values, j: Joint, p: object) -> float:
    return 1.0


def _gain(v: Values, j: Joint, p: object) -> float:
    return j.gain


def _payload(v: Values, j: Joint, p: tuple[float, float] | None) -> float:
    """M g l; on a pendulum the moment of a mass near the axis with which inertia and moment have the same ratio."""
    moment = GRAVITY * v["arm"]
    if p is None:
        return moment
    inertia = j.rotor_inertia + j.link_inertia
    return (moment - j.gravity * v["arm"] ** 2 / inertia) / (1.0 + v["mass"] * v["arm"] ** 2 / inertia)


CAUSES: Mapping[str, Cause] = {
    "rotor_inertia": Cause("rotor_inertia", "inertia", _one),
    "stribeck": Cause("stribeck", "excess", _one),
    "quadratic_viscous": Cause("quadratic_viscous", "b2", _one),
    "load_dependent_friction": Cause("load_dependent_friction", "mu", _one),
    "asymmetric_friction": Cause("asymmetric_friction", "delta", lambda v, j, p: v["share"] * j.coulomb),
    "presliding_hysteresis": Cause("presliding_hysteresis", "share", lambda v, j, p: j.coulomb),
    "position_dependent_friction": Cause("position_dependent_friction", "alpha", lambda v, j, p: j.coulomb),
    "thermal_friction": Cause("thermal_friction", "rate", lambda v, j, p: v["coulomb_share"] * j.coulomb),
    "torque_ripple": Cause("torque_ripple", "amplitude", _one),
    "cable_spring": Cause("cable_spring", "stiffness", _one),
    "backlash": Cause("backlash", "half_gap", lambda v, j, p: 2.0),
    "elasticity": Cause("elasticity", "compliance", _one),
    "deadzone": Cause("deadzone", "width", _gain),
    "saturation": Cause("saturation", "limit", _gain),
    "servo_integrator": Cause("servo_integrator", "rate", _one),
    "velocity_sign_switch": Cause("velocity_sign_switch", "delta", _one),
    "delay": Cause("delay", "delay", _one),
    "current_lag": Cause("current_lag", "time", _one),
    "payload": Cause("payload", "mass", _payload),
    "torque_sensor_bias": Cause("torque_sensor_bias", "bias", _one),
    "torque_sensor_gain": Cause("torque_sensor_gain", "error", _one),
    "torque_sensor_drift": Cause("torque_sensor_drift", "rate", _one),
    "encoder_offset": Cause("encoder_offset", "offset", _one),
    "encoder_eccentricity": Cause("encoder_eccentricity", "amplitude", _one),
}
"""By effect id."""


def cause_of(effect_id: str) -> Cause:
    """The cause that is an effect.

    Raises:
        ParamsError: An id that is no effect, or one that the simulator does not have.
    """
    known = effect(effect_id).id
    if known not in CAUSES:
        raise ParamsError(f"the simulator has no {known}; it has {', '.join(sorted(CAUSES))}")
    return CAUSES[known]


def cause_values(
    effect_id: str, size: float, joint: Joint, pendulum: tuple[float, float] | None, rng: np.random.Generator
) -> dict[str, float]:
    """The numbers of the cause at a size; the generator draws its other numbers (a ripple's phase).

    Raises:
        ParamsError: As `cause_of`.
    """
    cause = cause_of(effect_id)
    drawn = draw_cause(cause.name, rng, joint)
    if cause.name == "payload" and pendulum is not None:
        drawn["arm"] = NEAR_AXIS * pendulum[1]
    sign = -1.0 if drawn[cause.amplitude] < 0.0 else 1.0
    return drawn | {cause.amplitude: sign * size / cause.per_amplitude(drawn | {cause.amplitude: 0.0}, joint, pendulum)}


def size_in(spec: RigSpec, effect_id: str) -> float:
    """Size of an effect that a simulated rig has, its sign left out.

    Raises:
        ParamsError: As `cause_of`.
    """
    cause = cause_of(effect_id)
    values = spec.causes[cause.name]
    return abs(float(values[cause.amplitude]) * cause.per_amplitude(values, spec.joint, spec.pendulum))
