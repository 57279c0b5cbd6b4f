"""Is a lag of the effort a lag, or does its low-pass only take noise out of the effort?

An effort that answers a torque which no column records, or that is noisy itself, fits the recorded torques better once
it is low-passed. A lag fits better because it comes late. Run backwards in time, the same filter attenuates as much and
comes early: the noise's benefit stays, the lag's turns into harm. With e_0 the cross-validated error without the lag,
e that with it and e_b that with it backwards, a lag must remove

    e_0^2 - e^2 > LAG_OVER_NOISE max(e_0^2 - e_b^2, 0)
"""

from collections.abc import Mapping

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import Fit, score
from drake_tc.diagnosis.thresholds import LAG_OVER_NOISE
from drake_tc.effects.base import DriveEffect, Shape, Signals, Signature
from drake_tc.effects.current_lag import CurrentLag
from drake_tc.effects.kernel import DriveKernel
from drake_tc.types import FloatArray

LATE = frozenset({"delay", "current_lag"})
"""Effects that differ only in the second order of frequency times delay: 1/(1 + T s) = exp(-T s) + (T s)^2/2 + ..."""


class Backwards(DriveEffect):
    """A drive effect whose transform runs backwards in time; for comparison only."""

    kind = "drive"

    def __init__(self, effect: DriveEffect) -> None:
        self._effect = effect
        self.id = f"{effect.id} backwards"  # type: ignore[misc]
        self.form = effect.form  # type: ignore[misc]
        self.title = f"{effect.title}, backwards"  # type: ignore[misc]
        self.coefficients = effect.coefficients  # type: ignore[misc]
        self.shapes = effect.shapes  # type: ignore[misc]
        self.filters = effect.filters  # type: ignore[misc]

    signature = Signature(x="time", split="", look_for="")

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Those of the effect."""
        return self._effect.columns(signals, shape)

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """The effect's transform of the effort played backwards."""
        turned = signals.take(np.arange(effort.size)[::-1])
        return self._effect.transform(effort[::-1], turned, shape)[::-1]

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """None: it cannot run.

        Raises:
            NotImplementedError: always.
        """
        raise NotImplementedError(f"{self.title} is not causal")


def is_noise(columns: Columns, fitted: Fit, term: Term) -> bool:
    """Whether a fit's lag takes out as much noise as it explains.

    Args:
        columns: Training rows.
        fitted: With the lag.
        term: One of its terms.
    """
    effect = term.effect
    if not isinstance(effect, CurrentLag):
        return False
    others = [t for t in fitted.terms if t is not term]
    without = score(columns, others).cv_rms ** 2
    backwards = score(columns, [*others, Term(Backwards(effect), term.shape)]).cv_rms ** 2
    return without - fitted.cv_rms**2 <= LAG_OVER_NOISE * max(without - backwards, 0.0)
