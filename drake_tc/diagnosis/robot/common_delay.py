"""A delay that all joints of a robot share: a controller, a bus or a clock that is late for all drives alike.

A search of each joint by itself names such a cause in some joints and misses it in others, and the links' inertias
take up what is left of it, as y(t - d) = y - d dy/dt. It is therefore looked for on all joints together, beside the
links' parameters (`problem.shared.stacked`) and before the joints' own effects. It is found if, on the training runs,

- the thresholds `COMMON_DELAY` hold, with the support of at least half of the joints,
- the delay that each joint tells by itself (`own_delays`) agrees with the common one in at least three quarters of the
  joints, that is, within half of it or within two standard deviations, and is clearly shorter in none. A late encoder
  of one joint makes the loads of its neighbours late by other, shorter times. A longer delay of a single joint is no
  evidence against a common one: the joint may have a lag of its own, or friction that builds up over a distance, and
- the error of no joint grows;

and if it lowers the error of the held-out runs in nearly all of their block resamples.

Efforts that are all recorded a time d after they acted (a low-pass before the logging, the time stamps of another bus)
are a delay of -d. No drive acts before its command, so this is no effect but an age of the recorded efforts; it is
looked for in the same way, between half a sampling period and `LONGEST_LEAD`.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import norm

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.problem.shared.rows import JointRows, with_terms
from drake_tc.diagnosis.problem.shared.stacked import StackedFit, fit_stacked
from drake_tc.diagnosis.result.rig_result import SharedEffect
from drake_tc.diagnosis.result.shared_effects import on_held_out
from drake_tc.diagnosis.robot.all_joints import AllJoints
from drake_tc.diagnosis.thresholds import COMMON_DELAY, HELDOUT_CERTAIN, LONGEST_LEAD
from drake_tc.effects.common_delay import CommonDelay
from drake_tc.effects.delay import DELAY_RANGE
from drake_tc.types import FloatArray

GRID = 8
"""Delays that are tried before the best one is refined."""
LONGEST = DELAY_RANGE.upper
ALIKE = 0.5
"""By how much a joint's own delay may differ from the common one, relative to that."""
MOST = 0.75
"""Share of the joints whose own delays must agree with the common one."""
STEP = 0.1
"""Step of derivatives by the delay, relative to it."""
OF_SAMPLE = 0.05
"""Standard deviation of a delay, in samples, by what interpolation between samples does: it takes noise out of an
effort, more of it between samples than on them, and thus draws the estimate away from whole samples."""
WHERE = "all joints"


@dataclass(frozen=True, eq=False)
class SharedDelay:
    """A delay that was found.

    Attributes:
        term: Part of every joint's model from here on. effect: what is told of it.
        error: Mean logarithm of the joints' cross-validated errors with it.
    """

    term: Term
    effect: SharedEffect
    error: float


@dataclass(frozen=True, eq=False)
class DelayProblem(AllJoints):
    """All joints, whose drives may all be late."""

    @property
    def period(self) -> float:
        """Of the sampling [s]."""
        return next(iter(self.prepared.values())).context.period

    def late(self, delay: float, *, held: bool = False) -> list[JointRows]:
        """The rows with efforts that act `delay` [s] late."""
        return [
            with_terms(rows, p.held if held else p.train, (*p.terms, term_of(delay)))
            for rows, p in zip(self.held if held else self.rows, self.prepared.values(), strict=True)
        ]

    def fit(self, delay: float) -> StackedFit:
        """All joints together with this delay [s]."""
        return fit_stacked(self.late(delay), self.fitted.columns, self.fitted.tolerance, pooled=True)

    def is_improved(self, fitted: StackedFit) -> bool:
        """Whether the errors of the training runs ask for the delay that `fitted` has: see the module."""
        return self.is_better(
            fitted, self.fitted, replace(COMMON_DELAY, least_joints=max(2, (len(self.rows) + 1) // 2))
        )

    def around(self, delay: float) -> tuple[StackedFit, StackedFit]:
        """Fits with a little less and a little more than this delay [s], for derivatives."""
        return self.fit((1.0 - STEP) * delay), self.fit((1.0 + STEP) * delay)

    def own_delays(
        self, delay: float, fitted: StackedFit, around: tuple[StackedFit, StackedFit]
    ) -> tuple[FloatArray, FloatArray]:
        """(n,) the delay that each joint tells by itself beside the common links, and its standard deviation [s].

        One Gauss-Newton step from the common delay d. With r the residual of a joint at d and r' its derivative by the
        delay, links and joints fitted anew, the joint's own delay is d - r.r'/(r'.r'), with the standard deviation
        RMS(r)/(sqrt(n) RMS(r')), n the rows that are independent.
        """
        step = STEP * delay
        rows = self.late(delay - step), self.late(delay + step)
        own = []
        for j, late in enumerate(self.late(delay)):
            residual = fitted.residual(late, j)
            below, above = (fit.residual(each[j], j) for each, fit in zip(rows, around, strict=True))
            slope = (above - below) / (2.0 * step)
            squares = max(float(slope @ slope), 1e-300)
            spread = np.sqrt(float(residual @ residual) / (fitted.effective[j] * residual.size * squares))
            own.append((delay - float(residual @ slope) / squares, spread))
        return np.array([each[0] for each in own]), np.array([each[1] for each in own])


def agree(delay: float, own: FloatArray, spread: FloatArray) -> bool:
    """Whether most joints' own delays (n,) are the common `delay`, and none is clearly shorter; all in seconds.

    A negative delay is a lead, and the joints' own ones are then compared as leads.
    """
    allowed = np.maximum(ALIKE * abs(delay), 2.0 * spread)
    beyond = np.sign(delay) * (own - delay)
    return bool((np.abs(beyond) <= allowed).mean() >= MOST and (beyond >= -allowed).all())


def term_of(delay: float) -> Term:
    """The term of a common delay [s]."""
    return Term(CommonDelay(), {"delay": delay})


def common_delay(problem: DelayProblem) -> SharedDelay | None:
    """The delay that all joints share, or None."""
    return _shared(problem, np.geomspace(max(5e-4, 0.3 * problem.period), LONGEST, GRID))


def common_lead(problem: DelayProblem) -> float | None:
    """Time [s] by which the efforts of all joints are recorded after they acted, or None."""
    grid = np.geomspace(0.5 * min(problem.period, LONGEST_LEAD), LONGEST_LEAD, GRID)
    found = _shared(problem, -grid)
    return None if found is None else -found.effect.parameters["delay"].value


def _shared(problem: DelayProblem, grid: FloatArray) -> SharedDelay | None:
    """The best delay between the ends of the grid [s], all of one sign, where the joints share it; else None."""
    fits = [problem.fit(float(delay)) for delay in grid]
    best = int(np.argmin([problem.error(each) for each in fits]))
    if problem.error(fits[best]) > problem.error(problem.fitted) + np.log1p(-0.5 * COMMON_DELAY.second_gain):
        return None
    bounds = sorted((grid[max(best - 1, 0)], grid[min(best + 1, GRID - 1)]))
    found = minimize_scalar(
        lambda delay: problem.error(problem.fit(float(delay))),
        bounds=bounds,
        method="bounded",
        options={"xatol": 1e-3 * abs(grid[best]), "maxiter": 16},
    )
    delay = float(found.x) if found.fun < problem.error(fits[best]) else float(grid[best])
    fitted = problem.fit(delay)
    if not problem.is_improved(fitted):
        return None
    around = problem.around(delay)
    if not agree(delay, *problem.own_delays(delay, fitted, around)):
        return None
    effect = _told(problem, delay, fitted, around)
    return SharedDelay(term_of(delay), effect, problem.error(fitted)) if effect.stability >= HELDOUT_CERTAIN else None


def _told(
    problem: DelayProblem, delay: float, fitted: StackedFit, around: tuple[StackedFit, StackedFit]
) -> SharedEffect:
    late = problem.late(delay, held=True)
    gain, stability, by_joint = on_held_out((late, fitted), (problem.held, problem.fitted))
    half = _half_width(problem, delay, fitted, around)
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


def _half_width(
    problem: DelayProblem, delay: float, fitted: StackedFit, around: tuple[StackedFit, StackedFit]
) -> float:
    """Half width [s] of the 95 % interval: by the curvature of the log likelihood -sum_j n_j log sigma_j(delay).

    n_j are the effective rows of joint j. The links' and joints' own parameters are fitted anew at each delay. What
    interpolation does (`OF_SAMPLE`) is in it.
    """
    period = max(p.context.period for p in problem.prepared.values())
    count, step = fitted.effective * problem.counts, STEP * delay
    spreads = [np.log(each.sigma) for each in (around[0], fitted, around[1])]
    curvature = float(count @ (spreads[0] - 2.0 * spreads[1] + spreads[2])) / step**2
    variance = 1.0 / curvature if curvature > 0.0 else float("inf")
    return float(norm.ppf(0.975) * np.sqrt(variance + (OF_SAMPLE * period) ** 2))
