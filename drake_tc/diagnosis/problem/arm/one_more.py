"""What one more block of columns would explain beside those of an arm's fit, from products of columns alone."""

import numpy as np

from drake_tc.diagnosis.problem.arm.fit import ArmFit, ridged
from drake_tc.diagnosis.problem.bounded import solve_bounded
from drake_tc.effects.base import Effect
from drake_tc.types import FloatArray


class OneMore:
    """Least squares of a fit and one more effect, all coefficients in their bounds; squares in units of sigma^2."""

    def __init__(self, fit: ArmFit) -> None:
        """On top of `fit`."""
        self.fit = fit
        self._gram, self._moment = fit.grams.sum(0), fit.moments.sum(0)
        self._squares = float(np.sum((fit.rows.torque / fit.sigma) ** 2))
        self._loaded: dict[int, FloatArray] = {}

    def _turns(self, axis: int) -> FloatArray:
        return np.array(self.fit.rows.axes[axis].turns)

    def residual_on(self, axis: int) -> FloatArray:
        """(N,) the fit's residual as the shaft sees it, each joint weighted by 1/sigma^2."""
        return np.asarray((self.fit.residual / self.fit.sigma**2) @ self._turns(axis))

    def _design_on(self, axis: int) -> FloatArray:
        """(N, m) the fit's columns as the shaft sees them, each joint weighted by 1/sigma^2."""
        if axis not in self._loaded:
            turns = self._turns(axis)
            hit = np.flatnonzero(turns)
            weight = turns[hit] / self.fit.sigma[hit] ** 2
            self._loaded[axis] = sum(w * self.fit.design[:, j] for w, j in zip(weight, hit, strict=True))
        return self._loaded[axis]

    def error(self, axis: int, effect: Effect, columns: FloatArray) -> float:
        """RMS over rows and joints in units of sigma, with the columns (N, k) of an effect on a shaft beside the fit's.

        Args:
            axis: Shaft.
            effect: For the bounds of its coefficients.
            columns: (N, k).
        """
        fit = self.fit
        turns = self._turns(axis)
        hit = np.flatnonzero(turns)
        weight = turns[hit] / fit.sigma[hit]
        own = float(np.sum(weight**2)) * (columns.T @ columns)
        count = fit.rows.torque.size
        if not (np.diag(own) > 0.0).all():
            return float(np.sqrt(self._squares / count))
        mixed = self._design_on(axis).T @ columns
        moment = columns.T @ (fit.rows.torque[:, hit] / fit.sigma[hit] @ weight)
        gram = np.block([[self._gram, mixed], [mixed.T, own]])
        moments = np.concatenate([self._moment, moment])
        lower = np.concatenate([fit.lower, [p.lower for p in effect.coefficients]])
        upper = np.concatenate([fit.upper, [p.upper for p in effect.coefficients]])
        beta = solve_bounded(ridged(gram), moments, lower, upper)
        left = self._squares - 2.0 * float(moments @ beta) + float(beta @ gram @ beta)
        return float(np.sqrt(max(left, 0.0) / count))
