"""Columns of the torque balance over filtered rows, each computed once.

Rows of  z = tau + J qddot  against  [y*, -phi_1, ..., -phi_k], all passed through the same low-pass (`Samples.reduce`):

    z = (1/K) y* - sum_k theta_k phi_k                                                     (effects.base, balance)
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.effects.base import DriveEffect, Effect
from drake_tc.effects.within_tolerance import WithinTolerance
from drake_tc.types import BoolArray, FloatArray

CACHE_BYTES = 150_000_000


@dataclass(frozen=True)
class Term:
    """An effect together with a value of its shape parameters."""

    effect: Effect
    shape: Mapping[str, float] = field(default_factory=dict)

    @property
    def cache_key(self) -> tuple[object, ...]:
        """Same key, same columns."""
        return (self.effect.key, len(self.effect.coefficients), *(round(float(v), 12) for v in self.shape.values()))


def coefficients_by_term(terms: Sequence[Term], beta: FloatArray) -> Iterator[tuple[Term, FloatArray]]:
    """Each term with its coefficients theta (k,) of beta (1 + sum k,) = [1/K, theta ...]."""
    at = 1
    for term in terms:
        theta = beta[at : at + len(term.effect.coefficients)]
        at += theta.size
        yield term, theta


def prior_coefficients(terms: Sequence[Term]) -> BoolArray:
    """(1 + sum k,) which coefficients of beta have a prior: sensor errors within tolerance, which are not reported."""
    parts = [np.full(len(t.effect.coefficients), isinstance(t.effect, WithinTolerance)) for t in terms]
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
            inertia += term.effect.balance_inertia(theta, term.shape, rotor_inertia)
        return cls(float(beta[0]), found["viscous"], found["coulomb"], inertia)


def drives(terms: Sequence[Term]) -> list[Term]:
    """Those that change the effort itself, with a shape or a filter."""
    return [t for t in terms if isinstance(t.effect, DriveEffect) and (t.effect.shapes or t.effect.filters)]


class Columns:
    """Reduced columns of terms over one `Samples`, each computed once."""

    def __init__(
        self,
        samples: Samples,
        gain: float | None = None,
        target: FloatArray | None = None,
        declared_gain: float | None = None,
    ) -> None:
        """Columns over `samples`; `gain` [effort/(N m)] in which all residuals are told, None for each fit's own.

        With a gain of its own a drive effect could make its residual small by making the gain small. `target` replaces
        tau + J qddot (N,). With a `declared_gain` K_0 [effort/(N m)] fits hold the drive at it unless one of their
        effects says that it is wrong.
        """
        self.declared_gain = declared_gain
        self.samples = samples
        self.gain = gain
        s = samples.signals
        if target is None:
            target = samples.reduce(s.load_torque + s.rotor_inertia * s.acceleration + s.known_torque)
        self.target = target
        self._cache: dict[tuple[object, ...], FloatArray] = {}

    def __getstate__(self) -> dict[str, object]:
        """Without what has been computed."""
        return self.__dict__ | {"_cache": {}}

    @property
    def effort_is_target(self) -> bool:
        """Whether the effort alone tells the torques: an unknown load, with a gain that is held."""
        return self.samples.load_unknown and self.declared_gain is not None

    def effort(self, terms: Sequence[Term]) -> FloatArray:
        """y* (N,) after every drive effect among the terms, low-passed to the rows."""
        key = ("effort", *(k for t in drives(terms) for k in t.cache_key))
        return self._kept(key, lambda: self.samples.reduce(self.acting_effort(terms)))

    def acting_effort(self, terms: Sequence[Term], offset: FloatArray | float = 0.0) -> FloatArray:
        """y* (T,) after every drive effect among the terms, in the library's order, at the effort + `offset` (T,)."""
        values = self.samples.signals.effort + offset
        for term in drives(terms):
            values = self.samples.by_segment(term.effect, term.shape, values)
        return values

    def of(self, term: Term) -> FloatArray:
        """Phi (N, k) of one term."""

        def reduced() -> FloatArray:
            values = self.samples.by_segment(term.effect, term.shape)
            return self.samples.reduce(values, fresh=not term.effect.linear)

        return self._kept(term.cache_key, reduced)

    def _kept(self, key: tuple[object, ...], compute: Callable[[], FloatArray]) -> FloatArray:
        """What is computed once; all of it is dropped where it takes more than `CACHE_BYTES`."""
        if key not in self._cache:
            value = compute()
            if sum(each.nbytes for each in self._cache.values()) + value.nbytes > CACHE_BYTES:
                self._cache.clear()
            self._cache[key] = value
        return self._cache[key]

    def prior_precision(self, terms: Sequence[Term], variance: float | None = None) -> FloatArray:
        """(1 + sum k,) precision of the prior of the coefficients of these terms, about 0 and relative to the rows.

        It is 0 where nothing is known beforehand, and positive for sensor errors within tolerance.
        `variance`: of the residual [N^2 m^2]; None takes that of the declared model.
        """
        sensors, parts = self.samples.sensor_prior, [np.zeros(1)]
        for term in terms:
            if sensors is not None and isinstance(term.effect, WithinTolerance):
                weight = (sensors.variance if variance is None else variance) / sensors.share
                parts.append(weight / np.array(term.effect.tolerances) ** 2)
            else:
                parts.append(np.zeros(len(term.effect.coefficients)))
        return np.concatenate(parts)

    def changed(self, **arguments: Any) -> "Columns":
        """These columns with other arguments of the constructor; without what has been computed."""
        names = ("samples", "gain", "target", "declared_gain")
        return Columns(**{name: arguments.get(name, getattr(self, name)) for name in names})

    def with_model(self, terms: Sequence[Term], beta: FloatArray, *, servo: bool) -> "Columns":
        """The same samples once a model's terms and their beta = [1/K, theta ...] are known: see `Signals`."""
        s = self.samples.signals
        known = BalanceCoefficients.of(terms, beta, s.rotor_inertia)
        stiffness = known.stiffness if servo else 0.0
        signals = replace(s, viscous=known.viscous, stiffness=stiffness)
        return self.changed(samples=replace(self.samples, signals=signals), gain=1.0 / max(known.stiffness, 1e-9))

    def design(self, terms: Sequence[Term]) -> FloatArray:
        """[y*, -phi ...] (N, 1 + sum k)."""
        blocks = [self.effort(terms)[:, None]] + [-self.of(t) for t in terms if t.effect.coefficients]
        return np.concatenate(blocks, axis=1)
