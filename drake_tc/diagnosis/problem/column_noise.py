"""How much the noise of an acceleration makes a fitted inertia too small, and what that moves beside it.

With noise of covariance S (of one row) in the columns X of N rows, least squares finds on average

    beta_hat = beta - b,    b = (X' X/N - S)^-1 S beta_hat                            (Fuller, 1987, section 2.2)

The encoder's noise is in the columns of the acceleration and the velocity, and of a position servo in the effort, also
where its gain is held. The inertia is that of the rotor or of an unknown load. An interval from the residuals alone
does not know of b, which for a fast and small motion is many times as wide.
"""

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, prior_coefficients
from drake_tc.diagnosis.problem.regression import Fit, bounds_of
from drake_tc.effects.base import Effect
from drake_tc.effects.rotor_inertia import RotorInertia
from drake_tc.effects.unknown_load import UnknownLoadEffect
from drake_tc.effects.viscous import Viscous
from drake_tc.types import FloatArray

ACCELERATION, VELOCITY, POSITION = 0, 1, 2
"""Rows of `NoiseFloor.motion_gram`."""
LEAST_SIGNAL = 1e-9
"""Least eigenvalue of X' X/N - S, scaled to unit columns of X, at or below which S may be all that is in a column."""


def attenuation(columns: Columns, fitted: Fit) -> FloatArray | None:
    """The error b (k,) of the fit's coefficients; the coefficients themselves where a column may hold noise alone.

    None where no inertia is fitted.

    Args:
        columns: Training rows.
        fitted: To these rows.
    """
    start = 1 + np.cumsum([0, *(len(t.effect.coefficients) for t in fitted.terms)])
    inertias = [int(end) - 1 for t, end in zip(fitted.terms, start[1:], strict=True) if _holds_inertia(t.effect)]
    if not inertias:
        return None
    design = columns.design(fitted.terms)
    gram = design.T @ design / columns.target.size
    low, high = bounds_of(fitted.terms, columns.declared_gain)
    held = prior_coefficients(fitted.terms) | (fitted.beta <= low) | (fitted.beta >= high)
    free = ~held & (np.diag(gram) > 0.0)
    out = np.zeros(fitted.beta.size)
    if not free[inertias].any():
        return out
    noisy = dict.fromkeys(inertias, ACCELERATION)  # coefficient to its row of the encoder's gram
    noisy |= {int(at): VELOCITY for t, at in zip(fitted.terms, start, strict=False) if isinstance(t.effect, Viscous)}
    if columns.samples.floor.servo:
        noisy[0] = POSITION
    at, row = np.array(list(noisy.items()), dtype=int).T
    noise = np.zeros_like(gram)
    noise[np.ix_(at, at)] = columns.samples.floor.motion_gram[np.ix_(row, row)]
    inner = np.ix_(free, free)
    length = np.sqrt(np.diag(gram)[free])
    true = gram[inner] - noise[inner]
    if np.linalg.eigvalsh(true / np.outer(length, length))[0] <= LEAST_SIGNAL:
        out[free] = fitted.beta[free]
    else:
        out[free] = np.linalg.solve(true, noise[free] @ fitted.beta)
    return out


def _holds_inertia(effect: Effect) -> bool:
    """Whether the last coefficient of an effect is an inertia."""
    return isinstance(effect, RotorInertia) or (isinstance(effect, UnknownLoadEffect) and effect.inertial)
