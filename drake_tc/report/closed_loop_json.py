"""The closed loop and the torque uncertainty in report.json: keys beside those of the contract."""

from dataclasses import asdict
from typing import Any

from drake_tc.config.joint_units import TORQUE, TURNING, JointUnits
from drake_tc.config.quoted import json_value
from drake_tc.control.torque_uncertainty_file import TorqueUncertainty
from drake_tc.diagnosis.result.closed_loop import ClosedLoop


def loop_entry(closed: ClosedLoop | None, joint: str) -> dict[str, Any] | None:
    """`joints.NAME.closed_loop`: figures in SI; None where there is no loop."""
    if closed is None or joint not in closed.joints:
        return None
    found = closed.joints[joint]
    return {
        "simulated": True,
        "changed": found.changed,
        "gains": dict(found.gains),
        "before": json_value(asdict(found.before)),
        "after": json_value(asdict(found.after)),
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


def uncertainty_entry(
    uncertainty: TorqueUncertainty | None, joint: str, units: JointUnits = TURNING
) -> dict[str, Any] | None:
    """`joints.NAME.torque_uncertainty`: sigma of the held-out residual as link-side torque or force."""
    if uncertainty is None or joint not in uncertainty.joints:
        return None
    at = uncertainty.joints.index(joint)
    entry: dict[str, Any] = json_value(
        {
            "unit": units.text(TORQUE),
            "sigma": float(uncertainty.sigma[at]),
            "ci95": uncertainty.ci95[at],
            "mean": float(uncertainty.mean[at]),
            "correlation_time": float(uncertainty.correlation_time[at]),
            "effective_samples": float(uncertainty.effective_samples[at]),
        }
    )
    return entry
