"""`drake-tc identify --method motor`: voltage-driven motors from logs and a data sheet."""

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from drake_tc.actuation.model import ActuatorModel
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig

UNITS: Mapping[str, str] = {
    "torque_constant": "N*m/A",
    "resistance": "Ohm",
    "rotor_inertia": "kg*m^2",
    "coulomb": "N*m",
    "viscous": "N*m*s/rad",
}


def identify_motors(
    runs: Sequence[Run], rig: Rig, sheet: Path, joints: Sequence[str], progress: Callable[[str, float], None]
) -> tuple[dict[str, ActuatorModel], list[dict[str, Any]]]:
    """Models by joint, and a row of plain data each: parameters with data sheet, interval and the logs' share.

    Args:
        runs: To fit.
        rig: Of the runs.
        sheet: Data sheet file.
        joints: Which.
        progress: Told which joint is fitted and which share is done.

    Raises:
        ParamsError: a data sheet that cannot be used.
        IdentificationError: logs that cannot.
    """
    from drake_tc.identification.motor_prior import identify_motor
    from drake_tc.identification.motor_sheet import load_motor_sheet

    told = load_motor_sheet(sheet)
    models, rows = {}, []
    for number, joint in enumerate(joints):
        progress(f"fitting {joint}", (1 + number) / (1 + len(joints)))
        found = identify_motor(runs, rig, told.motor(joint), joint=joint, widths=told.widths)
        models[joint] = found.motor.actuator_model(joint)
        parameters = {
            name: {
                "value": float(getattr(found.motor, name)),
                "unit": unit,
                "ci95": [float(bound) for bound in found.spread[name]],
                "data_sheet": float(getattr(told.motor(joint), name)),
                "from_logs": float(found.from_logs[name]),
            }
            for name, unit in UNITS.items()
        }
        rows.append(
            {
                "joint": joint,
                "drive": rig.drive[joint],
                "method": "motor",
                "parameters": parameters,
                "rms": {"value": float(found.fit.rms), "unit": "V"},
                "condition_number": float(found.fit.condition_number),
                "converged": None,
                "samples": int(found.fit.residual.size),
                "runs": [run.name for run in runs],
            }
        )
    return models, rows


def print_motors(rows: Sequence[Mapping[str, Any]], out: Path) -> None:
    """A table a joint."""
    console = Console(file=sys.stdout, highlight=False)
    for row in rows:
        console.print(
            f"[bold]{row['joint']}[/bold]: motor, {row['samples']} samples of {len(row['runs'])} runs,"
            f" residual {row['rms']['value']:.3g} V rms"
        )
        table = Table(box=None, padding=(0, 1))
        for header in ("parameter", "data sheet", "identified", "95 % interval", "unit", "from logs"):
            table.add_column(header, justify="left" if header in ("parameter", "unit") else "right")
        for name, entry in row["parameters"].items():
            interval = r"\[{:.4g}, {:.4g}]".format(*entry["ci95"])
            numbers = (f"{entry['data_sheet']:.4g}", f"{entry['value']:.4g}", interval)
            table.add_row(name, *numbers, entry["unit"], f"{100 * entry['from_logs']:.0f} %")
        console.print(table)
    console.print(f"model: {out}", soft_wrap=True)
