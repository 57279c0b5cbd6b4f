"""The equation error of a model whose numbers did not come from a fit of the equation."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares

from drake_tc.diagnosis.problem.columns import Columns, coefficients_by_term, prior_coefficients
from drake_tc.diagnosis.problem.parameters import physical_parameters, shape_places, with_shapes
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.types import FloatArray

EXACT = 1e-6
"""Largest relative difference of the numbers that the coefficients give back."""


def equation_errors(
    fitted: Fit, named: Mapping[str, Mapping[str, float]], splits: tuple[DataSplit, ...]
) -> tuple[float, ...] | None:
    """RMS of K (z - z_hat) [effort] of each split under other numbers, with the fit's own K, so that both compare.

    The coefficients and shapes b that have these numbers solve  physical(b) = named;  None where no b has them.

    Args:
        fitted: The fit whose effects the model has.
        named: Numbers by effect key, "drive" with the gain among them.
        splits: Rows of the training and of the held-out runs.
    """
    where, _ = shape_places(fitted.terms)
    size = fitted.beta.size
    start = _guess(fitted, named, where)
    scale = np.where(start != 0.0, np.abs(start), 1e-3)

    def numbers(x: np.ndarray) -> np.ndarray:
        found = physical_parameters(fitted, x[:size], x[size:])
        return np.array([found[key][name] for key, group in named.items() for name in group])

    desired = np.array([value for group in named.values() for value in group.values()])
    finite = np.isfinite(desired)
    size_of = np.maximum(np.abs(desired), 1e-9)[finite]

    # What has a prior is not among the numbers and stays as it is.
    step_of = np.diag(scale)[:, ~np.append(prior_coefficients(fitted.terms), np.zeros(start.size - size, np.bool_))]

    def miss(step: np.ndarray) -> np.ndarray:
        difference = (numbers(start + step_of @ step)[finite] - desired[finite]) / size_of
        return np.asarray(np.nan_to_num(difference, nan=1e3, posinf=1e3, neginf=-1e3))

    found = least_squares(miss, np.zeros(step_of.shape[1]), xtol=1e-12, ftol=1e-15, gtol=1e-15, max_nfev=50)
    if np.abs(found.fun).max() > EXACT:
        return None
    b = start + step_of @ found.x
    terms = with_shapes(fitted.terms, where, b[size:])
    made = []
    for split in splits:
        columns = Columns(split.samples)
        less = columns.design(fitted.terms) @ fitted.beta - columns.design(terms) @ b[:size]
        residual = split.after + less * fitted.gain
        made.append(float(np.sqrt(np.mean(residual**2))))
    return tuple(made)


def _guess(fitted: Fit, named: Mapping[str, Mapping[str, float]], where: Sequence[tuple[int, str]]) -> FloatArray:
    """Coefficients and shapes by their own names where they are reported as such; most effects report nothing else."""
    beta = [1.0 / named["drive"]["gain"]]
    for term, theta in coefficients_by_term(fitted.terms, fitted.beta):
        own = named.get(term.effect.key, {})
        beta += [own.get(p.name, float(t)) for p, t in zip(term.effect.coefficients, theta, strict=True)]
    shapes = [named[fitted.terms[i].effect.key].get(name, fitted.terms[i].shape[name]) for i, name in where]
    return np.array([*beta, *shapes])
