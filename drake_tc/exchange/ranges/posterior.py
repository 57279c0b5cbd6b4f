"""One distribution a parameter from the diagnoses of one or several units, and draws of whole models from it.

A draw is a normal vector z with the correlation of the report, taken to shares of each distribution (a Gaussian
copula): x_k = F_k^-1(Phi(z_k)).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from drake_tc.actuation.model import ActuatorModel, EffectValue
from drake_tc.errors import ParamsError
from drake_tc.exchange.ranges.unit import (
    CRITICAL,
    GAIN,
    Distribution,
    Estimated,
    NotShown,
    Unit,
    distribution,
    of_units,
    spread_between,
)
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class Posterior:
    """What is known of the parameters of a robot.

    Attributes:
        unit: The first unit, with the distributions of a further unit where several were diagnosed.
        units: How many.
    """

    unit: Unit
    units: int = 1

    @property
    def not_shown(self) -> tuple[NotShown, ...]:
        """What the logs could not show."""
        return self.unit.not_shown

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what the files do not have."""
        lines = list(self.unit.notes)
        without = [joint for joint, found in self.unit.estimated.items() if len(found) > 1]
        without = [joint for joint in without if joint not in self.unit.correlation]
        if without:
            lines.append(
                f"The report has no correlation of the parameters ({', '.join(without)}): drawn independently."
            )
        if self.units == 1:
            lines.append("One unit was diagnosed: the spread between units is not part of the ranges (--unit).")
        return tuple(lines)


def posterior_of(units: Sequence[Unit], joints: Sequence[str] | None = None) -> Posterior:
    """The distributions of a further unit.

    Args:
        units: Diagnosed ones; the first gives the models.
        joints: Only these; None: all of the first unit.

    Raises:
        ParamsError: a unit lacks a joint or a parameter of the first.
    """
    first, *others = units
    names = [name for name in first.models if not joints or name in joints]
    estimated = {name: tuple(_over_units(each, others) for each in first.estimated[name]) for name in names}
    unit = Unit(
        {name: first.models[name] for name in names},
        estimated,
        tuple(each for each in first.not_shown if each.joint in names),
        {name: matrix for name, matrix in first.correlation.items() if name in names},
        first.notes,
    )
    return Posterior(unit, len(units))


def _over_units(one: Estimated, others: Sequence[Unit]) -> Estimated:
    if not others:
        return one
    found = [one]
    for number, unit in enumerate(others, start=2):
        same = [each for each in unit.estimated.get(one.joint, ()) if each.key == one.key]
        if not same:
            raise ParamsError(
                f"--unit: unit {number} has no estimate of {'.'.join(one.key)} of joint {one.joint!r}; diagnose all"
                " units with the same rig file, and with the effects that any of them has declared"
            )
        found += same
    distributions = [each.distribution for each in found]
    pooled = of_units(distributions)
    deviations = [max(each.deviation, 1e-300) for each in distributions]
    tau = spread_between([each.value for each in distributions], deviations)
    own = float(np.sqrt(max(pooled.deviation**2 - tau**2, 0.0)))
    return replace(one, distribution=pooled, parts={"interval": own, "units": tau})


def draws(posterior: Posterior, count: int, seed: int) -> dict[str, FloatArray]:
    """By joint, (count, p) draws of its estimated parameters."""
    rng = np.random.default_rng(seed)
    out = {}
    for joint, found in posterior.unit.estimated.items():
        z = rng.standard_normal((count, len(found)))
        matrix = posterior.unit.correlation.get(joint)
        if matrix is not None:
            z = z @ _root(matrix).T
        columns = [each.distribution.quantile(ndtr(z[:, k])) for k, each in enumerate(found)]
        out[joint] = np.column_stack(columns) if columns else np.zeros((count, 0))
    return out


def _root(correlation: FloatArray) -> FloatArray:
    """A with A A' = C; eigenvalues that rounding made negative are 0."""
    size, turn = np.linalg.eigh(correlation)
    root = turn * np.sqrt(np.maximum(size, 0.0))
    return np.asarray(root / np.linalg.norm(root, axis=1, keepdims=True))


def drawn_models(posterior: Posterior, joint: str, drawn: FloatArray) -> Iterator[ActuatorModel]:
    """The joint's model with each row (N, p) of its `draws`."""
    model, found = posterior.unit.models[joint], posterior.unit.estimated[joint]
    for row in drawn:
        yield with_values(model, dict(zip((each.key for each in found), row.tolist(), strict=True)))


def central_model(posterior: Posterior, joint: str) -> ActuatorModel:
    """The joint's model with the medians of its distributions."""
    found = posterior.unit.estimated[joint]
    return with_values(posterior.unit.models[joint], {each.key: each.distribution.value for each in found})


def with_values(model: ActuatorModel, values: dict[tuple[str, str], float]) -> ActuatorModel:
    """The model with other values, by effect and parameter, of some parameters; ("drive", "gain") is the gain."""
    effects = []
    for each in model.effects:
        limits = {p.name: (p.lower, p.upper) for p in each.effect.parameters}
        own = {
            name: float(np.clip(values.get((each.key, name), value), *limits[name]))
            for name, value in each.parameters.items()
        }
        effects.append(EffectValue(each.key, own))
    gain = values.get(GAIN, model.drive.gain)
    return replace(model, drive=replace(model.drive, gain=gain), effects=tuple(effects))


def fitted(samples: FloatArray, median: float, lower: float = 0.0) -> Distribution:
    """The distribution of a quantity of which samples (N,) are known; their central 95 % gives its deviation."""
    low, high = np.quantile(samples, [0.025, 0.975])
    return distribution(median, float(high - low) / (2.0 * CRITICAL), lower)
