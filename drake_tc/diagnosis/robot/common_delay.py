"""A delay that all joints of a robot share: a controller, a bus or a clock that is late for all drives alike.

A search of each joint by itself names such a cause in some joints and misses it in others, and the links' inertias
take up what is left of it, as y(t - d) = y - d dy/dt. It is therefore looked for on all joints together, beside the
links' parameters (`problem.shared.stacked`) and before the joints' own effects. It is found if, on the training runs,

- the thresholds of shared causes hold (`SHARED` in `thresholds`), with the support of at least half of the joints,
- every joint that supports it does about as well with the common delay as with the best delay of its own, and
- the error of no joint grows;

and if it lowers the error of the held-out runs in nearly all of their block resamples.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import norm

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.problem.shared.rows import JointRows, with_terms
from drake_tc.diagnosis.problem.shared.stacked import StackedFit, fit_stacked
from drake_tc.diagnosis.result.rig_result import SharedEffect
from drake_tc.diagnosis.result.shared_effects import on_held_out
from drake_tc.diagnosis.selection.comparison import compared
from drake_tc.diagnosis.thresholds import HELDOUT_CERTAIN, SAME_ERROR, SHARED
from drake_tc.effects.common_delay import CommonDelay
from drake_tc.effects.delay import DELAY_RANGE
from drake_tc.types import FloatArray

GRID = 8
"""Delays that are tried before the best one is refined."""
LONGEST = DELAY_RANGE.upper
OWN_BEST = 0.05
"""Error with the common delay over that with the joint's own best one, less 1, up to which a joint shares it."""
OF_SAMPLE = 0.05
"""Standard deviation of a delay, in samples, by what interpolation between samples does: it takes noise out of an
effort, more of it between samples than on them, and thus draws the estimate away from whole samples."""
WHERE = "all joints"


@dataclass(frozen=True, eq=False)
class SharedDelay:
    """A delay that was found.

    Attributes:
        term: Part of every joint's model from here on. effect: what is told of it.
    """

    term: Term
    effect: SharedEffect


@dataclass(frozen=True, eq=False)
class DelayProblem:
    """All joints with their declared models.

    Attributes:
        prepared: Joints. rows: training rows of all. held: held-out rows. fitted: to `rows`, without a delay.
    """

    prepared: Mapping[str, Prepared]
    rows: Sequence[JointRows]
    held: Sequence[JointRows]
    fitted: StackedFit

    def late(self, delay: float, *, held: bool = False) -> list[JointRows]:
        """The rows with efforts that act `delay` [s] late."""
        return [
            with_terms(rows, p.held if held else p.train, (*p.terms, term_of(delay)))
            for rows, p in zip(self.held if held else self.rows, self.prepared.values(), strict=True)
        ]

    def fit(self, delay: float) -> StackedFit:
        """All joints together with this delay [s]."""
        return fit_stacked(self.late(delay), self.fitted.columns, self.fitted.tolerance)

    def error(self, fitted: StackedFit) -> float:
        """Mean logarithm of the joints' cross-validated errors, weighted by their rows."""
        return float(self.counts @ np.log(fitted.cv_rms) / self.counts.sum())

    @property
    def counts(self) -> FloatArray:
        """(n,) training rows of each joint."""
        return np.array([rows.target.size for rows in self.rows], dtype=np.float64)

    def is_real(self, fitted: StackedFit, own_best: FloatArray) -> bool:
        """Whether the training runs show it: see the module.

        Args:
            fitted: With the delay.
            own_best: (n,) least cross-validated error of each joint with any delay [effort].
        """
        small, large = self.fitted.cv_rms, fitted.cv_rms
        thresholds = replace(SHARED, least_joints=max(2, (len(self.rows) + 1) // 2))
        floor = np.array([p.floor for p in self.prepared.values()])
        over = compared(small, large, fitted.effective * self.counts, 1, 1.0)
        agrees = (large <= (1.0 + OWN_BEST) * own_best) | (over.gain < thresholds.second_gain)
        grows = large > (1.0 + SAME_ERROR) * small
        return bool(agrees.all() and not grows.any()) and over.is_real(floor, np.zeros(small.size), thresholds)


def term_of(delay: float) -> Term:
    """The term of a common delay [s]."""
    return Term(CommonDelay(), {"delay": delay})


def common_delay(problem: DelayProblem) -> SharedDelay | None:
    """The delay that all joints share, or None."""
    period = next(iter(problem.prepared.values())).context.period
    grid = np.geomspace(max(5e-4, 0.3 * period), LONGEST, GRID)
    fits = [problem.fit(float(delay)) for delay in grid]
    best = int(np.argmin([problem.error(each) for each in fits]))
    if problem.error(fits[best]) > problem.error(problem.fitted) + np.log1p(-0.5 * SHARED.second_gain):
        return None
    around = grid[max(best - 1, 0)], grid[min(best + 1, GRID - 1)]
    found = minimize_scalar(
        lambda delay: problem.error(problem.fit(float(delay))),
        bounds=around,
        method="bounded",
        options={"xatol": 1e-3 * grid[best], "maxiter": 16},
    )
    delay = float(found.x) if found.fun < problem.error(fits[best]) else float(grid[best])
    fitted = problem.fit(delay)
    if not problem.is_real(fitted, np.min([each.cv_rms for each in (*fits, fitted)], axis=0)):
        return None
    effect = _told(problem, delay, fitted)
    return SharedDelay(term_of(delay), effect) if effect.stability >= HELDOUT_CERTAIN else None


def _told(problem: DelayProblem, delay: float, fitted: StackedFit) -> SharedEffect:
    late = problem.late(delay, held=True)
    gain, stability, by_joint = on_held_out((late, fitted), (problem.held, problem.fitted))
    half = _half_width(problem, delay, fitted)
    value = Estimate(delay, "s", (delay - half, delay + half), at_bound=delay >= 0.999 * LONGEST)
    return SharedEffect(
        id=CommonDelay.id,
        where=WHERE,
        title="delay of all joints",
        parameters={"delay": value},
        heldout_gain=gain,
        stability=stability,
        joints={rows.joint: each for rows, each in zip(late, by_joint, strict=True)},
    )


def _half_width(problem: DelayProblem, delay: float, fitted: StackedFit) -> float:
    """Half width [s] of the 95 % interval: by the curvature of the log likelihood -sum_j n_j log sigma_j(delay).

    n_j are the effective rows of joint j. The links' and joints' own parameters are fitted anew at each delay. What
    interpolation does (`OF_SAMPLE`) is in it.
    """
    period = max(p.context.period for p in problem.prepared.values())
    count, step = fitted.effective * problem.counts, 0.1 * delay
    spreads = [np.log(each.sigma) for each in (problem.fit(delay - step), fitted, problem.fit(delay + step))]
    curvature = float(count @ (spreads[0] - 2.0 * spreads[1] + spreads[2])) / step**2
    variance = 1.0 / curvature if curvature > 0.0 else float("inf")
    return float(norm.ppf(0.975) * np.sqrt(variance + (OF_SAMPLE * period) ** 2))
