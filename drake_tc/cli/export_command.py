"""`drake-tc export`: an identified model in another simulator's terms, with the loss of each effect."""

import json
import sys
from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from drake_tc.cli.out_files import Force, result_file
from drake_tc.cli.wide_table import print_wide
from drake_tc.config.json_values import json_value
from drake_tc.errors import ParamsError

if TYPE_CHECKING:
    from drake_tc.actuation.model import ActuatorModel
    from drake_tc.exchange.projection import Projection


class Target(StrEnum):
    """Where to."""

    mjcf = "mjcf"
    urdf = "urdf"
    drake_urdf = "drake-urdf"
    sdf = "sdf"
    isaaclab = "isaaclab"
    bam = "bam"


def export_command(
    model: Annotated[Path, typer.Argument(help="Model file (YAML) of close-loop or identify.")],
    to: Annotated[Target, typer.Option(help="Simulator in whose terms the model is written.")],
    into: Annotated[Path | None, typer.Option(help="Your own file: the terms are merged into a copy of it.")] = None,
    out: Annotated[Path | None, typer.Option(help="File to write; stdout when left out.")] = None,
    joint: Annotated[list[str] | None, typer.Option(help="Only this joint; repeat. All when left out.")] = None,
    rig: Annotated[Path | None, typer.Option(help="Rig file of the runs of --log and --holdout.")] = None,
    log: Annotated[
        list[Path] | None, typer.Option(help="A run whose speeds weight the refit of friction; repeat for more.")
    ] = None,
    holdout: Annotated[
        list[Path] | None, typer.Option(help="A run to try the export on in MuJoCo (mjcf); repeat for more.")
    ] = None,
    torque_constant: Annotated[
        float | None, typer.Option(help="Torque constant of the data sheet [N m/A], for --to bam.")
    ] = None,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print terms, losses and errors as JSON.")] = False,
) -> None:
    """Write the model in the target's own terms, and say what the target cannot express.

    Friction that the target lacks (Stribeck in most) is refitted by what it has; both errors are told. With --rig and
    --holdout an MJCF export is run in MuJoCo on these runs, beside the model itself in Drake and, with --into, beside
    what the file had before.
    """
    from drake_tc.actuation.model_file import load_models
    from drake_tc.exchange.projection import project
    from drake_tc.exchange.targets import TARGETS

    models = _chosen(load_models(model), joint, model)
    if (log or holdout) and rig is None:
        raise ParamsError("export: --log and --holdout need --rig RIG.yaml, which says what the logs show")
    if holdout and to is not Target.mjcf:
        raise ParamsError(f"export: --holdout runs an export in MuJoCo; expected --to mjcf, got --to {to.value}")
    speeds = _speeds(rig, log or [], list(models))
    projections = [project(each, TARGETS[to.value], speeds.get(name)) for name, each in models.items()]
    text = _writer(to, torque_constant)(projections, into)
    errors = _errors(models, projections, rig, holdout, into) if holdout and rig is not None else []
    if out is not None:
        with result_file(out, "--out", inputs=[model, into, rig, *(log or []), *(holdout or [])], force=force) as path:
            path.write_text(text, encoding="utf-8")
    if as_json:
        print(json.dumps(json_value(_document(to, projections, errors, out)), indent=1))
        return
    if out is None:
        sys.stdout.write(text)
    shown = sys.stderr if out is None else sys.stdout
    for line in _account(projections, TARGETS[to.value].name):
        print(line, file=shown)
    if errors:
        _print(errors)
    if out is not None:
        print(out)


def _chosen(models: "dict[str, ActuatorModel]", joints: Sequence[str] | None, path: Path) -> "dict[str, ActuatorModel]":
    for name in joints or []:
        if name not in models:
            raise ParamsError(f"{path}: no joint {name!r}; joints: {', '.join(models)}")
    return {name: each for name, each in models.items() if not joints or name in joints}


def _writer(to: Target, torque_constant: float | None) -> "Callable[[Sequence[Projection], Path | None], str]":
    from drake_tc.exchange.bam import to_bam
    from drake_tc.exchange.isaaclab import to_isaaclab
    from drake_tc.exchange.mjcf import to_mjcf
    from drake_tc.exchange.sdf import to_sdf
    from drake_tc.exchange.urdf import to_urdf

    return {
        Target.mjcf: to_mjcf,
        Target.urdf: to_urdf,
        Target.drake_urdf: lambda projections, into: to_urdf(projections, into, drake=True),
        Target.sdf: to_sdf,
        Target.isaaclab: to_isaaclab,
        Target.bam: lambda projections, into: to_bam(projections, into, torque_constant),
    }[to]


def _speeds(rig: Path | None, logs: Sequence[Path], joints: Sequence[str]) -> dict[str, Any]:
    """(T,) velocities of each joint in the runs to fit."""
    if rig is None or not logs:
        return {}
    from drake_tc.logs.plausible import derivative
    from drake_tc.logs.prepare import load_runs
    from drake_tc.logs.rig import load_rig

    what = load_rig(rig)
    runs = load_runs(logs, what)
    return {
        joint: np.concatenate(
            [derivative(run.columns[f"{joint}/position"], run.period)[run.segment >= 0] for run in runs]
        )
        for joint in joints
        if joint in what.joints
    }


def _errors(
    models: "dict[str, ActuatorModel]",
    projections: "Sequence[Projection]",
    rig: Path,
    runs: Sequence[Path],
    into: Path | None,
) -> list[dict[str, Any]]:
    """RMS errors of the free-running position [rad], by joint and run."""
    from drake_tc.exchange.mujoco_run import mujoco_free_run
    from drake_tc.logs.prepare import load_runs
    from drake_tc.logs.rig import load_rig
    from drake_tc.loops.joint_bench.rig_free_run import rig_free_run
    from drake_tc.simulator_files.read import read_joints

    what = load_rig(rig)
    before = {} if into is None else read_joints(into, ParamsError)
    rows = []
    for run in load_runs(runs, what):
        for projection in projections:
            joint = projection.joint
            ours = rig_free_run(models[joint], what, joint, run)
            exported = mujoco_free_run(models[joint], projection.terms, what, run)
            row: dict[str, Any] = {"joint": joint, "run": run.name, "unit": "rad"}
            row["model"] = None if ours is None else _rms(ours[1], ours[2])
            row["export"] = None if exported is None else _rms(*exported)
            original = before.get(joint)
            if original is not None and original.driven and original.terms.drive == projection.terms.drive:
                was = mujoco_free_run(models[joint], original.with_servo_damping(), what, run)
                row["original"] = None if was is None else _rms(*was)
            rows.append(row)
    return rows


def _rms(recorded: Any, simulated: Any) -> float:
    return float(np.sqrt(np.mean((recorded - simulated) ** 2)))


def _account(projections: "Sequence[Projection]", target: str) -> list[str]:
    """What is lost, joint by joint, in sentences."""
    lines = []
    for each in projections:
        if each.refit is not None:
            r = each.refit
            where = (
                f"the recorded speeds (up to {r.speed:.3g} rad/s)" if r.recorded else f"speeds up to {r.speed:g} rad/s"
            )
            lines.append(
                f"{each.joint}: {target} has no {' and '.join(r.effects)}: dry and viscous friction were refitted over"
                f" {where}; RMS error of the friction torque {r.refitted:.3g} N m, {r.dropped:.3g} without the refit."
            )
        for loss in each.losses:
            has = f"has {loss.effect} only in part" if loss.partly else f"has no {loss.effect}"
            lines.append(f"{each.joint}: {target} {has}{f': {loss.why}' if loss.why else ''}.")
    return lines or [f"{target} expresses all effects of this model."]


def _print(rows: Sequence[dict[str, Any]]) -> None:
    headings = ("joint", "run", "our model, Drake", "export, MuJoCo", "your file, MuJoCo")
    cells = [
        (
            r["joint"],
            r["run"],
            *("-" if r.get(k) is None else f"{r[k]:.3g} rad" for k in ("model", "export", "original")),
        )
        for r in rows
    ]
    print_wide(headings, cells, left=("joint", "run"), title="RMS error of the free-running position")


def _document(
    to: Target, projections: "Sequence[Projection]", errors: Sequence[dict[str, Any]], out: Path | None
) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "name": "export",
        "to": to.value,
        "file": None if out is None else str(out),
        "joints": {
            each.joint: {
                "terms": asdict(each.terms),
                "refit": None if each.refit is None else asdict(each.refit),
                "losses": [asdict(loss) for loss in each.losses],
            }
            for each in projections
        },
        "free_runs": list(errors),
    }
