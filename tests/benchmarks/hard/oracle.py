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
from scipy.ndimage import uniform_filter1d

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
        smooth: Rows over which a residual is averaged before its size is stated; the log odds use all rows.
    """

    target: Array
    base: Array
    nuisance: Array
    spread: Array
    causes: Mapping[str, Array]
    run: Array
    smooth: int = 1


@dataclass(frozen=True)
class Judgement:
    """Of one cause: size of what the model without it leaves, in floors; its log odds; ids that are as good."""

    floors: float
    log_odds: float
    allowed: tuple[str, ...]


class _Fits:
    """Least-squares fits of subsets of columns, from one matrix of products."""

    def __init__(self, problem: Problem, more: Array | None = None) -> None:
        """Products of all columns: base, causes, `more`, nuisances. `full` has the base and all causes."""
        blocks = [problem.base, *problem.causes.values(), *([] if more is None else [more])]
        ends = np.cumsum([block.shape[1] for block in blocks])
        self.base, *others = (np.arange(end - block.shape[1], end) for end, block in zip(ends, blocks, strict=True))
        self.causes = dict(zip(problem.causes, others, strict=False))
        self.more = np.arange(ends[len(problem.causes)], ends[-1])
        self.full = np.concatenate([self.base, *self.causes.values()])
        size = [np.sqrt(np.mean(block**2, axis=0)) for block in blocks]
        scaled = [block / np.where(s > 0.0, s, 1.0) for block, s in zip(blocks, size, strict=True)]
        self._design = np.hstack([*scaled, problem.nuisance * problem.spread])
        self._nuisance = np.arange(ends[-1], self._design.shape[1])
        self._normal = self._design.T @ self._design + 1e-9 * np.eye(self._design.shape[1])
        self._right = self._design.T @ problem.target
        self._target, self._power = problem.target, float(problem.target @ problem.target)

        first = self.residual(self.full, 0.0)
        self.weight = float(first @ first) / _independent(first, problem.run)
        self.independent = _independent(self.residual(self.full, self.weight), problem.run)

    def _solution(self, columns: Array, weight: float) -> tuple[Array, Array]:
        used = np.concatenate([columns, self._nuisance])
        penalty = np.concatenate([np.zeros(columns.size), np.full(self._nuisance.size, weight)])
        normal = self._normal[np.ix_(used, used)] + np.diag(penalty)
        solution = np.linalg.lstsq(normal, self._right[used], rcond=1e-13)[0]
        return used, solution

    def residual(self, columns: Array, weight: float) -> Array:
        """(rows,) what a fit leaves; a nuisance of one standard deviation costs as much as `weight`."""
        used, solution = self._solution(columns, weight)
        return self._target - self._design[:, used] @ solution

    def cost(self, columns: Array) -> float:
        """Sum of squares and of the nuisances' penalties."""
        used, solution = self._solution(columns, self.weight)
        left = self._power - 2.0 * solution @ self._right[used]
        squares = float(left + solution @ self._normal[np.ix_(used, used)] @ solution)
        return squares + self.weight * float(np.sum(solution[columns.size :] ** 2))

    def odds(self, without: Array, columns: Array) -> float:
        """Log odds of the model with both sets of columns against the one with the first."""
        costs = self.cost(without), self.cost(np.concatenate([without, columns]))
        return 0.5 * self.independent * np.log(costs[0] / costs[1]) - 0.5 * columns.size * np.log(self.independent)


def floor(problem: Problem) -> float:
    """RMS of what the true model leaves, averaged over `smooth` rows, in the unit of the effort."""
    fits = _Fits(problem)
    return _size(fits.residual(fits.full, fits.weight), problem)


def _size(residual: Array, problem: Problem) -> float:
    """RMS after the average over `smooth` rows."""
    return float(np.sqrt(np.mean(uniform_filter1d(residual, problem.smooth) ** 2)))


def judge(problem: Problem, alternatives: Mapping[str, Sequence[Array]]) -> dict[str, Judgement]:
    """Every cause of the problem, by id. `alternatives` has columns of other ids, in one or more forms."""
    forms = [(name, form) for name, several in alternatives.items() for form in several]
    fits = _Fits(problem, np.hstack([form for _, form in forms]) if forms else None)
    places = np.split(fits.more, np.cumsum([form.shape[1] for _, form in forms])[:-1]) if forms else []
    true = _size(fits.residual(fits.full, fits.weight), problem)
    found = {}
    for cause, columns in fits.causes.items():
        rest = np.setdiff1d(fits.full, columns)
        left = _size(fits.residual(rest, fits.weight), problem)
        own = fits.odds(rest, columns)
        least = max(own - ALIKE, 0.0)
        allowed = {name for (name, _), place in zip(forms, places, strict=True) if fits.odds(rest, place) > least}
        found[cause] = Judgement(float(np.sqrt(max(left**2 - true**2, 0.0))) / true, float(own), tuple(sorted(allowed)))
    return found


def gain(problem: Problem, columns: Array) -> float:
    """Log odds of columns that are not a cause of the problem."""
    fits = _Fits(problem, columns)
    return float(fits.odds(fits.full, fits.more))


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
