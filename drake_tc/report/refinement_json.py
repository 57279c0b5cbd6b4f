"""The refinement and the free runs in report.json."""

from typing import Any

from drake_tc.config.quoted import json_value
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.models import MODEL_FILE
from drake_tc.diagnosis.result.refinement import Refinement
from drake_tc.diagnosis.result.run_errors import MODELS, position_errors


def free_runs_json(joint: JointResult) -> list[dict[str, Any]]:
    """Errors of each held-out run's free runs [rad], by model; null for one that there is not."""
    rows = []
    for run, trace in joint.free_run.items():
        found = {name: position_errors(trace, name) for name in MODELS}
        entry = {
            name: None if errors is None else {"rms": errors[0], "mean_absolute": errors[1]}
            for name, errors in found.items()
        }
        rows.append(json_value({"run": run, **entry}))
    return rows


def refinement_json(refinement: Refinement | None) -> dict[str, Any] | None:
    """What the output error did; null where no free run was asked for."""
    if refinement is None:
        return None
    pairs = {"train": refinement.train, "cross_validated": refinement.cross_validated}
    document = {
        "status": refinement.status,
        "why": refinement.why or None,
        "model": MODEL_FILE if refinement.accepted else None,
        "free_run_mean_absolute": {
            name: None if pair is None else {"after": pair[0], "refined": pair[1]} for name, pair in pairs.items()
        },
        "error": {
            "train": refinement.error_train,
            "heldout": refinement.error_heldout,
            "free_run_heldout": refinement.free_run_heldout,
        },
        "parameters": [
            {
                "effect": p.key,
                "parameter": p.name,
                "unit": p.unit,
                "equation_error": p.equation_error,
                "output_error": p.output_error,
                "at_bound": p.at_bound,
            }
            for p in refinement.parameters
        ],
    }
    return dict(json_value(document))
