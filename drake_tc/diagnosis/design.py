"""The torque balance of a set of effects as a regression, with everything cross-validation needs in one pass.

Rows of  z = tau + J qddot  against  [y*, -phi_1, ..., -phi_k], all passed through the same low-pass (`Samples.reduce`):

    z = (1/K) y* - sum_k theta_k phi_k                                                     (effects.base, balance)

Residuals are told in the drive's effort: K (z - z_hat), the effort that the model asks too little.
"""

from collections.abc import Mapping, Sequence
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

    def effort(self, terms: Sequence[Term]) -> FloatArray:
        """y* (N,) after every drive effect among the terms, in the library's order."""
        drives = [t for t in terms if isinstance(t.effect, DriveEffect) and t.effect.shapes]
        key = ("effort", *(k for t in drives for k in t.cache_key))
        if key not in self._cache:
            values = self.samples.signals.effort
            for term in drives:
                values = self.samples.by_segment(term.effect, term.shape, values)
            self._remember(key, self.samples.reduce(values))
        return self._cache[key]

    def of(self, term: Term) -> FloatArray:
        """Phi (N, k) of one term."""
        key = term.cache_key
        if key not in self._cache:
            values = self.samples.by_segment(term.effect, term.shape)
            self._remember(key, self.samples.reduce(values, fresh=not term.effect.linear))
        return self._cache[key]

    def _remember(self, key: tuple[object, ...], value: FloatArray) -> None:
        self._bytes += value.nbytes
        if self._bytes > CACHE_BYTES:
            self._cache.clear()
            self._bytes = value.nbytes
        self._cache[key] = value

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


def fold_of(block: IntArray) -> IntArray:
    """Blocks dealt to folds in pairs, so that neighbours mostly share a fold."""
    return np.asarray((block // 2) % FOLDS)


def fit(columns: Columns, terms: Sequence[Term], weights: FloatArray | None = None) -> Fit:
    """Least squares with blockwise cross-validation, from Gram matrices of the folds.

    Args:
        columns: Reduced columns of the training rows.
        terms: The effects.
        weights: (N,) for each row, or None.
    """
    x = columns.design(terms)
    z = columns.target
    xw = x if weights is None else x * weights[:, None]
    block = columns.samples.block
    folds = fold_of(block)
    grams = np.stack([xw[folds == f].T @ x[folds == f] for f in range(FOLDS)])
    moments = np.stack([xw[folds == f].T @ z[folds == f] for f in range(FOLDS)])
    low, high = bounds_of(terms)
    total_gram, total_moment = grams.sum(0), moments.sum(0)
    beta = solve_bounded(total_gram, total_moment, low, high)
    gain = columns.gain or 1.0 / beta[0]
    fair = np.inf if collinear(total_gram) else columns.noise_ratio(beta, terms)
    held = np.empty_like(z)
    for f in range(FOLDS):
        rows = folds == f
        if rows.any():
            part = solve_bounded(total_gram - grams[f], total_moment - moments[f], low, high)
            held[rows] = (z[rows] - x[rows] @ part) * gain
    residual = (z - x @ beta) * gain
    held = held * fair
    if weights is not None:
        held = held * np.sqrt(weights)
    count = int(block.max()) + 1
    sse = np.bincount(block, held**2, count).astype(float)
    return Fit(
        terms=tuple(terms),
        beta=beta,
        residual=residual,
        rms=float(np.sqrt(np.mean(residual**2))),
        cv_rms=float(np.sqrt(np.mean(held**2))),
        block_sse=sse,
        block_rows=np.bincount(block, minlength=count).astype(float),
    )


def predict(columns: Columns, fitted: Fit) -> FloatArray:
    """Residual K (z - z_hat) (N,) of a fit on other samples, e.g. held-out runs."""
    return np.asarray((columns.target - columns.design(fitted.terms) @ fitted.beta) * (columns.gain or fitted.gain))
