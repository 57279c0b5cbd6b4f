"""A position loop that is known by its data sheet, around a drive that was identified by its own effort.

Servos of one kind differ in their firmware's gain only. The motor is identified once, with the effort (voltage) as
command, from the runs at all gains; any gain then gives the model of a position servo,

    y = clip(g (q_d - q), -y_max, y_max)   =>   K' = K/g,   and every parameter in efforts is divided by g.
"""

import math
from dataclasses import dataclass, replace

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.errors import ParamsError


@dataclass(frozen=True)
class PositionLoop:
    """A proportional firmware law.

    Attributes:
        gain: g [effort/rad], > 0.
        limit: y_max [effort], > 0; infinite where there is none.

    Raises:
        ParamsError: a value that is not positive.
    """

    gain: float
    limit: float = math.inf

    def __post_init__(self) -> None:
        if not (math.isfinite(self.gain) and self.gain > 0.0):
            raise ParamsError(f"position loop: expected a positive gain [effort/rad], got {self.gain!r}")
        if not self.limit > 0.0:
            raise ParamsError(f"position loop: expected a positive limit [effort], got {self.limit!r}")


def through_loop(model: ActuatorModel, loop: PositionLoop) -> ActuatorModel:
    """The position servo that `loop` makes of a current or voltage drive; the loop clips before any drive effect.

    Args:
        model: Identified with the effort as command.
        loop: The firmware's law.

    Raises:
        ParamsError: the model is a position servo already.
    """
    if model.drive.kind == "position_servo":
        raise ParamsError(f"joint {model.joint!r}: expected a current or voltage drive to put in a loop, got a servo")
    scaled = tuple(_scaled(value, loop.gain) for value in model.effects)
    clip = (EffectValue("saturation", {"limit": loop.limit / loop.gain}),) if math.isfinite(loop.limit) else ()
    return replace(model, drive=Drive("position_servo", model.drive.gain / loop.gain), effects=(*clip, *scaled))


def _scaled(value: EffectValue, gain: float) -> EffectValue:
    units = {p.name: p.unit for p in value.effect.parameters}
    per = {name: gain if units[name].startswith("effort") else 1.0 for name in value.parameters}
    numbers = {name: number / per[name] for name, number in value.parameters.items()}
    intervals = {name: (low / per[name], high / per[name]) for name, (low, high) in value.ci95.items()}
    return replace(value, parameters=numbers, ci95=intervals)
