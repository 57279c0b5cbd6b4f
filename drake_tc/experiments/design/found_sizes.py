"""From which size on a designed motion shows an effect, by the rule with which a check judges logs."""

import math

import numpy as np

from drake_tc.experiments.check.contributions import Contribution, thinned
from drake_tc.experiments.check.visibility import Noise, smallest_sizes
from drake_tc.experiments.design.forms import EffectForm, Projection, declared_columns
from drake_tc.experiments.design.joint import BalanceColumns
from drake_tc.experiments.sizes import acts_through_shape, strengths
from drake_tc.types import FloatArray


def found_from(form: EffectForm, columns: BalanceColumns, noise: Noise) -> float:
    """Size that is found in 95 % of such runs: `check.visibility.smallest_sizes` over the shapes that a search tries.

    A size in which the balance is linear follows from one remainder; one that is a shape, such as a dead zone or the
    limit of a saturation, from the remainders at every size that a search would try. Infinite if no size is found,
    which includes a contribution that the declared model imitates up to rounding.

    Args:
        form: The effect with its shapes.
        columns: Of a motion or of logs.
        noise: Of as many rows as the run has.
    """
    smallest, _ = smallest_sizes(
        _contributions(form, columns),
        noise.least(form.effect.degrees_of_freedom),
        falling=form.size.falling,
        margin=noise.margin,
    )
    return smallest if smallest > 0.0 else math.inf


def _contributions(form: EffectForm, columns: BalanceColumns) -> list[Contribution]:
    """The contribution at each shape; rows carry their weights, so that the RMS is that of the rows in motion."""
    declared = Projection(declared_columns(columns), columns.weight)
    root = np.sqrt(columns.weight / np.mean(columns.weight))[:, None]
    to_mean = 1.0 / math.sqrt(float(np.mean(columns.weight)))
    if acts_through_shape(form.effect):
        sizes = strengths(form.effect, form.size, columns.joint.context)
        changes = form.at_sizes(columns, sizes)
        left = to_mean * declared.of(changes)
        whole = np.sqrt(np.mean((root * changes) ** 2, axis=0))
        return [_contribution(form, {}, sizes, left.T[:, None, :], whole)]
    out = []
    for shape in thinned(form.effect.shape_grid(columns.joint.context)):
        change = form.change(columns, shape) / form.strength
        left = to_mean * declared.of(change)
        whole = np.array([np.sqrt(np.mean((root * change) ** 2))])
        out.append(_contribution(form, dict(shape), np.ones(1), left.T[None], whole))
    return out


def _contribution(
    form: EffectForm, shape: dict[str, float], sizes: FloatArray, remainders: FloatArray, whole: FloatArray
) -> Contribution:
    nothing = np.zeros(0)
    return Contribution(form.effect, shape, sizes, remainders, whole, nothing, nothing)
