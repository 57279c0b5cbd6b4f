"""How far two models stay apart at a motion, whatever the parameters of the wrong one are.

For effect A of size z beside a model whose other effect is B (Atkinson and Fedorov, Biometrika 62, 1975, eq. 2)

    T(A, B) = min_{beta, theta, shape of B} n/(T s^2) |z phi_A - X beta - Phi_B(shape) theta|_w^2       (T-optimality)

X: declared columns; w: weights of the rows in motion; s: noise [N m]; n: independent samples; theta and the shape
inside their bounds. T is twice the expected logarithm of the ratio of the likelihoods. The design makes the smallest T
over the orders of A and B, over both signs of A and over its shapes, largest.

An order in which B has more parameters than A is left out: of two models that fit equally well, a diagnosis takes the
one with fewer parameters, and lists the other one only if it fits better. A diagnosis must also find the effect at all,
which depends on the distances V of A and of B from the declared model without either of them.
Where the smallest V is less than `ENOUGH` times what a diagnosis asks for, the criterion falls by the logarithm of what
is lacking; a larger one adds nothing, since only T separates the two.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from drake_tc.diagnosis.priors import NAMED_FLOORS
from drake_tc.experiments.design.criteria import Criterion, information_scale
from drake_tc.experiments.design.forms import EffectForm, Projection, declared_columns
from drake_tc.experiments.design.joint import BalanceColumns, DesignJoint
from drake_tc.types import FloatArray

FOUND = NAMED_FLOORS**2
"""V/n that a diagnosis asks of an effect: half a noise floor."""
ENOUGH = 4.0
"""V over what a diagnosis asks for, from which on an effect is found for certain: twice the size that is found."""
CERTAIN = float(norm.ppf(0.98))
"""Standard deviations by which the better of two models must be better."""
SOFT = 8.0
"""Sharpness of the smooth minimum over shapes, on a logarithmic scale."""
Distances = Mapping[tuple[str, str], FloatArray]
"""By (truth, other), T for each shape and sign of the truth."""


@dataclass(frozen=True, eq=False)
class Discrimination(Criterion):
    """T-optimality for two effects, each taken for the truth in turn.

    Attributes:
        joint: The joint.
        orders: (truth, other), in both orders. An order is left out if the other model contains the truth or has more
            parameters.
        duration: Of the experiment [s].
        contained: (truth, other, proof) of an order in which the other model contains the truth.
    """

    joint: DesignJoint
    orders: tuple[tuple[EffectForm, EffectForm], ...]
    duration: float
    contained: tuple[tuple[str, str, str], ...] = ()

    def distances(self, columns: BalanceColumns, duration: float | None = None) -> Distances:
        """T of both orders, over `duration` [s] of rows like these; None for that of the experiment."""
        return self._apart(_declared(columns), columns, duration)

    def visibilities(self, columns: BalanceColumns, duration: float | None = None) -> dict[str, FloatArray]:
        """By effect, the distance T of each shape from the declared model alone, over `duration` [s] of rows."""
        return self._seen(_declared(columns), columns, duration)

    def _apart(self, declared: Projection, columns: BalanceColumns, duration: float | None) -> Distances:
        out = {}
        for truth, other in self.orders:
            targets, widths = [], []
            for shape in truth.shapes:
                left = declared.of(truth.change(columns, shape))
                signs = (1.0, -1.0) if truth.either_sign else (1.0,)
                targets += [sign * left for sign in signs]
                widths += [left.shape[1]] * len(signs)
            least = self._scale(columns, duration) * other.left(declared, columns, np.concatenate(targets, axis=1))
            ends = np.cumsum(widths)
            means = [np.mean(least[e - w : e]) for e, w in zip(ends, widths, strict=True)]
            out[truth.effect.key, other.effect.key] = np.array(means)
        return out

    def _seen(self, declared: Projection, columns: BalanceColumns, duration: float | None) -> dict[str, FloatArray]:
        scale, out = self._scale(columns, duration), {}
        for form in dict.fromkeys(form for order in self.orders for form in order):
            left = [declared.of(form.change(columns, shape)) for shape in form.shapes]
            out[form.effect.key] = np.array([scale * np.mean(np.sum(each**2, axis=0)) for each in left])
        return out

    def _scale(self, columns: BalanceColumns, duration: float | None) -> float:
        return information_scale(columns.joint, self.duration if duration is None else duration, columns.weight.size)

    def value(self, columns: BalanceColumns) -> float:
        """Smooth minimum of log T over both orders and all shapes, less what the visibility of an effect lacks."""
        declared = _declared(columns)
        apart = _soft_minimum(np.concatenate(list(self._apart(declared, columns, None).values())))
        visible = np.concatenate(list(self._seen(declared, columns, None).values()))
        seen = _soft_minimum(visible / (ENOUGH * self._asked(columns)))
        return apart + min(seen, 0.0)

    def _asked(self, columns: BalanceColumns) -> float:
        """V that a diagnosis asks of an effect, in the units of `visibilities`."""
        sliding = self.duration * max(float(np.mean(columns.weight)), 1e-9)
        return FOUND * columns.joint.independent_per_second * sliding


def _declared(columns: BalanceColumns) -> Projection:
    """What the declared model leaves of a column."""
    return Projection(declared_columns(columns), columns.weight)


def _soft_minimum(squares: FloatArray) -> float:
    logs = np.log(squares + 1e-9)
    least = float(logs.min())
    return least - float(np.log(np.mean(np.exp(-SOFT * (logs - least))))) / SOFT
