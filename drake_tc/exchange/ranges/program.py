"""What the written Python files share: text of distributions, and the function that draws from one.

Draws of the model's own parameters as a table, for every simulator that has no file of its own.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]

from drake_tc.config.quoted import json_value
from drake_tc.exchange.ranges.distribution import Distribution
from drake_tc.exchange.ranges.posterior import Posterior, draws
from drake_tc.exchange.ranges.terms import TermRanges
from drake_tc.exchange.ranges.unit import NotShown


def literal(value: float) -> str:
    """A number as text of a Python expression, ten digits; infinity as float("inf")."""
    return f"{value:.10g}" if abs(value) < float("inf") else f'float("{"-" if value < 0 else ""}inf")'


def as_tuple(of: Distribution) -> str:
    """(law, value, deviation, lower, upper) as text."""
    return f'("{of.law}", {", ".join(map(literal, (of.value, of.deviation, of.lower, of.upper)))})'


def head(purpose: str, posterior: Posterior, ranges: Sequence[TermRanges], randomised: Sequence[str]) -> list[str]:
    """Docstring of a file: what it is, what was estimated, and what it does not randomise.

    Args:
        purpose: First sentence.
        posterior: Of the parameters.
        ranges: Of the terms.
        randomised: Terms that the simulator's file can randomise.
    """
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


def range_text(each: NotShown) -> str:
    """The range of a parameter that was not shown, in words."""
    low, high = f"{each.lower:.3g}", f"{each.upper:.3g}"
    if each.lower == -float("inf"):
        return "any value" if each.upper == float("inf") else f"up to {high}"
    return f"{low} or more" if each.upper == float("inf") else f"{low} to {high}"


def row_text(each: NotShown) -> str:
    """One parameter that was not shown: name, range, unit, why."""
    unit = "" if each.unit == "-" else f" {each.unit}"
    return (
        f"{each.joint} {each.effect}.{each.parameter}: {range_text(each)}{unit}{f' ({each.why})' if each.why else ''}"
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

    Args:
        posterior: Of the parameters.
        path: File to write.
        count: Number of draws.
        seed: Of the generator.
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
