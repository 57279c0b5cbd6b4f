"""The inertial parameters of links that were fitted, the combinations that the logs identify, and what links carry."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.shared.causes import AXES, LINK_PARAMETERS_ID, PAYLOAD_ID, Cause
from drake_tc.identification.regression import base_combinations
from drake_tc.robot.rigid_regressor import LinkModel
from drake_tc.types import FloatArray, IntArray

SEEN = 2000
"""Rows of each joint from which the identified combinations follow."""
WORTH_NAMING = 0.01
"""Share of a combination's declared size below which a member is left out of its name."""


@dataclass(frozen=True)
class LinkEstimate:
    """One inertial parameter, about the link's origin and in its axes; what is welded to the link is part of it.

    Attributes:
        link, name: Which. declared: of the robot's file. estimate: fitted, with its 95 % interval.
        narrowed: Standard deviation after the fit over the declared tolerance: near 1 where the logs tell nothing.
    """

    link: str
    name: str
    declared: float
    estimate: Estimate
    narrowed: float


@dataclass(frozen=True)
class BaseParameter:
    """A combination of inertial parameters that joint torques tell by itself.

    Attributes:
        name: The combination, small members left out. declared: its value by the robot's file.
        estimate: fitted, with its 95 % interval.
        weights: Factor of each of its members, `<link>/<parameter>`.
    """

    name: str
    declared: float
    estimate: Estimate
    weights: Mapping[str, float]


@dataclass(frozen=True)
class FittedLinks:
    """What was fitted of the links: their parameters, the base parameters, and payloads by run and parameter."""

    parameters: tuple[LinkEstimate, ...]
    base: tuple[BaseParameter, ...]
    payloads: dict[str, dict[str, Estimate]]


@dataclass(frozen=True, eq=False)
class LinkPosterior:
    """What a fit of all joints knows of the links' errors delta, the parameters of the file less the true ones.

    Attributes:
        columns: (p,) their places among all shared parameters.
        delta: (p,). spread: (p, p) their covariance. tolerance: (p,) standard deviations of their prior.
        critical: Half width of a 95 % interval over the standard deviation.
        gain_tolerance: Common relative error of the declared drive gains, one standard deviation.
    """

    columns: IntArray
    delta: FloatArray
    spread: FloatArray
    tolerance: FloatArray
    critical: float
    gain_tolerance: float


def links_of(model: LinkModel, causes: Sequence[Cause], told: LinkPosterior, seen: FloatArray) -> FittedLinks:
    """The links' parameters and the combinations of them that the logs identify."""
    units = [unit for cause in causes for unit in cause.units]
    places = [p for c in causes if c.id == LINK_PARAMETERS_ID for p in range(c.columns.start, c.columns.stop)]
    links = np.isin(told.columns, places)
    pi, of_links = model.nominal - told.delta[links], told.spread[np.ix_(links, links)]
    narrowed = np.sqrt(np.maximum(np.diag(of_links), 0.0)) / told.tolerance[links]
    of_links = of_links + told.gain_tolerance**2 * np.outer(pi, pi)
    sigma = np.sqrt(np.maximum(np.diag(of_links), 0.0))
    parameters = []
    for k, full in enumerate(model.tree.parameters):
        link, _, name = full.rpartition("/")
        estimate = _estimate(pi[k], told.critical * sigma[k], units[k])
        parameters.append(LinkEstimate(link, name, float(model.nominal[k]), estimate, float(narrowed[k])))
    carried = [c for c in causes if c.id == PAYLOAD_ID]
    payloads = {c.where: _payload(c, told) for c in carried}
    base = _base(model, seen[:, told.columns[links]], pi, of_links, told.critical, units)
    return FittedLinks(tuple(parameters), base, payloads)


def _base(
    model: LinkModel,
    seen: FloatArray,
    pi: FloatArray,
    spread: FloatArray,
    critical: float,
    units: Sequence[str],
) -> tuple[BaseParameter, ...]:
    places, mix = base_combinations(seen)
    value, declared = mix @ pi, mix @ model.nominal
    sigma = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", mix, spread, mix), 0.0))
    names = model.tree.parameters
    return tuple(
        BaseParameter(
            _combination(names, weights, place),
            float(d),
            _estimate(v, critical * s, units[place]),
            {names[k]: float(weights[k]) for k in np.flatnonzero(weights)},
        )
        for place, weights, v, d, s in zip(places, mix, value, declared, sigma, strict=True)
    )


def _combination(names: Sequence[str], weights: FloatArray, first: int) -> str:
    """The parameters of a combination with their factors, the one that names it first."""
    order = [first, *(k for k in np.argsort(-np.abs(weights)) if k != first and abs(weights[k]) > WORTH_NAMING)]
    parts = [names[first], *(f"{weights[k]:+.3g} {names[k]}" for k in order[1:])]
    return " ".join(parts)


def _payload(cause: Cause, told: LinkPosterior) -> dict[str, Estimate]:
    place = np.flatnonzero(np.isin(told.columns, np.arange(cause.columns.start, cause.columns.stop)))
    value = cause.physical(told.delta[place])
    variance = np.maximum(np.diag(told.spread)[place], 0.0) + (told.gain_tolerance * value) ** 2
    half = told.critical * np.sqrt(variance)
    return {n: _estimate(v, h, u) for n, v, h, u in zip(cause.parameters, value, half, cause.units, strict=True)}


def _estimate(value: float, half: float, unit: str) -> Estimate:
    return Estimate(float(value), unit, (float(value - half), float(value + half)), False)


def body_parameters(inertial: FloatArray, spread: FloatArray, quantile: float) -> dict[str, Estimate]:
    """Mass m and centre c = h/m of what a link carries, with 95 % intervals to first order.

        var c_i = (var h_i - 2 c_i cov(h_i, m) + c_i^2 var m)/m^2

    Its inertia is estimated along with them, and not reported: rotors and friction of the last joints hide it.

    Args:
        inertial: (10,) `LINK_PARAMETERS`.
        spread: (10, 10) their covariance.
        quantile: Half width of an interval over the standard deviation.
    """
    mass, centre = float(inertial[0]), inertial[1:4] / inertial[0]
    gradient = np.zeros((4, inertial.size))
    gradient[0, 0] = 1.0
    gradient[1:, 0], gradient[1:, 1:4] = -centre / mass, np.eye(3) / mass
    width = quantile * np.sqrt(np.maximum(np.diag(gradient @ spread @ gradient.T), 0.0))
    names = (("mass", "kg"), *((f"com_{axis}", "m") for axis in AXES))
    return {
        name: Estimate(value, unit, (value - half, value + half), False)
        for (name, unit), value, half in zip(names, [mass, *centre.tolist()], width.tolist(), strict=True)
    }
