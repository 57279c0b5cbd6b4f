"""Draws of the model's own parameters as a table, for every simulator that has no file of its own."""

import json
from pathlib import Path

import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]

from drake_tc.config.quoted import json_value
from drake_tc.exchange.ranges.posterior import Posterior, draws


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
