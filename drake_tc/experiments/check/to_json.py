"""`check --json`: the whole check as plain data."""

from dataclasses import asdict
from typing import Any

from drake_tc.config.quoted import json_value
from drake_tc.experiments.check.run import CheckResult, JointCheck
from drake_tc.experiments.check.visibility import Visibility


def check_json(result: CheckResult) -> dict[str, Any]:
    """{"name": "check", "joints": {NAME: {"effects": [{"id", "status", "size", ...}], ...}}, "runs", "columns"}."""
    document = {
        "name": "check",
        "schema": 1,
        "rig": result.rig_file,
        "logs": list(result.logs),
        "joints": {name: _joint(each) for name, each in result.joints.items()},
        "runs": [asdict(run) for run in result.runs],
        "columns": [asdict(column) for column in result.columns],
        "seconds": result.seconds,
    }
    out: dict[str, Any] = json_value(document)
    return out


def _joint(joint: JointCheck) -> dict[str, Any]:
    found = joint.effects
    return {
        "drive": joint.drive,
        "rows": joint.rows,
        "seconds_in_motion": joint.seconds,
        "refusal": joint.refusal or None,
        "findings": [asdict(each) for each in joint.findings],
        "declared": None if found is None else asdict(found.numbers),
        "motion": None if found is None else asdict(found.facts),
        "noise": None
        if found is None
        else {"floor": found.noise.floor, "left": found.noise.left, "independent_samples": found.noise.independent},
        "effects": [] if found is None else [_effect(each) for each in found.effects],
    }


def _effect(found: Visibility) -> dict[str, Any]:
    return {
        "id": found.id,
        "key": found.key,
        "status": found.status,
        "size": {
            "name": found.size.name,
            "unit": found.size.unit,
            "typical": found.size.typical,
            "smallest": found.smallest,
            "easiest": found.easiest,
        },
        "not_separable_from": list(found.not_separable_from),
        "separable": found.separable,
        "confused_below": list(found.confused_below),
        "kept": found.kept,
        "reason": found.reason or None,
    }
