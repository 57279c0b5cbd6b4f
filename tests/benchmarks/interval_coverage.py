"""Whether the 95 % intervals of a report hold the truth of a simulated robot.

An interval that is right holds the truth in 95 of 100 cases; over a benchmark 90 to 99 % are accepted.
"""

import math
from collections.abc import Mapping
from typing import Any

from drake_tc.diagnosis.result.rig_result import CloseLoopResult

FRICTION = ("viscous", "coulomb")


def final_parameters(result: CloseLoopResult) -> dict[str, dict[str, dict[str, Any]]]:
    """Joint, effect and parameter to `{"value", "ci95"}` of the final models, declared effects included."""
    return {
        name: {
            key: {parameter: {"value": e.value, "ci95": list(e.ci95)} for parameter, e in group.items()}
            for key, group in joint.final_parameters.items()
        }
        for name, joint in result.joints.items()
    }


def own_intervals(truth: Mapping[str, Any], report: Mapping[str, Any]) -> tuple[bool, ...]:
    """For each parameter of the right effect in the right place, whether its interval holds `truth["estimated"]`.

    Empty where the effect is not named, and for parameters that the report does not have.
    """
    places = report.get("joints", {}).get(truth["where"], {}).get("effects", [])
    shared = [entry for entry in report.get("shared", []) if entry["where"] == truth["where"]]
    entry = next((e for e in (*places, *shared) if e["id"] == truth["id"]), None)
    if entry is None:
        return ()
    expected = truth.get("estimated", {})
    return tuple(
        holds(parameter.get("ci95"), expected[name])
        for name, parameter in entry["parameters"].items()
        if name in expected
    )


def friction_intervals(truth: Mapping[str, Any], report: Mapping[str, Any]) -> tuple[bool, ...]:
    """For each joint's viscous and Coulomb friction, whether the final model's interval holds the truth."""
    found = report.get("final_parameters", {})
    return tuple(
        holds(found[joint][key][key].get("ci95"), values[key])
        for joint, values in truth.get("friction", {}).items()
        for key in FRICTION
        if key in values and key in found.get(joint, {}).get(key, {})
    )


def holds(interval: object, value: float) -> bool:
    """Whether a finite interval [low, high] holds the value; a missing or unbounded end does not count as holding."""
    if not isinstance(interval, list) or len(interval) != 2:
        return False
    low, high = (float("nan") if end is None else float(end) for end in interval)
    return math.isfinite(low) and math.isfinite(high) and low <= value <= high
