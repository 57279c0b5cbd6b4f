"""Columns of the torque balance over filtered rows, each computed once, and the normal equations made of them.

Rows of  z = tau + J qddot  against  [y*, -phi_1, ..., -phi_k], all passed through the same low-pass (`Samples.reduce`):

    z = (1/K) y* - sum_k theta_k phi_k                                                     (effects.base, balance)
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from drake_tc.diagnosis.data.resolution import NoiseFloor
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.bounded import Prior
from drake_tc.diagnosis.problem.normal_equations import FOLDS, Normal, fold_of
from drake_tc.effects.base import DriveEffect, Effect
from drake_tc.effects.within_tolerance import WithinTolerance
from drake_tc.types import BoolArray, FloatArray

CACHE_BYTES = 300_000_000


@dataclass(frozen=True)
class Term:
    """An effect together with a value of its shape parameters."""

    effect: Effect
    shape: Mapping[str, float] = field(default_factory=dict)

    @property
    def cache_key(self) -> tuple[object, ...]:
        """Same key, same columns."""
        return (self.effect.key, len(self.effect.coefficients), *(round(float(v), 12) for v in self.shape.values()))

    @property
    def size(self) -> int:
        """Number of parameters it adds."""
        return self.effect.degrees_of_freedom


def coefficients_by_term(terms: Sequence[Term], beta: FloatArray) -> Iterator[tuple[Term, FloatArray]]:
    """Each term with its coefficients theta (k,) of beta (1 + sum k,) = [1/K, theta ...]."""
    at = 1
    for term in terms:
        theta = beta[at : at + len(term.effect.coefficients)]
        at += theta.size
        yield term, theta


def prior_coefficients(terms: Sequence[Term], *kinds: type[Effect]) -> BoolArray:
    """(1 + sum k,) which coefficients of beta have a prior: sensor errors within tolerance.

    They are estimated along and not reported. `kinds`: one of the two alone.
    """
    asked = kinds or (WithinTolerance,)
    parts = [np.full(len(t.effect.coefficients), isinstance(t.effect, asked)) for t in terms]
    return np.concatenate([np.zeros(1, dtype=np.bool_), *parts])


@dataclass(frozen=True)
class BalanceCoefficients:
    """The coefficients of a fit through which sensor noise enters the balance.

    Attributes:
        stiffness: 1/K [N m/effort].
        viscous: F_v [N m s/rad], 0 where the fit has no viscous friction.
        coulomb: F_c [N m], 0 where the fit has no Coulomb friction.
        inertia: What the effects add to the declared rotor inertia [kg m^2].
    """

    stiffness: float
    viscous: float
    coulomb: float
    inertia: float

    @classmethod
    def of(cls, terms: Sequence[Term], beta: FloatArray, rotor_inertia: float = 0.0) -> Self:
        """Find them by effect, in whatever order the terms are.

        Args:
            terms: Of the fit.
            beta: (1 + sum k,) [1/K, theta ...].
            rotor_inertia: Declared J [kg m^2].
        """
        found, inertia = {"viscous": 0.0, "coulomb": 0.0}, 0.0
        for term, theta in coefficients_by_term(terms, beta):
            if term.effect.key in found:
                found[term.effect.key] = float(theta[0])
            inertia += term.effect.balance_inertia(theta, rotor_inertia)
        return cls(float(beta[0]), found["viscous"], found["coulomb"], inertia)


NOISE_RATIOS = (0.1, 10.0)
"""Smallest and largest factor by which an error is corrected for the sensor noise that its fit passes."""


class Columns:
    """Reduced columns of terms over one `Samples`, each computed once."""

    def __init__(
        self,
        samples: Samples,
        gain: float | None = None,
        floor: NoiseFloor | None = None,
        target: FloatArray | None = None,
        declared_gain: float | None = None,
        fitted_inertia: float = 0.0,
        effort_noise: float = 0.0,
    ) -> None:
        """Columns over `samples`; `gain` [effort/(N m)] in which all residuals are told, None for each fit's own.

        With a gain of its own a drive effect could make its residual small by making the gain small. `floor` then also
        weighs the noise that each fit's coefficients let through. `target` replaces tau + J qddot (N,). With a
        `declared_gain` K_0 [effort/(N m)] fits hold the drive at it unless one of their effects says that it is wrong.
        `fitted_inertia` [kg m^2] is what the effects of the known model add to the declared rotor inertia, and
        `effort_noise` [effort] is the RMS of noise of the recorded effort after the filters that `floor` does not hold.
        """
        self.declared_gain, self.fitted_inertia, self.effort_noise = declared_gain, fitted_inertia, effort_noise
        self.samples = samples
        self.gain = gain
        self.floor = floor
        s = samples.signals
        if target is None:
            target = samples.reduce(s.load_torque + s.rotor_inertia * s.acceleration + s.known_torque)
        self.target = target
        self._cache: dict[tuple[object, ...], FloatArray] = {}
        self._bytes = 0
        folds = fold_of(samples.block)
        self._order, self._ends = np.argsort(folds, kind="stable"), np.cumsum(np.bincount(folds, minlength=FOLDS))
        self._sorted: dict[tuple[object, ...], FloatArray] = {}
        self._products: dict[tuple[object, ...], FloatArray] = {}

    def __getstate__(self) -> dict[str, object]:
        """Without what has been computed."""
        return self.__dict__ | {"_cache": {}, "_sorted": {}, "_products": {}, "_bytes": 0}

    @property
    def effort_is_target(self) -> bool:
        """Whether the effort alone tells the torques: an unknown load, with a gain that is held."""
        return self.samples.load_unknown and self.declared_gain is not None

    def effort(self, terms: Sequence[Term]) -> FloatArray:
        """y* (N,) after every drive effect among the terms, low-passed to the rows."""
        key = self._effort_key(terms)
        if key not in self._cache:
            self._remember(key, self.samples.reduce(self.acting_effort(terms)))
        return self._cache[key]

    def acting_effort(self, terms: Sequence[Term], offset: float = 0.0) -> FloatArray:
        """y* (T,) after every drive effect among the terms, in the library's order, of the effort plus an offset."""
        values = self.samples.signals.effort + offset
        for term in self.drives(terms):
            values = self.samples.by_segment(term.effect, term.shape, values)
        return values

    @staticmethod
    def drives(terms: Sequence[Term]) -> list[Term]:
        """Those that change the effort with a shape or a filter."""
        return [t for t in terms if isinstance(t.effect, DriveEffect) and (t.effect.shapes or t.effect.filters)]

    def _effort_key(self, terms: Sequence[Term]) -> tuple[object, ...]:
        return ("effort", *(k for t in self.drives(terms) for k in t.cache_key))

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
            for computed in (self._cache, self._sorted, self._products):
                computed.clear()
            self._bytes = 2 * value.nbytes
        self._cache[key] = value

    def normal(self, terms: Sequence[Term]) -> Normal:
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
        squares = self._product(("target",), target, ("target",), target)
        return Normal(grams, moments, squares[:, 0, 0], self.prior(terms))

    def prior(self, terms: Sequence[Term], variance: float | None = None) -> Prior:
        """What is known beforehand of the coefficients of these terms: sensor errors within tolerance.

        `variance`: of the residual [N^2 m^2]; None takes that of the declared model.
        """
        sensors = self.samples.sensor_prior
        at, size = 1, 1 + sum(len(t.effect.coefficients) for t in terms)
        out = Prior(np.zeros(size), np.zeros(size))
        for term in terms:
            mine = slice(at, at + len(term.effect.coefficients))
            at = mine.stop
            if sensors is not None and isinstance(term.effect, WithinTolerance):
                weight = (sensors.variance if variance is None else variance) / sensors.share
                out.precision[mine] = weight / np.array(term.effect.tolerances) ** 2
        return out

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

    def changed(self, **arguments: Any) -> "Columns":
        """These columns with other arguments of the constructor; without what has been computed."""
        names = ("samples", "gain", "floor", "target", "declared_gain", "fitted_inertia", "effort_noise")
        return Columns(**{name: arguments.get(name, getattr(self, name)) for name in names})

    def with_model(
        self, terms: Sequence[Term], beta: FloatArray, *, servo: bool, true_torque: FloatArray | None = None
    ) -> "Columns":
        """The same samples once a model's terms and their beta = [1/K, theta ...] are known: see `Signals`.

        `true_torque` (T,): what a found sensor error leaves of the measured load, for effects that depend on it.
        """
        s = self.samples.signals
        known = BalanceCoefficients.of(terms, beta, s.rotor_inertia)
        friction = known.viscous * s.velocity + known.coulomb * s.direction
        # Where no other sensor tells the load, a torque from the effort holds the residual: its sign would explain 40 %
        # of any noise.
        of_effort = known.stiffness * s.effort - friction - s.rotor_inertia * s.acceleration
        expected = s.load_torque if self.effort_is_target or self.samples.resolution.effort_tells_load else of_effort
        stiffness = known.stiffness if servo else 0.0
        if true_torque is not None:
            s = replace(s, load_torque=true_torque)
        signals = replace(s, viscous=known.viscous, stiffness=stiffness, expected_torque=expected)
        gain, samples = 1.0 / max(known.stiffness, 1e-9), replace(self.samples, signals=signals)
        return self.changed(samples=samples, gain=gain, floor=self.samples.floor, fitted_inertia=known.inertia)

    def noise_ratio(self, beta: FloatArray, terms: Sequence[Term]) -> float:
        """Noise floor under the declared model over that under beta: a fit that lets less noise of the encoder through,
        by a smaller 1/K or F_v, or of the effort, by a lag, has not explained anything by that (errors in variables). A
        larger 1/K beside a drive effect lets no more of the effort's noise through: compression takes it away again.
        """
        if self.floor is None or self.gain is None:
            return 1.0
        found = BalanceCoefficients.of(terms, beta, self.samples.signals.rotor_inertia)
        share, passes = self._effort_share(terms), found.stiffness
        if any(isinstance(t.effect, DriveEffect) and not t.effect.filters for t in terms):
            passes = min(passes, 1.0 / self.gain)
        own = self.floor.torque(found.stiffness, found.viscous, found.inertia, share)
        own = float(np.hypot(own, passes * np.sqrt(share) * self.effort_noise))
        declared = self.floor.torque(1.0 / self.gain, self.samples.signals.viscous, self.fitted_inertia)
        declared = float(np.hypot(declared, self.effort_noise / self.gain))
        return float(np.clip(declared / max(own, 1e-300), *NOISE_RATIOS))

    def _effort_share(self, terms: Sequence[Term]) -> float:
        """Share of the variance of the effort's white noise that passes the filters among the drive effects.

        1 where the effort is the target: the residual before its smoothing then counts for a lag (`noise_smoothed`).
        """
        if self.effort_is_target:
            return 1.0
        drives = [(t.effect, t.shape) for t in self.drives(terms) if isinstance(t.effect, DriveEffect)]
        filters = [(effect, shape) for effect, shape in drives if effect.filters]
        return self.samples.passed_noise(filters) if filters else 1.0

    def design(self, terms: Sequence[Term]) -> FloatArray:
        """[y*, -phi ...] (N, 1 + sum k)."""
        blocks = [self.effort(terms)[:, None]] + [-self.of(t) for t in terms if t.effect.coefficients]
        return np.concatenate(blocks, axis=1)
