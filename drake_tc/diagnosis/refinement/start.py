"""Where the refinement starts: the equation error's numbers, but not those that its rows cannot tell.

The rows of the equation are those in motion. A Stribeck velocity below their speeds, or the time constant of a winding
that hardly warms, ends at a bound or beyond all sense there, where a search from it would not find the way back.
"""

import math
from dataclasses import replace

import numpy as np

from drake_tc.actuation.model import ActuatorModel, EffectValue
from drake_tc.effects.base import Context
from drake_tc.effects.plausibility import plausible_range

STARTING_SHARE = 0.1
"""A coefficient without a usable estimate starts at this share of the largest value that is physically possible."""


def start_of(model: ActuatorModel, context: Context) -> ActuatorModel:
    """The model with every effect of undetermined shape in the middle of the values that a search would try.

    Args:
        model: With 95 % intervals, as the equation error gives it.
        context: What the training rows span.
    """
    return replace(model, effects=tuple(_started(value, context) for value in model.effects))


def is_open(value: EffectValue) -> bool:
    """Whether the equation error leaves a shape of the effect undetermined: at a bound, or not to a factor of 2."""
    for parameter in value.effect.shapes:
        if parameter.name not in value.ci95:
            continue
        number, (low, high) = value.parameters[parameter.name], value.ci95[parameter.name]
        half = max(high - number, number - low)
        if parameter.name in value.at_bound or not 0.0 < half <= abs(number):
            return True
    return False


def _started(value: EffectValue, context: Context) -> EffectValue:
    if not is_open(value):
        return value
    grid = value.effect.shape_grid(context)
    numbers = dict(value.parameters)
    for parameter in value.effect.shapes:
        if parameter.name in value.ci95 and parameter.name in grid[0]:
            numbers[parameter.name] = _middle([shape[parameter.name] for shape in grid])
    for parameter in value.effect.coefficients:
        rests = parameter.name in value.at_bound or numbers.get(parameter.name) == 0.0
        most = plausible_range(parameter, context)[1]
        if parameter.name in value.ci95 and rests and parameter.lower >= 0.0 and math.isfinite(most):
            numbers[parameter.name] = STARTING_SHARE * most
    points = {name: (numbers[name], numbers[name]) for name in value.ci95}
    return EffectValue(value.key, numbers, points)


def _middle(values: list[float]) -> float:
    """Between the smallest and the largest, by their ratio where they are positive."""
    low, high = min(values), max(values)
    return math.sqrt(low * high) if low > 0.0 else float(np.median(values))
