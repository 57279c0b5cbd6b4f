"""`drake-tc identify`: the drive gain and friction of a rig's joints from its logs, as a model file.

`drake-tc identify --method motor`: voltage-driven motors from logs and a data sheet.
"""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, cast

import typer

from drake_tc.cli.options import Force, UnusedSeed
from drake_tc.cli.out_files import result_file
from drake_tc.cli.terminal import print_wide, progress_bar
from drake_tc.config.files import utf8_name
from drake_tc.config.quoted import json_value
from drake_tc.errors import IdentificationError, LogError, RigError

if TYPE_CHECKING:
    from drake_tc.actuation.model import ActuatorModel
    from drake_tc.identification.identify import Identified, Method
    from drake_tc.identification.motor_prior import MotorFit, MotorSheet
    from drake_tc.logs.record import Run
    from drake_tc.logs.rig import Rig

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


class MethodName(StrEnum):
    """How to fit."""

    least_squares = "least_squares"
    asymmetric = "asymmetric"
    two_stage = "two_stage"
    piecewise = "piecewise"
    motor = "motor"


@dataclass(frozen=True, kw_only=True)
class IdentifyOptions:
    """Options of `drake-tc identify`."""

    rig: Annotated[
        Path | None,
        typer.Option(help="Rig file (YAML): joints, drives, columns, and what your model already contains."),
    ] = None
    log: Annotated[list[Path] | None, typer.Option(help="A run to fit; repeat for more.")] = None
    method: Annotated[
        MethodName, typer.Option(metavar="METHOD", help=f"Method of the fit: {', '.join(MethodName)}.")
    ] = MethodName.least_squares
    sheet: Annotated[Path | None, typer.Option(help="Data sheet of the motors (YAML), for --method motor only.")] = None
    joint: Annotated[str | None, typer.Option(help="Only this joint of the rig; all of them when left out.")] = None
    out: Annotated[Path, typer.Option(help="Model file (YAML) to write.")] = Path("model.yaml")
    force: Force = False
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON instead of a table.")] = False
    seed: UnusedSeed = 0


def identify_command(options: IdentifyOptions) -> None:
    """Fit the drive gain and friction of geared joints, with intervals, and write a model that diagrams load.

    least_squares weights all samples alike. asymmetric never over-estimates friction, so its compensation stays stable.
    two_stage fits the gain at rest, then friction in motion. piecewise fits three lines for each direction of motion.
    motor fits constants and friction of voltage-driven motors, and takes what the logs do not identify from a data
    sheet. Its intervals cover measurement noise and data-sheet tolerance, not effects that the model lacks.
    """
    from drake_tc.actuation.model_file import save_models
    from drake_tc.logs.prepare import load_runs
    from drake_tc.logs.rig import load_rig

    rig, log, method, sheet, out = options.rig, options.log, options.method, options.sheet, options.out
    if rig is None:
        raise RigError("identify: expected --rig RIG.yaml, which says what the logs show, got none")
    if not log:
        raise LogError("identify: expected at least one --log RUN, got none")
    if (method is MethodName.motor) != (sheet is not None):
        raise IdentificationError(
            "identify: expected --method motor and --sheet SHEET.yaml together, or neither,"
            f" got --method {method.value} {'without a' if sheet is None else 'and a'} --sheet"
        )
    read_rig = load_rig(rig)
    joint = options.joint
    if joint is not None and joint not in read_rig.joints:
        raise IdentificationError(f"no joint {joint!r} in {rig}; joints there: {', '.join(read_rig.joints)}")
    names = read_rig.joints if joint is None else (joint,)
    fit = _fitting(read_rig, method, sheet, names)
    place = result_file(out, "--out", inputs=[rig, sheet, *log], force=options.force)
    with place as model, progress_bar("identify", quiet=options.as_json) as progress:
        progress("reading", 0.0)
        runs = load_runs(log, read_rig)
        fits = _Fits({}, [], {})
        for number, name in enumerate(names):
            progress(f"fitting {name}", (1 + number) / (1 + len(names)))
            try:
                fits.models[name], row = fit(runs, name)
                fits.rows.append(row)
            except IdentificationError as error:
                fits.failed[name] = str(error) if name in str(error) else f"{name}: {error}"
        if not fits.rows:
            raise _failure(rig, fits)
        save_models(fits.models, model, provenance=_provenance(rig, log, sheet, fits))
    for note in dict.fromkeys(note for row in fits.rows for note in row["notes"]):
        print(f"identify: {note}", file=sys.stderr)
    if options.as_json:
        joints = {row["joint"]: row for row in fits.rows}
        print(json.dumps(json_value({"model": str(out), "joints": joints, "failed": fits.failed}), indent=1))
    elif sheet is not None:
        print_motors(fits.rows)
    else:
        _print(fits.rows)
    if not options.as_json:
        print(f"model: {out}")
    if fits.failed:
        raise _failure(rig, fits)


class _Fits(NamedTuple):
    """What came of each joint: a model and a row of plain data, or a line."""

    models: dict[str, "ActuatorModel"]
    rows: list[dict[str, Any]]
    failed: dict[str, str]


def _failure(rig: Path, fits: _Fits) -> IdentificationError:
    return IdentificationError(f"{rig}: {'; '.join(fits.failed.values())}")


def _provenance(rig: Path, logs: Sequence[Path], sheet: Path | None, fits: _Fits) -> dict[str, Any]:
    """What the model file says of its origin."""
    provenance: dict[str, Any] = {
        "identified_by": "drake-tc identify",
        "rig": utf8_name(rig),
        "logs": [utf8_name(path) for path in logs],
        "fits": fits.rows,
    }
    return provenance if sheet is None else provenance | {"data_sheet": utf8_name(sheet)}


def _fitting(
    rig: "Rig", method: MethodName, sheet: Path | None, joints: Sequence[str]
) -> Callable[[Sequence["Run"], str], tuple["ActuatorModel", dict[str, Any]]]:
    """fit(runs, joint) -> (model, row); what rig and data sheet cannot do for a joint is told before any log is read.

    Raises:
        ParamsError: a data sheet that cannot be used.
        IdentificationError: another drive or load than the method takes.
    """
    from drake_tc.identification.actuator import actuator_model
    from drake_tc.identification.identify import identify
    from drake_tc.identification.motor_prior import check_motor_rig, identify_motor, load_motor_sheet

    if sheet is None:

        def fit(runs: Sequence["Run"], name: str) -> tuple["ActuatorModel", dict[str, Any]]:
            result = identify(runs, rig, cast("Method", method.value), joint=name)
            return actuator_model(result, rig.known(name, "rotor_inertia")), _row(result, _notes(runs, rig, name))

        return fit
    told = load_motor_sheet(sheet)
    for name in joints:
        check_motor_rig(rig, name)
        told.motor(name)

    def fit_motor(runs: Sequence["Run"], name: str) -> tuple["ActuatorModel", dict[str, Any]]:
        found = identify_motor(runs, rig, told.motor(name), joint=name, widths=told.widths)
        row = motor_row(found, told, _notes(runs, rig, name), [run.name for run in runs])
        return found.motor.actuator_model(name), row

    return fit_motor


def _notes(runs: Sequence["Run"], rig: "Rig", joint: str) -> list[str]:
    """What was repaired in the runs, but for what concerns other joints alone."""
    from drake_tc.logs.record import distinct_notes, of_joint

    return list(distinct_notes(of_joint(((run.name, note) for run in runs for note in run.notes), joint, rig.joints)))


def _unit(drive: str, name: str) -> str:
    from drake_tc.effects.base import EFFORT_UNIT

    effort = EFFORT_UNIT[drive]
    last = name.rsplit(".", 1)[-1]
    if last in ("tau_1", "tau_2"):
        return "N*m"
    if last in ("K_c", "offset"):
        return effort
    return f"{effort}*s/rad" if last == "K_v" else f"{effort}/(N*m)"


def _row(found: "Identified", notes: list[str]) -> dict[str, Any]:
    """Plain data: for the provenance of the model file, for --json, and for the table."""
    from drake_tc.effects.base import EFFORT_UNIT
    from drake_tc.identification.asymmetric import PiecewiseFit

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
        "notes": notes,
    }


def _print(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        title = f"{row['joint']}: {row['method']}, {row['samples']} samples of {len(row['runs'])} runs"
        lines = []
        for name, entry in row["parameters"].items():
            interval = "[{:.4g}, {:.4g}]".format(*entry["ci95"]) if "ci95" in entry else "-"
            lines.append((name, f"{entry['value']:.4g}", interval, entry["unit"]))
        lines.append(("residual rms", f"{row['rms']['value']:.4g}", "-", row["rms"]["unit"]))
        print_wide(("parameter", "value", "95 % interval", "unit"), lines, ("parameter", "unit"), title)
        if row["converged"] is False:
            print(
                "  the break points did not converge: the logs do not support a piecewise-linear model of three pieces"
            )
