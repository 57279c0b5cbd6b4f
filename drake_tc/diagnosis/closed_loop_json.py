"""The closed loop and the torque uncertainty in report.json: keys beside those of the contract."""

import math
from dataclasses import asdict
from typing import Any

from drake_tc.control.torque_uncertainty_file import TorqueUncertainty
from drake_tc.diagnosis.closed_loop import ClosedLoop, LoopFigures


def loop_entry(closed: ClosedLoop | None, joint: str) -> dict[str, Any] | None:
    """`joints.NAME.closed_loop`: figures in SI; None where there is no loop."""
    if closed is None or joint not in closed.joints:
        return None
    found = closed.joints[joint]
    return {
        "simulated": True,
        "changed": found.changed,
        "gains": dict(found.gains),
        "before": _figures(found.before),
        "after": _figures(found.after),
    }


def loop_summary(closed: ClosedLoop | None) -> dict[str, Any] | None:
    """`closed_loop`: what the figures of all joints have in common."""
    if closed is None:
        return None
    return {
        "plant": closed.plant,
        "controller": closed.controller,
        "reference": {"run": closed.run, "start": closed.start, "end": closed.end},
        "changed": closed.changed,
        "notes": list(closed.notes),
    }


def uncertainty_entry(uncertainty: TorqueUncertainty | None, joint: str) -> dict[str, Any] | None:
    """`joints.NAME.torque_uncertainty`: sigma of the held-out residual as link-side torque."""
    if uncertainty is None or joint not in uncertainty.joints:
        return None
    at = uncertainty.joints.index(joint)
    return {
        "unit": "N*m",
        "sigma": _number(float(uncertainty.sigma[at])),
        "ci95": [_number(float(bound)) for bound in uncertainty.ci95[at]],
        "mean": _number(float(uncertainty.mean[at])),
        "correlation_time": _number(float(uncertainty.correlation_time[at])),
        "effective_samples": _number(float(uncertainty.effective_samples[at])),
    }


def _figures(figures: LoopFigures) -> dict[str, float | None]:
    return {name: _number(value) for name, value in asdict(figures).items()}


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
