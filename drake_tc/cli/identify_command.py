"""`drake-tc identify`: the drive gain and friction of a rig's joints from its logs, as a model file."""

import json
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, cast

import typer
from rich.console import Console
from rich.table import Table

from drake_tc.cli.identify_motors import identify_motors, print_motors
from drake_tc.cli.progress import progress_bar
from drake_tc.effects.base import EFFORT_UNIT
from drake_tc.errors import IdentificationError, LogError, RigError
from drake_tc.identification.identify import Identified, Method
from drake_tc.identification.piecewise import PiecewiseFit


class MethodName(StrEnum):
    """How to fit."""

    least_squares = "least_squares"
    asymmetric = "asymmetric"
    two_stage = "two_stage"
    piecewise = "piecewise"
    motor = "motor"


def identify_command(
    rig: Annotated[Path | None, typer.Option(help="Rig file (YAML): joint, drive, what is declared.")] = None,
    log: Annotated[list[Path] | None, typer.Option(help="A run to fit; repeat for more.")] = None,
    method: Annotated[MethodName, typer.Option(help="How to fit.")] = MethodName.least_squares,
    sheet: Annotated[
        Path | None, typer.Option(help="Data sheet of the motors (YAML); method motor needs it, no other does.")
    ] = None,
    joint: Annotated[str | None, typer.Option(help="Only this joint of the rig; all of them when left out.")] = None,
    out: Annotated[Path, typer.Option(help="Model file (YAML) to write.")] = Path("model.yaml"),
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON instead of a table.")] = False,
) -> None:
    """Fit the drive gain and friction of geared joints, with intervals, and write a model that diagrams load.

    least_squares: all samples alike. asymmetric: friction is never over-estimated, so its compensation stays stable.
    two_stage: the gain at rest, then friction in motion. piecewise: three lines for each direction of motion.
    motor: constants and friction of voltage-driven motors, with a data sheet for what the logs leave open.
    """
    from drake_tc.actuation.model_file import save_models
    from drake_tc.identification.actuator import actuator_model
    from drake_tc.identification.identify import identify
    from drake_tc.logs.prepare import load_runs
    from drake_tc.logs.rig import load_rig

    if rig is None:
        raise RigError("identify: wanted --rig RIG.yaml, which says what the logs show; got none")
    if not log:
        raise LogError("identify: wanted at least one --log RUN; got none")
    if (method is MethodName.motor) != (sheet is not None):
        raise IdentificationError(
            "identify: wanted --method motor and --sheet SHEET.yaml together, or neither;"
            f" got --method {method.value} {'without a' if sheet is None else 'and a'} --sheet"
        )
    with progress_bar("identify", quiet=as_json) as progress:
        read_rig = load_rig(rig)
        if joint is not None and joint not in read_rig.joints:
            raise IdentificationError(f"no joint {joint!r} in {rig}; joints there: {', '.join(read_rig.joints)}")
        progress("reading", 0.0)
        runs = load_runs(log, read_rig)
        names = read_rig.joints if joint is None else (joint,)
        if sheet is not None:
            models, rows = identify_motors(runs, read_rig, sheet, names, progress)
        else:
            models, rows = {}, []
            for number, name in enumerate(names):
                progress(f"fitting {name}", (1 + number) / (1 + len(names)))
                result = identify(runs, read_rig, cast("Method", method.value), joint=name)
                rows.append(_row(result))
                models[name] = actuator_model(result, read_rig.known(name, "rotor_inertia"))
    provenance = {"identified_by": "drake-tc identify", "rig": rig.name, "logs": [p.name for p in log], "fits": rows}
    if sheet is not None:
        provenance["data_sheet"] = sheet.name
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        save_models(models, out, provenance=provenance)
    except OSError as error:
        raise LogError(f"{out}: cannot be written: {error.strerror or error}") from None
    if as_json:
        print(json.dumps({"model": str(out), "joints": {row["joint"]: row for row in rows}}, indent=1))
    elif sheet is not None:
        print_motors(rows, out)
    else:
        _print(rows, out)


def _unit(drive: str, name: str) -> str:
    effort = EFFORT_UNIT[drive]
    last = name.rsplit(".", 1)[-1]
    if last in ("tau_1", "tau_2"):
        return "N*m"
    if last in ("K_c", "offset"):
        return effort
    return f"{effort}*s/rad" if last == "K_v" else f"{effort}/(N*m)"


def _row(found: Identified) -> dict[str, Any]:
    """Plain data: for the provenance of the model file, for --json, and for the table."""
    parameters: dict[str, Any] = {}
    for name, value in found.parameters.items():
        entry: dict[str, Any] = {"value": float(value), "unit": _unit(found.drive, name)}
        if name in found.intervals:
            entry["ci95"] = [float(bound) for bound in found.intervals[name]]
        parameters[name] = entry
    fit = found.fit
    condition = getattr(fit, "condition_number", None)
    return {
        "joint": found.joint,
        "drive": found.drive,
        "method": found.method,
        "parameters": parameters,
        "rms": {"value": float(found.rms), "unit": EFFORT_UNIT[found.drive]},
        "condition_number": None if condition is None else float(condition),
        "converged": fit.forward.converged and fit.backward.converged if isinstance(fit, PiecewiseFit) else None,
        "samples": int(found.residual.size),
        "runs": list(found.runs),
    }


def _print(rows: list[dict[str, Any]], out: Path) -> None:
    console = Console(file=sys.stdout, highlight=False)
    for row in rows:
        console.print(
            f"[bold]{row['joint']}[/bold]: {row['method']}, {row['samples']} samples of {len(row['runs'])} runs"
        )
        table = Table(box=None, padding=(0, 2))
        for header in ("parameter", "value", "95 % interval", "unit"):
            table.add_column(header, justify="left" if header in ("parameter", "unit") else "right")
        for name, entry in row["parameters"].items():
            interval = "[{:.4g}, {:.4g}]".format(*entry["ci95"]) if "ci95" in entry else "-"
            table.add_row(name, f"{entry['value']:.4g}", interval.replace("[", r"\["), entry["unit"])
        table.add_row("residual rms", f"{row['rms']['value']:.4g}", "-", row["rms"]["unit"])
        console.print(table)
        if row["converged"] is False:
            console.print("  the break points did not come to rest: these logs do not look like three pieces")
    console.print(f"model: {out}", soft_wrap=True)
