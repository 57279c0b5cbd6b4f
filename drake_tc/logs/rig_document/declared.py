"""The rig file's key `declared`: the effects that the user already models, with values where they are known.

Effects of the library that a rig file may declare; `logs` must not import the library, so a test compares the two.

Effects of other packages are known by their names in `drake_tc.extensions.EFFECTS`.
"""

import re
from collections.abc import Mapping
from typing import Annotated, TypeAlias

from pydantic import AfterValidator, Discriminator, Tag, WithJsonSchema

from drake_tc.config.keys import saying
from drake_tc.config.quoted import did_you_mean, quoted
from drake_tc.extensions import EFFECTS
from drake_tc.simulator_files.read import ENDINGS

EFFECT_IDS = (
    *("viscous", "coulomb", "rotor_inertia", "stribeck", "quadratic_viscous", "load_dependent_friction"),
    *("asymmetric_friction", "presliding_hysteresis", "position_dependent_friction", "thermal_friction"),
    *("torque_ripple", "cable_spring", "backlash", "elasticity", "deadzone", "saturation", "servo_integrator"),
    *("velocity_sign_switch", "delay", "current_lag", "payload", "torque_sensor_bias", "torque_sensor_gain"),
    *("torque_sensor_drift", "effort_bias", "encoder_offset", "encoder_eccentricity", "encoder_ripple"),
    *("directional_efficiency", "position_dependent_load", "supply_sag", "winding_temperature", "servo_gain"),
    "static_friction",
    *("load_stribeck", "drive_compression", "winding_heat", "load_tilt", "gain_ripple"),
    *("saturation.servo", "current_lag.command"),
)

ROBOT_CAUSES = ("link_mass", "link_com", "ft_bias", "ft_gain", "imu_bias")
"""Causes that no single joint owns; they can be found, but not declared."""


def _known_effect(name: str) -> str:
    if name in ROBOT_CAUSES:
        raise ValueError(
            f"{quoted(name)} is a cause of the whole robot and cannot be declared; `sensors` takes tolerances"
        )
    known = (*EFFECT_IDS, *EFFECTS.names())
    if name not in known:
        raise ValueError(f"unknown effect {quoted(name)}{did_you_mean(name, known)}; known: {', '.join(known)}")
    return name


EffectId = Annotated[
    str,
    saying("the id of an effect"),
    AfterValidator(_known_effect),
    WithJsonSchema({"type": "string", "enum": list(EFFECT_IDS)}),
]
Declared: TypeAlias = Mapping[str, float | None]
Value: TypeAlias = Annotated[float, saying("a number, or nothing for 'value unknown'")] | None


def _value_shape(value: object) -> str:
    return "@parameters" if isinstance(value, Mapping) else "@value"


Values: TypeAlias = Annotated[
    Annotated[Value, Tag("@value")] | Annotated[dict[str, Value], Tag("@parameters")], Discriminator(_value_shape)
]


def _not_negative(values: dict[str, Values]) -> dict[str, Values]:
    inertia = values.get("rotor_inertia")
    if isinstance(inertia, Mapping):
        inertia = inertia.get("rotor_inertia")
    if inertia is not None and inertia < 0:
        raise ValueError(f"rotor_inertia: expected a value >= 0 kg m^2, got {quoted(inertia)}")
    return values


def _shape(value: object) -> str | None:
    if isinstance(value, Mapping):
        return "@values"
    if isinstance(value, list):
        return "@list"
    return "@file" if isinstance(value, str) and is_file(value) else "@name"


def is_file(entry: str) -> bool:
    """Whether the text names a file of another simulator, and not an effect."""
    return entry.lower().endswith(ENDINGS)


DeclaredFile = Annotated[
    str,
    saying("a file of another simulator"),
    WithJsonSchema({"type": "string", "pattern": f"({'|'.join(re.escape(ending) for ending in ENDINGS)})$"}),
]


DeclaredEntry: TypeAlias = Annotated[
    Annotated[EffectId, Tag("@name")]
    | Annotated[DeclaredFile, Tag("@file")]
    | Annotated[list[EffectId], Tag("@list")]
    | Annotated[dict[EffectId, Values], AfterValidator(_not_negative), Tag("@values")],
    Discriminator(_shape),
]


def declared_of(entry: str | list[str] | dict[str, Values] | None) -> dict[str, float | None]:
    """`id` and `id.parameter` to the known value, or None; viscous and Coulomb friction are always in it.

    What a file declares is not in it: `drake_tc.logs.rig_document.declared_file` adds it to the rig.
    """
    declared: dict[str, float | None] = {"viscous": None, "coulomb": None}
    if isinstance(entry, str) and is_file(entry):
        return declared
    if isinstance(entry, str):
        entry = [entry]
    if isinstance(entry, list):
        return declared | dict.fromkeys(entry)
    for name, value in (entry or {}).items():
        if isinstance(value, Mapping):
            declared |= {name: None} | {f"{name}.{parameter}": number for parameter, number in value.items()}
        else:
            declared[name] = value
    return declared
