"""Effects as the independent simulator (`joint_simulator`) has them: from size to the numbers of a cause, and back.

The simulator shares no formula with the effects; this table is the only place at which the two meet, and it holds
nothing but names and units.
"""

from collections.abc import Callable, Mapping
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


PerAmplitude: TypeAlias = Callable[[Values, Joint, tuple[float, float] | None], float]
"""(numbers of a cause, joint, mass and length of its pendulum) to the effect's size over the cause's amplitude."""


def _one(v: Values, j: Joint, p: object) -> float:
    return 1.0


def _gain(v: Values, j: Joint, p: object) -> float:
    return j.gain


def _coulomb(v: Values, j: Joint, p: object) -> float:
    return j.coulomb


def _payload(v: Values, j: Joint, p: tuple[float, float] | None) -> float:
    """M g l; on a pendulum the moment of a mass near the axis with which inertia and moment have the same ratio."""
    moment = GRAVITY * v["arm"]
    if p is None:
        return moment
    inertia = j.rotor_inertia + j.link_inertia
    return (moment - j.gravity * v["arm"] ** 2 / inertia) / (1.0 + v["mass"] * v["arm"] ** 2 / inertia)


CAUSES: Mapping[str, tuple[str, PerAmplitude]] = {
    "rotor_inertia": ("inertia", _one),
    "stribeck": ("excess", _one),
    "quadratic_viscous": ("b2", _one),
    "load_dependent_friction": ("mu", _one),
    "asymmetric_friction": ("delta", lambda v, j, p: v["share"] * j.coulomb),
    "presliding_hysteresis": ("share", _coulomb),
    "position_dependent_friction": ("alpha", _coulomb),
    "thermal_friction": ("rate", lambda v, j, p: v["coulomb_share"] * j.coulomb),
    "torque_ripple": ("amplitude", _one),
    "cable_spring": ("stiffness", _one),
    "backlash": ("half_gap", lambda v, j, p: 2.0),
    "elasticity": ("compliance", _one),
    "deadzone": ("width", _gain),
    "saturation": ("limit", _gain),
    "servo_integrator": ("rate", _one),
    "velocity_sign_switch": ("delta", _one),
    "delay": ("delay", _one),
    "current_lag": ("time", _one),
    "payload": ("mass", _payload),
    "torque_sensor_bias": ("bias", _one),
    "torque_sensor_gain": ("error", _one),
    "torque_sensor_drift": ("rate", _one),
    "encoder_offset": ("offset", _one),
    "encoder_eccentricity": ("amplitude", _one),
}
"""By effect id, which is the name of the cause too: its number that grows with the size, and the ratio of both."""


def cause_of(effect_id: str) -> str:
    """Name of the cause that is an effect.

    Raises:
        ParamsError: An id that is no effect, or one that the simulator does not have.
    """
    known = effect(effect_id).id
    if known not in CAUSES:
        raise ParamsError(f"the simulator has no {known}; it has {', '.join(sorted(CAUSES))}")
    return known


def cause_values(
    effect_id: str, size: float, joint: Joint, pendulum: tuple[float, float] | None, rng: np.random.Generator
) -> dict[str, float]:
    """The numbers of the cause at a size; the generator draws its other numbers (a ripple's phase).

    Raises:
        ParamsError: As `cause_of`.
    """
    name = cause_of(effect_id)
    amplitude, per_amplitude = CAUSES[name]
    drawn = draw_cause(name, rng, joint)
    if name == "payload" and pendulum is not None:
        drawn["arm"] = NEAR_AXIS * pendulum[1]
    sign = -1.0 if drawn[amplitude] < 0.0 else 1.0
    return drawn | {amplitude: sign * size / per_amplitude(drawn | {amplitude: 0.0}, joint, pendulum)}


def size_in(spec: RigSpec, effect_id: str) -> float:
    """Size of an effect that a simulated rig has, its sign left out.

    Raises:
        ParamsError: As `cause_of`.
    """
    name = cause_of(effect_id)
    amplitude, per_amplitude = CAUSES[name]
    values = spec.causes[name]
    return abs(float(values[amplitude]) * per_amplitude(values, spec.joint, spec.pendulum))
