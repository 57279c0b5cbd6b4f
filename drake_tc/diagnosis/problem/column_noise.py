"""How much the noise of an acceleration makes a fitted rotor inertia too small, and what that moves beside it.

With noise of covariance S (of one row) in the columns X of N rows, least squares finds on average

    beta_hat = beta - b,    b = (X' X/N - S)^-1 S beta_hat                            (Fuller, 1987, section 2.2)

The encoder's noise is in the columns of the acceleration and the velocity, and of a position servo in the effort. An
interval from the residuals alone does not know of b, which for a fast and small motion is many times as wide.
"""

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, prior_coefficients
from drake_tc.diagnosis.problem.regression import Fit, bounds_of
from drake_tc.effects.rotor_inertia import RotorInertia
from drake_tc.effects.viscous import Viscous
from drake_tc.types import FloatArray

LEAST_SIGNAL = 1e-9
"""Least eigenvalue of X' X/N - S, scaled to unit columns of X, at or below which S may be all that is in a column."""


def attenuation(columns: Columns, fitted: Fit) -> FloatArray | None:
    """The error b (k,) of the fit's coefficients; the coefficients themselves where a column may hold noise alone.

    None where no rotor inertia is fitted.

    Args:
        columns: Training rows.
        fitted: To these rows.
    """
    where = {type(t.effect): i for i, t in enumerate(fitted.terms)}
    if RotorInertia not in where:
        return None
    start = 1 + np.cumsum([0, *(len(t.effect.coefficients) for t in fitted.terms)])
    low, high = bounds_of(fitted.terms, columns.declared_gain)
    free = ~(prior_coefficients(fitted.terms) | (low == high) | (fitted.beta <= low) | (fitted.beta >= high))
    order = [start[where[RotorInertia]], start[where[Viscous]] if Viscous in where else -1]
    if columns.samples.floor.servo:
        order.append(0)
    at = np.array([place for place in order if place >= 0 and free[place]], dtype=int)
    among = np.array([i for i, place in enumerate(order) if place >= 0 and free[place]], dtype=int)
    noise = np.zeros((fitted.beta.size, fitted.beta.size))
    noise[np.ix_(at, at)] = columns.samples.floor.encoder_gram[np.ix_(among, among)]
    design = columns.design(fitted.terms)
    gram = design.T @ design / columns.target.size
    inner = np.ix_(free, free)
    scale = np.sqrt(np.outer(np.diag(gram), np.diag(gram)))[inner]
    true = gram[inner] - noise[inner]
    out = np.zeros(fitted.beta.size)
    if np.linalg.eigvalsh(true / scale)[0] <= LEAST_SIGNAL:
        out[free] = fitted.beta[free]
    else:
        out[free] = np.linalg.solve(true, noise[inner] @ fitted.beta[free])
    return out
