"""From which size on a designed motion shows an effect, by the expected log odds with which a check judges logs."""

import math

import numpy as np

from drake_tc.experiments.check.joint import Noise
from drake_tc.experiments.design.forms import EffectForm, Projection, declared_columns
from drake_tc.experiments.design.joint import BalanceColumns
from drake_tc.experiments.log_odds import CERTAIN, MOST_SHAPES, NUMERICAL, SHAPES_SEEN, crossing
from drake_tc.experiments.sizes import acts_through_shape, strengths


def found_from(form: EffectForm, columns: BalanceColumns, noise: Noise) -> float:
    """Size that is found in 95 % of such runs at most of the shapes that a search tries; infinite if none is.

    Args:
        form: The effect with its shapes.
        columns: Of a motion or of logs.
        noise: Of as many rows as the run has.
    """
    declared = Projection(declared_columns(columns), columns.weight)
    root = np.sqrt(columns.weight)[:, None]
    rows = math.sqrt(columns.weight.size * float(np.mean(columns.weight)))
    least = noise.least(form.effect.degrees_of_freedom, CERTAIN)
    if acts_through_shape(form.effect):
        sizes = strengths(form.effect, form.size, columns.joint.context)
        left = np.linalg.norm(declared.of(form.at_sizes(columns, sizes)), axis=0) / rows
        return crossing(sizes, left / least) or math.inf
    grid, found = form.effect.shape_grid(columns.joint.context), []
    for shape in grid[:: max(1, -(-len(grid) // MOST_SHAPES))]:
        change = form.change(columns, shape) / form.strength
        left, whole = (float(np.sqrt(np.mean(np.sum(c**2, axis=0)))) for c in (declared.of(change), root * change))
        found.append(least * rows / left if left > NUMERICAL * whole else math.inf)
    return sorted(found)[min(math.ceil(SHAPES_SEEN * len(found)), len(found)) - 1]
