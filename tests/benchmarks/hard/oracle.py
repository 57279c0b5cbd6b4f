"""What a fit that knows the truth gains by a cause: the log odds that the logs themselves hold.

The oracle knows all true signals, ages and shapes, and the noise as it was recorded. It fits sizes by least squares,
with the zero and the friction of each run as unknowns of known standard deviation:

    log odds = n_eff / 2 log(RSS_without / RSS_with) - k / 2 log n_eff,

where n_eff is the number of rows divided by the integrated autocorrelation time of the residual (Schwarz 1978; Sokal
1997), and k the number of columns of the cause.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tests.benchmarks.hard.physics import Array

ENOUGH = 8.0
"""Log odds from which on the information is there."""
ALIKE = 3.0
"""An alternative whose log odds are at most this much lower is an equally right answer."""


@dataclass(frozen=True)
class Problem:
    """Rows of all training runs.

    Attributes:
        target: (rows,) effort, less what is declared and held.
        base: (rows, b) columns of the declared model.
        nuisance: (rows, m) columns whose coefficients have the standard deviations `spread` (m,).
        causes: True columns of each cause, (rows, k).
        run: (rows,) number of the run.
    """

    target: Array
    base: Array
    nuisance: Array
    spread: Array
    causes: Mapping[str, Array]
    run: Array


@dataclass(frozen=True)
class Judgement:
    """Of one cause: size of what the model without it leaves, in floors; its log odds; ids that are as good."""

    floors: float
    log_odds: float
    allowed: tuple[str, ...]


def floor(problem: Problem) -> float:
    """RMS of what the true model leaves, in the unit of the effort."""
    columns = np.hstack([problem.base, *problem.causes.values()])
    return float(np.sqrt(np.mean(_fit(problem, columns, 0.0)[1] ** 2)))


def judge(problem: Problem, alternatives: Mapping[str, Sequence[Array]]) -> dict[str, Judgement]:
    """Every cause of the problem, by id. `alternatives` has columns of other ids."""
    full = np.hstack([problem.base, *problem.causes.values()])
    sigma = floor(problem)
    weight = _weight(problem, full, sigma)
    cost, residual = _fit(problem, full, weight)
    independent = _independent(residual, problem.run)
    found = {}
    for cause, columns in problem.causes.items():
        rest = np.hstack([problem.base, *(c for name, c in problem.causes.items() if name != cause)])
        without, left = _fit(problem, rest, weight)
        more = max(float(np.mean(left**2) - np.mean(residual**2)), 0.0)

        def odds(cost_with: float, count: int, without: float = without) -> float:
            return 0.5 * independent * np.log(without / cost_with) - 0.5 * count * np.log(independent)

        own = odds(cost, columns.shape[1])
        allowed = []
        for name, forms in alternatives.items():
            if name == cause or name in problem.causes:
                continue
            best = max(odds(_fit(problem, np.hstack([rest, form]), weight)[0], form.shape[1]) for form in forms)
            if best > max(own - ALIKE, 0.0):
                allowed.append(name)
        found[cause] = Judgement(float(np.sqrt(more)) / sigma, float(own), tuple(sorted(allowed)))
    return found


def gain(problem: Problem, columns: Array) -> float:
    """Log odds of columns that are not a cause of the problem."""
    full = np.hstack([problem.base, *problem.causes.values()])
    weight = _weight(problem, full, floor(problem))
    without, residual = _fit(problem, full, weight)
    independent = _independent(residual, problem.run)
    cost, _ = _fit(problem, np.hstack([full, columns]), weight)
    return float(0.5 * independent * np.log(without / cost) - 0.5 * columns.shape[1] * np.log(independent))


def _weight(problem: Problem, columns: Array, sigma: float) -> float:
    """Weight of a nuisance of one standard deviation against one row: sigma^2 rows / independent rows."""
    residual = _fit(problem, columns, 0.0)[1]
    return sigma**2 * residual.size / _independent(residual, problem.run)


def _fit(problem: Problem, columns: Array, weight: float) -> tuple[float, Array]:
    """Cost (sum of squares and of the nuisances' penalties) and residual (rows,)."""
    size = np.sqrt(np.mean(columns**2, axis=0))
    scaled = columns / np.where(size > 0.0, size, 1.0)
    nuisance = problem.nuisance * problem.spread
    design = np.hstack([scaled, nuisance])
    penalty = np.concatenate([np.zeros(scaled.shape[1]), np.full(nuisance.shape[1], weight)])
    normal = design.T @ design + np.diag(penalty + 1e-9)
    solution = np.linalg.lstsq(normal, design.T @ problem.target, rcond=1e-13)[0]
    residual = problem.target - design @ solution
    return float(residual @ residual + penalty @ solution**2), residual


def _independent(residual: Array, run: Array) -> float:
    """Rows divided by the integrated autocorrelation time; the sum ends at five of these times."""
    total, rows = 0.0, 0
    for number in np.unique(run):
        part = residual[run == number]
        size = 1 << int(np.ceil(np.log2(2 * part.size)))
        power = np.abs(np.fft.rfft(part, size)) ** 2
        correlation = np.fft.irfft(power, size)[: part.size // 2]
        correlation /= max(correlation[0], 1e-300)
        times = 2.0 * np.cumsum(correlation) - 1.0
        ends = np.flatnonzero(np.arange(times.size) >= 5.0 * times)
        time = times[ends[0]] if ends.size else times[-1]
        total += part.size / max(time, 1.0)
        rows += part.size
    return float(min(max(total, 3.0), rows))
