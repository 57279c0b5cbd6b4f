"""Whether the fitted values of an effect are physically possible on this rig."""

import math
from collections.abc import Mapping

from drake_tc.effects.base import Effect
from drake_tc.effects.context import EFFORT_UNIT, Context
from drake_tc.effects.parameter import Parameter

ROUNDING = 1e-9
"""A value may pass a limit by this share of it: a fit that rests on a bound meets it up to rounding."""


def plausible_range(parameter: Parameter, context: Context) -> tuple[float, float]:
    """(lower, upper) of a parameter on this rig, in its own unit; infinite where nothing known limits it."""
    if parameter.plausible is None:
        return -math.inf, math.inf
    scale = context.scale(parameter.plausible.scale)
    low, high = (0.0 if x == 0.0 else x * scale for x in (parameter.plausible.lower, parameter.plausible.upper))
    return low, high


def implausible(effect: Effect, parameters: Mapping[str, float], context: Context) -> str:
    """Why an effect with these values cannot be the cause, or "" when it can.

    Each parameter is held against its `Parameter.plausible`, scaled by what the logs span, and then all of them
    against what the effect says of them together (`Effect.inconsistency`). A range that depends on something that
    `context` does not know (`torque_span`, `duration`, `fitted`) is infinite.

    Args:
        effect: The effect.
        parameters: Reported values by name, one for each of the effect's parameters.
        context: What the training logs span, with the fitted gain, viscous and Coulomb friction where they are known.

    Returns:
        One sentence with the value, the range and its source; empty when the values are possible.
    """
    for parameter in effect.parameters:
        if parameter.plausible is None:
            continue
        value = parameters[parameter.name]
        unit = parameter.unit.replace("effort", EFFORT_UNIT[context.drive])
        unit = "" if unit == "-" else f" {unit}"
        if not math.isfinite(value):
            return f"{parameter.name} of {effect.title} is {value}, which is not a finite number."
        low, high = plausible_range(parameter, context)
        if not low - ROUNDING * abs(low) <= value <= high + ROUNDING * abs(high):
            allowed = f"{low:.3g} to {high:.3g}{unit}" if math.isfinite(high) else f"{low:.3g}{unit} or more"
            return (
                f"{parameter.name} is {value:.3g}{unit}, outside the plausible range of {allowed}: "
                f"{parameter.plausible.source}."
            )
    return effect.inconsistency(parameters, context)
