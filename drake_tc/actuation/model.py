"""An actuator model: a drive and the physical effects between it and the link, as plain checked data.

The torque effects of a model, split by how a step and the compensation come to their parts.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar, get_args

import numpy as np

from drake_tc.config.joint_units import JointType
from drake_tc.effects.base import DriveEffect, DriveKind, Effect, SensorEffect, TorqueEffect, TransmissionEffect
from drake_tc.effects.kernel import EquationKernel, TorqueKernel, TorqueParts
from drake_tc.effects.library import effect
from drake_tc.errors import ParamsError
from drake_tc.kernels.torque_equations import CONSTANT
from drake_tc.types import FloatArray, IntArray

DRIVE_KINDS: tuple[str, ...] = get_args(DriveKind)

EffectT = TypeVar("EffectT", bound=Effect)


@dataclass(frozen=True)
class Drive:
    """What turns effort into torque: tau_motor = y*/K.

    Attributes:
        kind: `position_servo` (y = q_d - q [rad]), `current` (y = i [A]), `voltage` (y = V [V]) or
            `torque` (y = the commanded torque [N m]).
        gain: K > 0 [effort/(N m)]: K_tau of a servo, 1/K1 of a current drive, Rm/(kt N) of a voltage drive
            (Del Prete et al., 2016, eq. 6; Faraji et al., 2015, section II.A), 1 of a torque drive whose torque
            is the commanded one; the back-EMF is part of the viscous friction.

    Raises:
        ParamsError: another kind, or a gain that is not positive and finite.

    Example:
        >>> Drive("current", 0.4).gain
        0.4
    """

    kind: DriveKind
    gain: float

    def __post_init__(self) -> None:
        if self.kind not in DRIVE_KINDS:
            raise ParamsError(f"drive.kind: expected one of {', '.join(DRIVE_KINDS)}, got {self.kind!r}")
        if not (math.isfinite(self.gain) and self.gain > 0.0):
            raise ParamsError(f"drive.gain: expected a positive number [effort/(N m)], got {self.gain!r}")


@dataclass(frozen=True)
class EffectValue:
    """One effect with its numbers.

    Attributes:
        key: `id`, or `id.form` where the effect has several forms (`delay.command`).
        parameters: Name to value, one for each of the effect's parameters; missing ones take their default.
        ci95: Name to 95 % confidence interval, for the parameters that were identified.
        at_bound: Names of the identified parameters that rest on a bound.

    Raises:
        ParamsError: an unknown effect or parameter, or a value that is not finite or out of the parameter's bounds.

    Example:
        >>> EffectValue("viscous", {"viscous": 20.0}).effect.id
        'viscous'
    """

    key: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    ci95: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    at_bound: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        known = {p.name: p for p in self.effect.parameters}
        for what, names in (("", self.parameters), ("ci95.", self.ci95), ("at_bound.", self.at_bound)):
            unknown = sorted(set(names) - set(known))
            if unknown:
                raise ParamsError(
                    f"{self.key}.{what}{unknown[0]}: no such parameter; parameters of {self.key}: {', '.join(known)}"
                )
        values = {name: float(self.parameters.get(name, p.default)) for name, p in known.items()}
        for name, value in values.items():
            parameter = known[name]
            if math.isnan(value) or (math.isinf(value) and value != parameter.default):
                raise ParamsError(f"{self.key}.{name}: expected a finite number [{parameter.unit}], got {value}")
            if not parameter.lower <= value <= parameter.upper:
                raise ParamsError(
                    f"{self.key}.{name}: expected {parameter.lower:g} to {parameter.upper:g}, got {value:g}"
                    f" [{parameter.unit}]"
                )
        object.__setattr__(self, "parameters", values)

    @property
    def effect(self) -> Effect:
        """The effect itself.

        Raises:
            ParamsError: there is none of that name; the message lists those there are.
        """
        return effect(self.key)


@dataclass(frozen=True)
class ActuatorModel:
    """One joint's actuator: the torque balance of `drake_tc.effects.base`, with numbers.

    Drive effects act in the order in which they are listed, those on the command first. Torques are true torques: a
    sensor effect says what the log shows instead, and leaves the drive gain and the friction as they are.

    Attributes:
        joint: The joint's name.
        drive: The drive.
        effects: Effects with their numbers.
        joint_type: Whether the joint turns or slides: the units are then those of `drake_tc.config.joint_units`.

    Example:
        >>> knee = ActuatorModel("knee", Drive("position_servo", 2e-4), (EffectValue("viscous", {"viscous": 20.0}),))
        >>> knee.torque_effects[0][0].id
        'viscous'
    """

    joint: str
    drive: Drive
    effects: tuple[EffectValue, ...] = ()
    joint_type: JointType = "revolute"

    def _pick(self, kind: type[EffectT]) -> tuple[tuple[EffectT, Mapping[str, float]], ...]:
        pairs = ((value.effect, value.parameters) for value in self.effects)
        return tuple((effect, parameters) for effect, parameters in pairs if isinstance(effect, kind))

    @property
    def torque_effects(self) -> tuple[tuple[TorqueEffect, Mapping[str, float]], ...]:
        """Effects that cost torque, with their parameters."""
        return self._pick(TorqueEffect)  # type: ignore[type-abstract]

    @property
    def drive_effects(self) -> tuple[tuple[DriveEffect, Mapping[str, float]], ...]:
        """Effects between command and drive torque, with their parameters, in the order in which they act."""
        return self._pick(DriveEffect)  # type: ignore[type-abstract]

    @property
    def sensor_effects(self) -> tuple[tuple[SensorEffect, Mapping[str, float]], ...]:
        """Errors of the sensors, with their parameters."""
        return self._pick(SensorEffect)  # type: ignore[type-abstract]

    @property
    def transmission_effects(self) -> tuple[tuple[TransmissionEffect, Mapping[str, float]], ...]:
        """Play and softness of the gear, with their parameters."""
        return self._pick(TransmissionEffect)  # type: ignore[type-abstract]

    @property
    def inertia(self) -> float:
        """Reflected inertia [kg m^2] on the actuator's side: rotor and unmodelled payload."""
        return sum(effect.inertia(parameters) for effect, parameters in self.torque_effects)


class ResistanceLaw(NamedTuple):
    """What one torque effect resists with, where that changes.

    Attributes:
        kernel: Of the effect.
        travel: Over which its own hysteretic state turns over [rad]; 0 where it has none.
    """

    kernel: TorqueKernel
    travel: float


def split_parts(model: ActuatorModel) -> tuple[TorqueParts, tuple[ResistanceLaw, ...]]:
    """The sum of a model's constant parts, and the effects that have to be evaluated at every instant."""
    level = damping = rest = 0.0
    changing = []
    for each, parameters in model.torque_effects:
        kernel = each.kernel(parameters)
        if isinstance(kernel, EquationKernel) and kernel.kind == CONSTANT:
            a, b, c = kernel.numbers
            level, damping, rest = level + a, damping + b, rest + c
        else:
            changing.append(ResistanceLaw(kernel, each.hysteresis_travel(parameters)))
    return (level, damping, rest), tuple(changing)


def term_tables(terms: Sequence[tuple[EquationKernel, int]]) -> tuple[IntArray, FloatArray]:
    """(E, 4) rows of torque effects (`drake_tc.kernels.joint_layout`) and their numbers, one behind the other.

    Args:
        terms: Each with the place of its hysteretic state, or -1.
    """
    ends = np.cumsum([len(kernel.numbers) for kernel, _ in terms], dtype=np.int64).tolist()
    rows = [
        (kernel.kind, first, end, state) for (kernel, state), first, end in zip(terms, [0, *ends], ends, strict=False)
    ]
    values = [number for kernel, _ in terms for number in kernel.numbers]
    return np.array(rows, dtype=np.int64).reshape(-1, 4), np.array(values, dtype=np.float64)
