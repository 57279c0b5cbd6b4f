"""How large an effect is: one number by which its strength is told, and what that number does to the torque balance.

A check asks how small an effect may be and still be found, a design which effects it shall show, and a rehearsal how
much of an effect to put in. All three use the number that `size_of` names, which is a parameter that reports show.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from drake_tc.config.joint_units import JointUnits
from drake_tc.effects.base import Context, DriveEffect, Effect, JointNumbers
from drake_tc.effects.library import LIBRARY
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class Size:
    """The number that tells how strong an effect is.

    Attributes:
        name: Of the parameter, as in reports.
        unit: With the drive's own unit in place of "effort".
        typical: Size from which on the effect matters to the user of a model.
        in_shape: Whether it is a shape parameter, in which the balance is not linear (a delay, a dead zone).
        falling: Whether a smaller number is a stronger effect (the limit of a saturation).
    """

    name: str
    unit: str
    typical: float
    in_shape: bool = False
    falling: bool = False

    def text(self, value: float, digits: int = 3) -> str:
        """A value of it with its unit."""
        return f"{value:.{digits}g} {self.unit}".removesuffix(" -")


def size_name(effect: Effect) -> tuple[str, str]:
    """Name and unit of the number that tells how strong an effect is."""
    parameter = effect.parameters[0] if effect.parameters else None
    return effect.size or ((parameter.name, parameter.unit) if parameter else ("size", "-"))


def sizes_found(parameters: Mapping[str, Mapping[str, float | None]]) -> dict[str, float]:
    """Sizes of effects by id, without their signs, from their parameters as a report lists them by id."""
    out = {}
    for member in LIBRARY:
        value = parameters.get(member.id, {}).get(size_name(member)[0])
        if value:
            out[member.id] = abs(float(value))
    return out


def size_of(effect: Effect, numbers: JointNumbers, context: Context, units: JointUnits | None = None) -> Size:
    """Name, unit and typical value of an effect's size on a joint; `units` are those of the context if not given."""
    name, unit = size_name(effect)
    in_shape = not effect.coefficients and bool(effect.shapes)
    if effect.key == "current_lag.winding":
        in_shape, name, unit = True, "lag", "s"
    unit = (context.units if units is None else units).of(unit)
    return Size(name, unit, effect.typical_size(numbers, context), in_shape, effect.id == "saturation")


def strengths(effect: Effect, size: Size, context: Context) -> FloatArray:
    """Sizes (g,) of an effect whose size is a shape parameter, weakest first, that a search would try."""
    values = sorted({float(shape[size.name]) for shape in effect.shape_grid(context)})
    return np.array(values[::-1] if size.falling else values)


def is_late(effect: Effect) -> bool:
    """Whether the effect is a delay or a lag of the drive."""
    return isinstance(effect, DriveEffect) and effect.id in ("delay", "current_lag")
