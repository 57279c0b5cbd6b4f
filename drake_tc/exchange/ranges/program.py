"""The posterior in a simulator's terms, as a table of draws, and what the written programs share.

Every draw is projected, so that a refit acts on whole models.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]
from scipy.stats import rankdata

from drake_tc.config.joint_units import JointType, in_units_of
from drake_tc.config.quoted import json_value
from drake_tc.exchange.mjcf import with_torque_constant
from drake_tc.exchange.projection import Projection, project, vocabulary
from drake_tc.exchange.ranges.posterior import Posterior, central_model, drawn_models, draws, fitted
from drake_tc.exchange.ranges.unit import Distribution, NotShown
from drake_tc.simulator_files.terms import Terms
from drake_tc.types import FloatArray

UNITS: Mapping[str, str] = MappingProxyType(
    {
        "kp": "N m/rad",
        "armature": "kg m^2",
        "damping": "N m s/rad",
        "quadratic": "N m s^2/rad^2",
        "frictionloss": "N m",
        "load_friction": "-",
        "delay": "s",
        "torque_limit": "N m",
        "backlash": "rad",
        "stiffness": "N m/rad",
        "preload": "N m",
        "lag": "s",
        "integral_rate": "1/s",
        "derivative_gain": "N m s/rad",
        "compliance": "rad/(N m)",
    }
)
"""Term to its unit for a joint that turns."""
SIGNED = ("preload",)
VARIES = 1e-6
"""A term whose deviation is below this share of its value is a constant."""


@dataclass(frozen=True)
class TermRanges:
    """The terms of one joint that vary.

    Attributes:
        joint: Its name.
        projection: Of the model at the medians.
        distributions: By term. "damping" is what is left to the joint: not the servo's own damping, nor the back-EMF of
            a motor.
        correlation: (t, t) of the normal scores of the terms, in their order (Gaussian copula).
    """

    joint: str
    projection: Projection
    distributions: Mapping[str, Distribution]
    correlation: FloatArray

    @property
    def joint_type(self) -> JointType:
        """Whether the joint turns or slides."""
        return self.projection.joint_type

    def unit(self, term: str) -> str:
        """Unit of a term."""
        return in_units_of(self.joint_type, UNITS[term])


Recorded = Mapping[str, tuple[FloatArray | None, FloatArray | None]]
"""By joint, the velocities and loads at which friction counts (`project`)."""


def term_ranges(
    posterior: Posterior,
    target: str,
    drawn: Mapping[str, FloatArray],
    recorded: Recorded | None = None,
    torque_constant: float | None = None,
) -> list[TermRanges]:
    """The terms of each joint with their distributions.

    Args:
        posterior: Of the parameters.
        target: Name of the simulator on the command line.
        drawn: By joint, draws of its parameters (`posterior.draws`), which are projected.
        recorded: Velocities and loads that weight a refit of friction; None: all speeds count alike.
        torque_constant: Of a data sheet [N m/A], for drives on a voltage; None: not known.

    Raises:
        ParamsError: a torque constant whose back-EMF exceeds the viscous friction.
    """
    out = []
    for joint in posterior.unit.models:
        at = (recorded or {}).get(joint, (None, None))
        words = vocabulary(target, posterior.unit.models[joint].drive.kind, torque_constant)
        central = project(central_model(posterior, joint), words, *at)
        if torque_constant is not None:
            central = with_torque_constant(central, torque_constant, words)
        kt = central.terms.torque_constant
        all_terms = [
            _joint_terms(project(model, words, *at).terms, kt) for model in drawn_models(posterior, joint, drawn[joint])
        ]
        found: dict[str, FloatArray] = {}
        for name in UNITS:
            values = np.array([getattr(terms, name) or 0.0 for terms in all_terms])
            if values.size and np.std(values) > VARIES * max(abs(float(np.median(values))), 1e-300):
                found[name] = values
        at_medians = _joint_terms(central.terms, kt)
        distributions = {
            name: fitted(values, getattr(at_medians, name) or 0.0, -np.inf if name in SIGNED else 0.0)
            for name, values in found.items()
        }
        out.append(TermRanges(joint, central, distributions, _correlation(list(found.values()))))
    return out


def _joint_terms(terms: Terms, torque_constant: float | None) -> Terms:
    """The terms with the damping that is left to the joint."""
    elsewhere = terms.derivative_gain + (0.0 if torque_constant is None else torque_constant * terms.kp)
    return replace(terms, damping=max(terms.damping - elsewhere, 0.0))


def _correlation(columns: list[FloatArray]) -> FloatArray:
    """(t, t) 2 sin(pi/6 rho) of the rank correlations rho of columns (N,): that of the normal scores of a copula."""
    if not columns:
        return np.zeros((0, 0))
    ranks = np.column_stack([rankdata(each) for each in columns])
    rho = np.atleast_2d(np.corrcoef(ranks, rowvar=False))
    return np.asarray(2.0 * np.sin(np.pi / 6.0 * rho))


def literal(value: float) -> str:
    """A number as text of a Python expression, ten digits; infinity as float("inf")."""
    return f"{value:.10g}" if abs(value) < float("inf") else f'float("{"-" if value < 0 else ""}inf")'


def as_tuple(of: Distribution) -> str:
    """(law, value, deviation, lower, upper) as text."""
    return f'("{of.law}", {", ".join(map(literal, (of.value, of.deviation, of.lower, of.upper)))})'


def head(purpose: str, posterior: Posterior, ranges: Sequence[TermRanges], randomised: Sequence[str]) -> list[str]:
    """Docstring of a file: what it is, what was estimated, and what it does not randomise."""
    lines = [f'"""{purpose}', "", "Ranges by drake-tc from the 95 % intervals of a diagnosis."]
    lines += ["", *posterior.notes] if posterior.notes else []
    left = [
        f"    {each.joint} {term}: {interval_text(of)} {each.unit(term)}"
        for each in ranges
        for term, of in each.distributions.items()
        if term not in randomised
    ]
    if left:
        lines += ["", "Estimated, but not randomised by this file, with 95 % of the distribution:", *left]
    for title, found in (
        ("The logs could not show these. What the prior leaves is not drawn here:", False),
        ("Looked for and not found; larger ones would have been seen:", True),
    ):
        rows = [f"    {row_text(each)}" for each in posterior.not_shown if each.found_above is found]
        lines += ["", title, *rows] if rows else []
    return [*lines, '"""']


def interval_text(of: Distribution) -> str:
    """`low to high`, the central 95 %."""
    low, high = of.interval
    return f"{low:.4g} to {high:.4g}"


def _range_text(each: NotShown) -> str:
    """The range of a parameter that was not shown, in words."""
    low, high = f"{each.lower:.3g}", f"{each.upper:.3g}"
    if each.lower == -float("inf"):
        return "any value" if each.upper == float("inf") else f"up to {high}"
    return f"{low} or more" if each.upper == float("inf") else f"{low} to {high}"


def row_text(each: NotShown) -> str:
    """One parameter that was not shown: name, range, unit, why."""
    unit = "" if each.unit == "-" else f" {each.unit}"
    return (
        f"{each.joint} {each.effect}.{each.parameter}: {_range_text(each)}{unit}{f' ({each.why})' if each.why else ''}"
    )


def drawing(library: str, shape: str) -> list[str]:
    """Lines of a function `quantile(of, share)` with the functions of torch or jax.

    Args:
        library: Prefix of ndtr and ndtri, as "torch.special".
        shape: Prefix of exp and clip, as "torch".
    """
    return [
        "def quantile(of, share):",
        '    """Values below which these shares of a distribution (law, value, deviation, lower, upper) lie."""',
        "    law, value, deviation, lower, upper = of",
        '    if law == "lognormal":',
        "        scale = math.sqrt(math.log1p((deviation / value) ** 2))",
        "        ends = [log_cdf(end, value, scale) for end in (lower, upper)]",
        f"        found = value * {shape}.exp(scale * {library}.ndtri(ends[0] + share * (ends[1] - ends[0])))",
        "    else:",
        "        ends = [cdf((end - value) / deviation) for end in (lower, upper)]",
        f"        found = value + deviation * {library}.ndtri(ends[0] + share * (ends[1] - ends[0]))",
        f"    return {shape}.clip(found, lower, upper)",
        "",
        "",
        "def cdf(z):",
        '    """Of the standard normal distribution."""',
        "    return 0.5 * math.erfc(-z / math.sqrt(2.0))",
        "",
        "",
        "def log_cdf(x, median, scale):",
        '    """Of a lognormal distribution."""',
        "    return cdf(math.log(x / median) / scale) if 0.0 < x < math.inf else float(x > 0.0)",
    ]


def column(joint: str, effect: str, parameter: str) -> str:
    """Name of a column: joint/effect.parameter."""
    return f"{joint}/{effect}.{parameter}"


def save_samples(posterior: Posterior, path: Path, count: int, seed: int) -> None:
    """Write a Parquet file with one row a draw and one column a parameter; the units stand in the columns' metadata.

    The metadata `drake_tc` of the file is the document of `as_document` as JSON.
    """
    drawn = draws(posterior, count, seed)
    fields, columns = [], []
    for joint, found in posterior.unit.estimated.items():
        for k, each in enumerate(found):
            name = column(joint, *each.key)
            fields.append(pa.field(name, pa.float64(), metadata={"unit": each.unit}))
            columns.append(pa.array(drawn[joint][:, k]))
    told = json.dumps(as_document(posterior) | {"seed": seed})
    pq.write_table(pa.table(columns, schema=pa.schema(fields, metadata={"drake_tc": told})), path)


def as_document(posterior: Posterior) -> dict[str, object]:
    """Distributions, their parts, correlations, and what the logs could not show, as plain data."""
    joints = {}
    for joint, found in posterior.unit.estimated.items():
        parameters = [
            {
                "effect": each.effect,
                "parameter": each.parameter,
                "unit": each.unit,
                "law": each.distribution.law,
                "value": each.distribution.value,
                "deviation": each.distribution.deviation,
                "limits": [each.distribution.lower, each.distribution.upper],
                "central95": list(each.distribution.interval),
                "deviations": dict(each.parts),
            }
            for each in found
        ]
        others = [
            {
                "effect": each.effect,
                "parameter": each.parameter,
                "unit": each.unit,
                "range": [each.lower, each.upper],
                "why": each.why,
                "larger_would_have_been_seen": each.found_above,
            }
            for each in posterior.not_shown
            if each.joint == joint
        ]
        joints[joint] = {
            "parameters": parameters,
            "correlation": posterior.unit.correlation.get(joint),
            "not_shown": others,
        }
    return dict(json_value({"units": posterior.units, "joints": joints, "notes": list(posterior.notes)}))
