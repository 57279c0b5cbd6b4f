"""Whether the fitted values of an effect are physically possible on this rig."""

import math
from collections.abc import Mapping

from drake_tc.effects.base import Effect
from drake_tc.effects.context import Context
from drake_tc.effects.parameter import Parameter, Plausible, Scale

FRICTION: Mapping[Scale, str] = {"coulomb": "Coulomb", "viscous": "viscous"}
"""Quantities that limit a parameter and that a fit may make 0."""
ROUNDING = 1e-9
"""A value may pass a limit by this share of it: a fit that rests on a bound meets it up to rounding."""


def plausible_range(parameter: Parameter, context: Context) -> tuple[float, float]:
    """(lower, upper) of a parameter on this rig, in its own unit; infinite where nothing known limits it."""
    if parameter.plausible is None:
        return -math.inf, math.inf
    plausible = parameter.plausible.on(context.joint_type)
    scale = context.scale(plausible.scale)
    lower, upper = plausible.lower, plausible.upper
    low, high = (0.0 if 0.0 in (x, scale) else x * scale for x in (lower, upper))  # 0 times infinity, and no -0
    return low, high


def implausible(effect: Effect, parameters: Mapping[str, float], context: Context) -> str:
    """Why an effect with these values cannot be the cause, or "" when it can.

    An effect whose sizes are all 0 explains something else, as by the noise of a channel that it differentiates. Each
    parameter is held against its `Parameter.plausible`, scaled by what the logs span, and then all of them
    against what the effect says of them together (`Effect.inconsistency`). A range that depends on something that
    `context` does not know (`torque_span`, `duration`, `fitted`) is infinite.

    Args:
        effect: The effect.
        parameters: Reported values by name, one for each of the effect's parameters.
        context: What the training logs span, with the fitted gain, viscous and Coulomb friction where they are known.

    Returns:
        One sentence with the value, the range and its source; empty when the values are possible.
    """
    sizes = [p.name for p in effect.parameters if p not in (*effect.shapes, *effect.given_shapes)]
    if sizes and all(parameters[name] == 0.0 for name in sizes):
        names, verb = " and ".join(sizes), "is" if len(sizes) == 1 else "are"
        return (
            f"{names} of {effect.title} {verb} 0 in the fit that chose this effect: the lower error has another cause."
        )
    for parameter in effect.parameters:
        if parameter.plausible is None:
            continue
        value = parameters[parameter.name]
        unit = context.units.of(parameter.unit)
        unit = "" if unit == "-" else f" {unit}"
        if not math.isfinite(value):
            return f"{parameter.name} of {effect.title} is {value}, which is not a finite number."
        low, high = plausible_range(parameter, context)
        if not low - ROUNDING * abs(low) <= value <= high + ROUNDING * abs(high):
            possible = _allowed(parameter.plausible.on(context.joint_type), low, high, unit)
            return f"{parameter.name} is {value:.3g}{unit}; {possible}."
    return context.units.text(effect.inconsistency(parameters, context))


def _allowed(plausible: Plausible, low: float, high: float, unit: str) -> str:
    """What is possible, and why; a range that a quantity of the rig has shrunk to nothing names that quantity."""
    if low == high == 0.0 and plausible.scale in FRICTION:
        limit = f"the fitted {FRICTION[plausible.scale]} friction, which limits it, is 0"
    elif math.isfinite(high):
        limit = f"its plausible range is {low:.3g} to {high:.3g}{unit}"
    else:
        limit = f"its plausible range is {low:.3g}{unit} or more"
    return f"{limit}: {plausible.source}"
