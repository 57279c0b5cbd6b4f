"""`drake-tc identify --method motor`: voltage-driven motors from logs and a data sheet."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from drake_tc.cli.wide_table import print_wide

if TYPE_CHECKING:
    from drake_tc.identification.motor_prior import MotorFit
    from drake_tc.identification.motor_sheet import MotorSheet

UNITS: Mapping[str, str] = {
    "torque_constant": "N*m/A",
    "resistance": "Ohm",
    "rotor_inertia": "kg*m^2",
    "coulomb": "N*m",
    "viscous": "N*m*s/rad",
}
HEADINGS = ("parameter", "data sheet", "identified", "95 % interval", "unit", "from logs", "off the sheet [sigma]")
MEANING = (
    "intervals cover measurement noise and data-sheet tolerance, not effects that the model lacks (ripple, Stribeck,"
    " temperature)"
)


def motor_row(found: "MotorFit", told: "MotorSheet", notes: Sequence[str], runs: Sequence[str]) -> dict[str, Any]:
    """Plain data of a motor: parameters with data sheet, interval, the logs' share, and how far off the sheet they are.

    Args:
        found: The fit.
        told: The data sheet.
        notes: What was done to the logs.
        runs: Names.
    """
    sheet = told.motor(found.joint)
    parameters = {
        name: {
            "value": float(getattr(found.motor, name)),
            "unit": unit,
            "ci95": [float(bound) for bound in found.spread[name]],
            "data_sheet": float(getattr(sheet, name)),
            "from_logs": float(found.from_logs[name]),
            "off_sheet_sd": float(found.pull[name]),
        }
        for name, unit in UNITS.items()
    }
    return {
        "joint": found.joint,
        "drive": "voltage",
        "method": "motor",
        "parameters": parameters,
        "rms": {"value": float(found.fit.rms), "unit": "V"},
        "condition_number": float(found.fit.condition_number),
        "converged": None,
        "samples": int(found.fit.residual.size),
        "runs": list(runs),
        "notes": [*notes, *found.notes],
    }


def print_motors(rows: Sequence[Mapping[str, Any]]) -> None:
    """A table a joint."""
    for row in rows:
        title = (
            f"{row['joint']}: motor, {row['samples']} samples of {len(row['runs'])} runs,"
            f" residual {row['rms']['value']:.3g} V rms"
        )
        lines = []
        for name, entry in row["parameters"].items():
            interval = "[{:.4g}, {:.4g}]".format(*entry["ci95"])
            numbers = (f"{entry['data_sheet']:.4g}", f"{entry['value']:.4g}", interval, entry["unit"])
            lines.append((name, *numbers, f"{100 * entry['from_logs']:.0f} %", f"{entry['off_sheet_sd']:+.1f}"))
        print_wide(HEADINGS, lines, ("parameter", "unit"), title)
    if rows:
        print(MEANING)
