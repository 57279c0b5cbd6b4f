"""The torque balance of a set of effects as a regression, with everything cross-validation needs in one pass.

Rows of  z = tau + J qddot  against  [y*, -phi_1, ..., -phi_k], all passed through the same low-pass (`Samples.reduce`):

    z = (1/K) y* - sum_k theta_k phi_k                                                     (effects.base, balance)

Residuals are told in the drive's effort: K (z - z_hat), the effort that the model asks too little.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from drake_tc.diagnosis.resolution import NoiseFloor
from drake_tc.diagnosis.samples import Samples
from drake_tc.effects.base import DriveEffect, Effect
from drake_tc.types import FloatArray, IntArray

FOLDS = 5
CACHE_BYTES = 300_000_000


@dataclass(frozen=True)
class Term:
    """An effect together with a value of its shape parameters."""

    effect: Effect
    shape: Mapping[str, float] = field(default_factory=dict)

    @property
    def cache_key(self) -> tuple[object, ...]:
        """Same key, same columns."""
        return (self.effect.key, *(round(float(v), 12) for v in self.shape.values()))

    @property
    def size(self) -> int:
        """Number of parameters it adds."""
        return len(self.effect.coefficients) + len(self.effect.shapes)


class Columns:
    """Reduced columns of terms over one `Samples`, each computed once."""

    def __init__(
        self,
        samples: Samples,
        gain: float | None = None,
        floor: NoiseFloor | None = None,
        target: FloatArray | None = None,
    ) -> None:
        """Columns over `samples`; `gain` [effort/(N m)] in which all residuals are told, None for each fit's own.

        With a gain of its own a drive effect could make its residual small by making the gain small. `floor` then also
        weighs the noise that each fit's coefficients let through. `target` replaces tau + J qddot (N,).
        """
        self.samples = samples
        self.gain = gain
        self.floor = floor
        signals = samples.signals
        inertial = signals.rotor_inertia * signals.acceleration
        if target is None:
            target = samples.reduce(signals.load_torque + inertial + signals.known_torque)
        self.target = target
        self._cache: dict[tuple[object, ...], FloatArray] = {}
        self._bytes = 0
        folds = fold_of(samples.block)
        self._order = np.argsort(folds, kind="stable")
        self._ends = np.cumsum(np.bincount(folds, minlength=FOLDS))
        self._sorted: dict[tuple[object, ...], FloatArray] = {}
        self._products: dict[tuple[object, ...], FloatArray] = {}

    def effort(self, terms: Sequence[Term]) -> FloatArray:
        """y* (N,) after every drive effect among the terms, in the library's order."""
        drives, key = self._drives(terms), self._effort_key(terms)
        if key not in self._cache:
            values = self.samples.signals.effort
            for term in drives:
                values = self.samples.by_segment(term.effect, term.shape, values)
            self._remember(key, self.samples.reduce(values))
        return self._cache[key]

    @staticmethod
    def _drives(terms: Sequence[Term]) -> list[Term]:
        return [t for t in terms if isinstance(t.effect, DriveEffect) and t.effect.shapes]

    def _effort_key(self, terms: Sequence[Term]) -> tuple[object, ...]:
        return ("effort", *(k for t in self._drives(terms) for k in t.cache_key))

    def of(self, term: Term) -> FloatArray:
        """Phi (N, k) of one term."""
        key = term.cache_key
        if key not in self._cache:
            values = self.samples.by_segment(term.effect, term.shape)
            self._remember(key, self.samples.reduce(values, fresh=not term.effect.linear))
        return self._cache[key]

    def _remember(self, key: tuple[object, ...], value: FloatArray) -> None:
        self._bytes += 2 * value.nbytes
        if self._bytes > CACHE_BYTES:
            self._cache.clear()
            self._sorted.clear()
            self._products.clear()
            self._bytes = 2 * value.nbytes
        self._cache[key] = value

    def normal(self, terms: Sequence[Term]) -> "Normal":
        """Normal equations of a set of terms; the products of two terms' columns are computed once."""
        acting = [t for t in terms if t.effect.coefficients]
        keys = [self._effort_key(terms), *(t.cache_key for t in acting)]
        sorted_ = [self._by_fold(keys[0], lambda: self.effort(terms)[:, None])]
        sorted_ += [self._by_fold(t.cache_key, lambda t=t: -self.of(t)) for t in acting]  # type: ignore[misc]
        target = self._by_fold(("target",), lambda: self.target[:, None])
        widths = np.cumsum([0, *(x.shape[1] for x in sorted_)])
        size = int(widths[-1])
        grams, moments = np.empty((FOLDS, size, size)), np.empty((FOLDS, size))
        for i, (key, x) in enumerate(zip(keys, sorted_, strict=True)):
            mine = slice(widths[i], widths[i + 1])
            moments[:, mine] = self._product(key, x, ("target",), target)[:, :, 0]
            for j in range(i, len(keys)):
                other = slice(widths[j], widths[j + 1])
                product = self._product(key, x, keys[j], sorted_[j])
                grams[:, mine, other] = product
                grams[:, other, mine] = product.transpose(0, 2, 1)
        return Normal(grams, moments, self._product(("target",), target, ("target",), target)[:, 0, 0])

    def _by_fold(self, key: tuple[object, ...], values: Callable[[], FloatArray]) -> FloatArray:
        """Columns (N, k) with the rows of each fold together."""
        if key not in self._sorted:
            made = values()  # may empty the caches
            self._sorted[key] = np.ascontiguousarray(made[self._order])
        return self._sorted[key]

    def _product(self, a: tuple[object, ...], x: FloatArray, b: tuple[object, ...], y: FloatArray) -> FloatArray:
        """X'Y (FOLDS, k, l) by fold."""
        if (a, b) not in self._products:
            starts = np.concatenate([[0], self._ends[:-1]])
            self._products[a, b] = np.stack([x[s:e].T @ y[s:e] for s, e in zip(starts, self._ends, strict=True)])
        return self._products[a, b]

    def with_model(self, beta: FloatArray, *, servo: bool, true_torque: FloatArray | None = None) -> "Columns":
        """The same samples once the declared model's [1/K, F_v, F_c, ...] is known: see `Signals`.

        `true_torque` (T,): what a found sensor error leaves of the measured load, for effects that depend on it.
        """
        s = self.samples.signals
        expected = beta[0] * s.effort - beta[1] * s.velocity - beta[2] * s.direction - s.rotor_inertia * s.acceleration
        stiffness = float(beta[0]) if servo else 0.0
        if true_torque is not None:
            s = replace(s, load_torque=true_torque)
        signals = replace(s, viscous=float(beta[1]), stiffness=stiffness, expected_torque=expected)
        gain = 1.0 / max(float(beta[0]), 1e-9)
        return Columns(replace(self.samples, signals=signals), gain, self.samples.floor, self.target)

    def noise_ratio(self, beta: FloatArray, terms: Sequence[Term]) -> float:
        """Noise floor under the declared model over that under beta: a fit that lets less encoder noise through, by a
        smaller 1/K or F_v, has not explained anything by that (errors in variables).
        """
        if self.floor is None or self.gain is None:
            return 1.0
        at, inertia = 1, 0.0
        for term in terms:
            theta = beta[at : at + len(term.effect.coefficients)]
            inertia += term.effect.balance_inertia(theta, self.samples.signals.rotor_inertia)
            at += theta.size
        own = self.floor.torque(float(beta[0]), float(beta[1]), inertia)
        declared = self.floor.torque(1.0 / self.gain, self.samples.signals.viscous)
        return float(np.clip(declared / max(own, 1e-300), 0.5, 2.0))

    def design(self, terms: Sequence[Term]) -> FloatArray:
        """[y*, -phi ...] (N, 1 + sum k)."""
        blocks = [self.effort(terms)[:, None]] + [-self.of(t) for t in terms if t.effect.coefficients]
        return np.concatenate(blocks, axis=1)


@dataclass(frozen=True)
class Fit:
    """Least squares of one set of terms.

    Attributes:
        terms: In the order of the columns, after the drive's own.
        beta: (1 + sum k,) [1/K, theta ...].
        residual: (N,) K (z - z_hat) on the training rows [effort].
        rms: Of the residual.
        cv_rms: The same, every fold predicted from the others, noise let through weighed (`Columns.noise_ratio`).
        block_sse: (B,) cross-validated squared residual by block [effort^2].
        block_rows: (B,) rows by block.
    """

    terms: tuple[Term, ...]
    beta: FloatArray
    residual: FloatArray
    rms: float
    cv_rms: float
    block_sse: FloatArray
    block_rows: FloatArray

    @property
    def gain(self) -> float:
        """K [effort/(N m)]."""
        return float(1.0 / self.beta[0]) if self.beta[0] > 0.0 else float("nan")

    @property
    def size(self) -> int:
        """Number of parameters, shapes included."""
        return 1 + sum(t.size for t in self.terms)


def bounds_of(terms: Sequence[Term]) -> tuple[FloatArray, FloatArray]:
    """Lower and upper bounds of beta."""
    lower, upper = [1e-12], [np.inf]
    for term in terms:
        lower += [p.lower for p in term.effect.coefficients]
        upper += [p.upper for p in term.effect.coefficients]
    return np.array(lower), np.array(upper)


def solve_bounded(gram: FloatArray, moment: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Argmin beta' G beta / 2 - m' beta in a box, by an active set that only grows (few bounds are ever active)."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    g = gram / np.outer(scale, scale)
    g = g + 1e-12 * np.eye(g.shape[0])
    m = moment / scale
    low, high = lower * scale, upper * scale
    beta = np.zeros(m.size)
    fixed = np.zeros(m.size, dtype=bool)
    for _ in range(m.size + 1):
        free = ~fixed
        beta[free] = np.linalg.solve(g[np.ix_(free, free)], m[free] - g[np.ix_(free, fixed)] @ beta[fixed])
        outside = free & ((beta < low - 1e-12) | (beta > high + 1e-12))
        if not outside.any():
            break
        beta[outside] = np.clip(beta[outside], low[outside], high[outside])
        fixed |= outside
    return np.asarray(beta / scale)


def collinear(gram: FloatArray) -> bool:
    """Whether columns, dead ones aside, cannot be told apart: scaled to unit length their condition exceeds 10^4.5."""
    scale = np.sqrt(np.diag(gram))
    live = scale > 1e-9 * scale.max()
    unit = gram[np.ix_(live, live)] / np.outer(scale[live], scale[live])
    return bool(np.linalg.cond(unit) > 1e9)


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of one set of terms by fold, from cached products of columns.

    Attributes:
        grams: (FOLDS, m, m) X'X. moments: (FOLDS, m) X'z. squares: (FOLDS,) z'z.
    """

    grams: FloatArray
    moments: FloatArray
    squares: FloatArray


def fold_of(block: IntArray) -> IntArray:
    """Blocks dealt to folds in pairs, so that neighbours mostly share a fold."""
    return np.asarray((block // 2) % FOLDS)


@dataclass(frozen=True)
class Score:
    """Coefficients and errors of a set of terms without its residual.

    Attributes:
        terms: In the order of the columns.
        beta: (1 + sum k,). by_fold: (FOLDS, 1 + sum k) fitted without each fold.
        cv_rms: Cross-validated, noise let through weighed.
        gain: K in which errors are told. noise_correction: Weight of the noise let through.
    """

    terms: tuple[Term, ...]
    beta: FloatArray
    by_fold: FloatArray
    cv_rms: float
    gain: float
    noise_correction: float


def score(columns: Columns, terms: Sequence[Term]) -> Score:
    """Least squares with blockwise cross-validation, from normal equations alone."""
    normal = columns.normal(terms)
    low, high = bounds_of(terms)
    gram, moment = normal.grams.sum(0), normal.moments.sum(0)
    beta = solve_bounded(gram, moment, low, high)
    gain = columns.gain or 1.0 / float(beta[0])
    correction = np.inf if collinear(gram) else columns.noise_ratio(beta, terms)
    by_fold = np.empty((FOLDS, beta.size))
    total = 0.0
    for f in range(FOLDS):
        part = by_fold[f] = solve_bounded(gram - normal.grams[f], moment - normal.moments[f], low, high)
        error = normal.squares[f] - 2.0 * part @ normal.moments[f] + part @ normal.grams[f] @ part
        total += max(float(error), 0.0)
    cv_rms = gain * correction * float(np.sqrt(total / columns.target.size))
    return Score(tuple(terms), beta, by_fold, cv_rms, gain, correction)


def fit(columns: Columns, terms: Sequence[Term]) -> Fit:
    """Least squares with blockwise cross-validation, from normal equations of the folds.

    Args:
        columns: Reduced columns of the training rows.
        terms: The effects.
    """
    found = score(columns, terms)
    x, z, block = columns.design(terms), columns.target, columns.samples.block
    folds = fold_of(block)
    held = np.empty_like(z)
    for f in range(FOLDS):
        rows = folds == f
        held[rows] = z[rows] - x[rows] @ found.by_fold[f]
    held = held * (found.gain * found.noise_correction)
    residual = (z - x @ found.beta) * found.gain
    count = int(block.max()) + 1
    return Fit(
        terms=found.terms,
        beta=found.beta,
        residual=residual,
        rms=float(np.sqrt(np.mean(residual**2))),
        cv_rms=float(np.sqrt(np.mean(held**2))),
        block_sse=np.bincount(block, held**2, count).astype(float),
        block_rows=np.bincount(block, minlength=count).astype(float),
    )


def predict(columns: Columns, fitted: Fit) -> FloatArray:
    """Residual K (z - z_hat) (N,) of a fit on other samples, e.g. held-out runs."""
    return np.asarray((columns.target - columns.design(fitted.terms) @ fitted.beta) * (columns.gain or fitted.gain))
