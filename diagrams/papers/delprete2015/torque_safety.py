"""How safe the torques of a motion were: p of all limits and of each group, tick by tick, of the robot as it is."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest

from drake_tc.diagrams.papers.delprete2015.probability import probability
from drake_tc.diagrams.papers.delprete2015.simulation import Moment
from drake_tc.tsid.robust.scaled import TorqueError
from drake_tc.types import BoolArray, FloatArray

SAMPLES = 512
"""Of the quasi-Monte Carlo at each state: intervals below a tenth of a point."""
MISSED = 1e-6
"""A limit is missed where it is by more standard deviations of its row."""


@dataclass(frozen=True, eq=False)
class TorqueSafety:
    """What T ticks of a motion come to.

    Attributes:
        time: (T,) [s].
        p: (T,) probability that the torques keep all limits, errors and all.
        low, high: (T,) its interval, 95 %.
        groups: (T,) p of each group of limits alone.
        active: (T,) limits that hold the solution.
        iterations: (T,) of the formulation.
        seconds: (T,) that it took.
        error: (T,) of the main task [m/s^2].
        missed: (T,) whether a limit of the robot as it is was missed without any torque error.
        solved: (T,) whether the controller's own limits could be kept.
    """

    time: FloatArray
    p: FloatArray
    low: FloatArray
    high: FloatArray
    groups: dict[str, FloatArray]
    active: FloatArray
    iterations: FloatArray
    seconds: FloatArray
    error: FloatArray
    missed: BoolArray
    solved: BoolArray


def torque_safety(
    moments: Iterable[Moment], error: TorqueError, seed: int, *, rows: int = 3, every: int = 1, groups: bool = True
) -> TorqueSafety:
    """Go through a motion.

    Args:
        moments: Of `follow` or `solve_again`.
        error: The true one.
        seed: Of the quasi-Monte Carlo; the same points at every state.
        rows: Of the main task.
        every: p at each so many ticks only; the rest at all of them, and p repeated.
        groups: Whether p of each group is requested.
    """
    lines: list[tuple[float, ...]] = []
    apart: dict[str, list[float]] = {}
    value, low, high = math.nan, math.nan, math.nan
    for tick, moment in enumerate(moments):
        polytope = moment.truth.polytope
        if tick % every == 0:
            found = probability(polytope, moment.torque, error, samples=SAMPLES, seed=seed)
            value, (low, high) = found.value, found.ci95
            for name in polytope.groups if groups else ():
                alone = probability(polytope, moment.torque, error, group=name, samples=SAMPLES, seed=seed)
                apart.setdefault(name, []).append(alone.value)
        else:
            for values in apart.values():
                values.append(values[-1])
        solution = moment.solution
        lines.append(
            (
                moment.time,
                value,
                low,
                high,
                float(np.count_nonzero(solution.active)),
                solution.iterations,
                moment.seconds,
                moment.task_error(rows),
                miss(moment, error) > MISSED,
                moment.solved,
            )
        )
    time, p, below, above, active, iterations, seconds, off, missed, solved = np.array(lines, dtype=float).T
    named = {name: np.array(values) for name, values in apart.items()}
    return TorqueSafety(time, p, below, above, named, active, iterations, seconds, off, missed > 0.0, solved > 0.0)


def miss(moment: Moment, error: TorqueError, *, without: str | None = None) -> float:
    """By how many of its standard deviations the worst limit of the robot as it is is missed; negative inside.

    Args:
        moment: When.
        error: Of the torques.
        without: A group of limits that does not count.
    """
    polytope = moment.truth.polytope
    value = polytope.matrix @ moment.torque
    over = np.maximum(polytope.lower - value, value - polytope.upper) / error.row_sigma(polytope.matrix)
    if without is not None:
        over[polytope.groups[without]] = -np.inf
    return float(over.max())


def wilson(hits: int, runs: int, level: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval of a share: hits of runs."""
    low, high = binomtest(hits, runs).proportion_ci(level, method="wilson")
    return float(low), float(high)


def cell(values: Sequence[float] | FloatArray, scale: float = 1.0, digits: int = 2) -> str:
    """A mean, as text."""
    return f"{scale * float(np.mean(values)):.{digits}f}"
