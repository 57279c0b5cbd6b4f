"""What an experiment is expected to be worth: for each quantity, and in sentences."""

from dataclasses import dataclass

import numpy as np

from drake_tc.experiments.design.criteria import AllEffects, Criterion, Parameters
from drake_tc.experiments.design.discrimination import Discrimination
from drake_tc.experiments.design.found_sizes import found_from
from drake_tc.experiments.design.intervals import standard_deviations
from drake_tc.experiments.design.joint import BalanceColumns
from drake_tc.types import FloatArray

TOLD = 0.8
"""Probability of separating a pair of effects, below which the page says which limit prevents it."""


@dataclass(frozen=True)
class Expected:
    """What one quantity is worth before the experiment, with a growing sinusoid, and with the designed motion.

    Attributes:
        name, unit: Of the quantity.
        before: With the logs so far; NaN without logs.
        default: With a growing sinusoid of the same length and limits alone.
        after: With the designed motion alone.
    """

    name: str
    unit: str
    before: float
    default: float
    after: float


def expected_of(
    criterion: Criterion,
    before: BalanceColumns | None,
    default: BalanceColumns,
    designed: BalanceColumns,
    noun: str = "designed motion",
) -> tuple[tuple[Expected, ...], tuple[str, ...]]:
    """What an experiment is worth, and the same in sentences.

    Args:
        criterion: Of the goal.
        before: Rows of the logs so far; None where there are none.
        default: Rows of a growing sinusoid.
        designed: Rows of the experiment.
        noun: What a sentence calls the experiment.
    """
    if isinstance(criterion, Discrimination):
        return _of_discrimination(criterion, before, default, designed, noun)
    if isinstance(criterion, Parameters):
        return _of_parameters(criterion, before, default, designed, noun)
    if isinstance(criterion, AllEffects):
        return _of_everything(criterion, before, default, designed, noun)
    return (), ()


def _of_discrimination(
    criterion: Discrimination,
    before: BalanceColumns | None,
    default: BalanceColumns,
    designed: BalanceColumns,
    noun: str,
) -> tuple[tuple[Expected, ...], tuple[str, ...]]:
    given = ((before, None if before is None else before.seconds), (default, None), (designed, None))
    none = float("nan")
    chances = [none if c is None else criterion.probability(c, seconds) for c, seconds in given]
    rows = [Expected("probability that these runs alone distinguish them", "-", *chances)]
    found = [None if c is None else criterion.distances(c, seconds) for c, seconds in given]
    for truth, other in criterion.orders:
        key = truth.effect.key, other.effect.key
        values = [none if d is None else float(np.sqrt(np.min(d[key]))) for d in found]
        rows.append(Expected(f"{key[0]} fitted by {key[1]}: distance in standard deviations", "-", *values))
    seen = [None if c is None else criterion.visibilities(c, seconds) for c, seconds in given]
    for name in seen[-1] or ():
        values = [none if d is None else float(np.sqrt(np.min(d[name]))) for d in seen]
        rows.append(Expected(f"{name} not modelled: distance in standard deviations", "-", *values))
    names = " and ".join(
        f"{form.effect.key} ({form.strength:.3g} {form.size.unit})".replace(" -)", ")")
        for form in (criterion.orders[0][0], criterion.orders[0][1])
    )
    text = f"The {noun} distinguishes {names} with a probability of {100.0 * rows[0].after:.0f} %"
    text += f"; a growing sinusoid of the same length and limits does so with {100.0 * rows[0].default:.0f} %."
    more = [
        f"Where {truth} alone is the cause, no motion rules {other} out, which is the same function while the joint "
        f"slides: {proof}."
        for truth, other, proof in criterion.contained
    ]
    return tuple(rows), (text, *more)


def _of_parameters(
    criterion: Parameters, before: BalanceColumns | None, default: BalanceColumns, designed: BalanceColumns, noun: str
) -> tuple[tuple[Expected, ...], tuple[str, ...]]:
    none = np.full(len(criterion.names), np.nan)
    own = none
    if before is not None:  # of the logs' own length instead of the experiment's
        own = _spread(criterion.information(before) * before.seconds / criterion.duration) * criterion.units
    spreads = [own, *(each * criterion.units for each in _after(criterion, default, designed))]
    rows = tuple(
        Expected(f"{name}, half 95 % interval", unit, *(1.96 * float(s[i]) for s in spreads))
        for i, (name, unit) in enumerate(zip(criterion.names, criterion.unit_names, strict=True))
    )
    ratio = float(np.median(spreads[2] / spreads[1]))
    text = (
        f"The 95 % intervals after the {noun} are {ratio:.2f} times as wide as those after a growing sinusoid "
        "of the same length and limits (median over the parameters)."
    )
    return rows, (text,)


def _after(criterion: Parameters, *experiments: BalanceColumns) -> list[FloatArray]:
    """(p,) after each experiment; by the number of independent samples where the noise of one of them is not known."""
    found = [standard_deviations(criterion, columns) for columns in experiments]
    known = [each for each in found if each is not None]
    if len(known) == len(found):
        return known
    return [_spread(criterion.information(columns)) for columns in experiments]


def _spread(information: FloatArray) -> FloatArray:
    """(p,) standard deviations of the parameters (Cramer and Rao); infinite where nothing is known."""
    eigen, vectors = np.linalg.eigh(information)
    with np.errstate(divide="ignore"):
        inverse = np.where(eigen > 1e-12 * max(float(eigen[-1]), 1e-300), 1.0 / eigen, np.inf)
    return np.asarray(np.sqrt(np.sum(np.where(vectors**2 > 1e-12, vectors**2 * inverse, 0.0), axis=1)))


def _of_everything(
    criterion: AllEffects, before: BalanceColumns | None, default: BalanceColumns, designed: BalanceColumns, noun: str
) -> tuple[tuple[Expected, ...], tuple[str, ...]]:
    given = ((before, None if before is None else before.seconds), (default, None), (designed, None))
    rows, shown = [], [0, 0, 0]
    for form in criterion.forms:
        sizes = [np.nan if c is None else found_from(form, c, criterion.noise(c.joint, each)) for c, each in given]
        word = "largest" if form.size.falling else "smallest"
        rows.append(Expected(f"{word} {form.effect.key} that is found", form.size.unit, *sizes))
        for i, size in enumerate(sizes):
            shown[i] += bool(
                np.isfinite(size) and (size >= form.strength if form.size.falling else size <= form.strength)
            )
    text = (
        f"Of {len(rows)} effects of typical size the {noun} shows {shown[2]}, a growing sinusoid of the same "
        f"length and limits {shown[1]}."
    )
    never = [form.effect.key for form, row in zip(criterion.forms, rows, strict=True) if np.isinf(row.after)]
    more = (f"The {noun} shows no size (∞) of {', '.join(never)}.",) if never else ()
    return tuple(rows), (text, *more)
