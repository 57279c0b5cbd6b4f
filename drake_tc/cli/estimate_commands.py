"""`drake-tc estimate-torque` and `drake-tc estimate-base`.

`drake-tc estimate-torque`: the joint torques that `close-loop` takes for the loads of a robot's joints.

`drake-tc estimate-base`: pose and velocity of a floating base from a log, beside the chain from a foot's centre.
"""

import json
import sys
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from drake_tc.cli.options import Force, UnusedSeed
from drake_tc.cli.out_files import result_folder
from drake_tc.cli.terminal import print_wide, progress_bar
from drake_tc.config.quoted import json_value
from drake_tc.errors import RigError

if TYPE_CHECKING:
    from drake_tc.estimation.base_log import BaseResult
    from drake_tc.estimation.off_line import OffLineFilter
    from drake_tc.estimation.robot_loads import RobotLogs
    from drake_tc.filtering.savitzky_golay import Window
    from drake_tc.logs.record import Run
    from drake_tc.logs.rig import Rig


@dataclass(frozen=True, kw_only=True)
class TorqueOptions:
    """Options of `drake-tc estimate-torque`."""

    rig: Annotated[Path, typer.Option(help="Rig file with `robot:` and `load: {robot: ...}`.")]
    log: Annotated[list[Path], typer.Option(help="A log; repeat for more.")]
    out: Annotated[Path, typer.Option(help="Folder for LOG_torque.csv with the columns time and JOINT/torque [N m].")]
    links: Annotated[
        Path | None,
        typer.Option(help="model_after.yaml that close-loop wrote with `load: {robot: fitted}`: the fitted links."),
    ] = None
    force: Force = False
    as_json: Annotated[bool, typer.Option("--json", help="Print files, filters and torque ranges as JSON.")] = False
    seed: UnusedSeed = 0


def estimate_torque_command(options: TorqueOptions) -> None:
    """Estimate joint torques behind the gears from encoders, IMU, F/T sensors and the robot's model.

    The estimate is that of close-loop, with windows chosen from each log's noise and bandwidth. In addition the
    readings of the F/T sensors are filtered here (close-loop filters them later, with all other channels). The rows
    are those of the log's uniform clock; rows that cannot be used have no torque. With `load: {robot: fitted}` the
    links' parameters come from --links.
    """
    from drake_tc.estimation.robot_loads import (
        filters_of,
        fitted_links,
        robot_logs,
        with_fitted_links,
        with_robot_loads,
    )
    from drake_tc.logs.prepare import load_runs
    from drake_tc.logs.record import distinct_notes
    from drake_tc.logs.rig import load_rig

    rig, log, out, links = options.rig, options.log, options.out, options.links
    what = load_rig(rig)
    place = result_folder(out, "--out", inputs=[rig, *log], force=options.force)
    with place as folder, progress_bar("estimate-torque", quiet=options.as_json) as progress:
        progress("reading", 0.0)
        runs = load_runs(log, what)
        logs = robot_logs(what, runs)
        if logs is None or (logs.links is None) != (links is None):
            raise RigError(_refusal(rig, logs, links))
        entries = []
        parameters = None if logs.links is None or links is None else fitted_links(links, logs.links)
        for number, run in enumerate(runs):
            progress(run.name, number / len(runs))
            (loaded,) = with_robot_loads(logs, [run], what.joints, filter_wrenches=True)
            if logs.links is not None and parameters is not None:
                (loaded,) = with_fitted_links(logs, logs.links, [loaded], what.joints, parameters)
            entries.append(_written(loaded, what, filters_of(logs, run), folder))
    for entry in entries:
        entry["file"] = str(out / str(entry["file"]))
    for note in distinct_notes((run.name, note) for run in runs for note in run.notes):
        print(f"estimate-torque: {note}", file=sys.stderr)
    if options.as_json:
        print(json.dumps(json_value({"name": "estimate-torque", "rig": str(rig), "logs": entries})))
    else:
        print("\n".join(str(entry["file"]) for entry in entries))


def _refusal(rig: Path, logs: "RobotLogs | None", links: Path | None) -> str:
    """What to say where the rig file's load and --links do not belong together."""
    if logs is not None and links is None:
        return (
            f"{rig}: load: {{robot: fitted}} requires --links with the model_after.yaml that close-loop wrote; "
            "{robot: inverse_dynamics} takes the links as the URDF has them"
        )
    if logs is not None:
        return f"--links {links}: expected a rig file with `load: {{robot: fitted}}`, got another load in {rig}"
    return (
        f"{rig}: load: expected {{robot: estimate}}, {{robot: inverse_dynamics}} or {{robot: fitted}} with "
        "`robot: FILE`, got a load that is not computed from a robot's model"
    )


def _written(run: "Run", rig: "Rig", filters: "OffLineFilter", out: Path) -> dict[str, object]:
    """Write one run's torques into the folder `out`; what the JSON says of it."""
    import pandas as pd

    from drake_tc.config.files import file_name

    names = [f"{joint}/torque" for joint in rig.joints]
    table = pd.DataFrame({"time": run.time, **{name: run.columns[name] for name in names}})
    table.loc[run.segment < 0, names] = float("nan")
    name = f"{file_name(run.name)}_torque.csv"
    table.to_csv(out / name, index=False, float_format="%.9g")
    ranges = {j: [float(table[f"{j}/torque"].min()), float(table[f"{j}/torque"].max())] for j in rig.joints}
    windows = {name: _told(getattr(filters, name)) for name in ("encoder", "inertial", "wrench")}
    return {"file": name, "period": run.period, "filters": windows, "range": ranges}


def _told(window: "Window") -> dict[str, int]:
    return {"samples": window.samples, "order": window.order}


_ROWS = ("x, m", "y, m", "z, m", "roll, deg", "pitch, deg", "yaw, deg", "vx, m/s", "vy, m/s", "vz, m/s")
FILES = ("estimate.csv", "estimate.json")


@dataclass(frozen=True, kw_only=True)
class BaseOptions:
    """Options of `drake-tc estimate-base`."""

    rig: Annotated[Path, typer.Option(help="Rig file: robot, contacts, columns.")]
    log: Annotated[Path, typer.Option(help="A log: CSV, Parquet, NPZ, MAT, JSON, LeRobot, MCAP or a ROS bag.")]
    out: Annotated[Path | None, typer.Option(help="Folder for estimate.csv and estimate.json.")] = None
    force: Force = False
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False
    seed: UnusedSeed = 0


def estimate_base_command(options: BaseOptions) -> None:
    """Estimate base position, yaw and velocity from encoders, IMU and contact loads.

    Where the log has the true motion, the RMS errors are printed.
    """
    from drake_tc.estimation.base_log import evaluate_log
    from drake_tc.estimation.base_rig import load_base_rig

    rig, log, out, force = options.rig, options.log, options.out, options.force
    what = load_base_rig(rig)
    place = nullcontext() if out is None else result_folder(out, "--out", names=FILES, inputs=[rig, log], force=force)
    with place as folder, progress_bar("estimate-base", quiet=options.as_json) as progress:
        result = evaluate_log(what, log, progress)
        document = json_value({"name": "estimate-base", "rig": str(rig), "log": str(log), **result.to_json()})
        if folder is not None:
            result.table().to_csv(folder / FILES[0], index=False)
            (folder / FILES[1]).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    if options.as_json:
        print(json.dumps(document))
    else:
        _print(result)
    for note in result.notes:
        print(f"estimate-base: {log}: {note}", file=sys.stderr)
    if out is not None and not options.as_json:
        print(out / FILES[0])


def _print(result: "BaseResult") -> None:
    import numpy as np

    last, angle = result.estimate.position[-1], float(np.degrees(result.estimate.rpy[-1, 2]))
    print(
        f"{len(result.estimate.time)} samples, {result.estimate.time[-1]:.1f} s; base at the end:"
        f" {last[0]:.3f} {last[1]:.3f} {last[2]:.3f} m, yaw {angle:.1f} deg"
    )
    if result.errors is not None:
        ours, base = ((*error.position, *np.degrees(error.angle), *error.velocity) for error in result.errors)
        counts = np.repeat(result.errors[0].samples, 3)
        rows = [
            (name, *(f"{value:.4f}" if np.isfinite(value) else "" for value in values), str(count))
            for name, *values, count in zip(_ROWS, ours, base, counts, strict=True)
        ]
        headings = ("", "centre of pressure", "foot centre", "samples")
        print_wide(headings, rows, left=("",), title="RMSE against the truth")
    raised = {name: share for name, share in result.flag_shares().items() if share > 0.0 and not name.endswith("/on")}
    if raised:
        listed = sorted(raised.items(), key=lambda item: -item[1])
        print("flags: " + ", ".join(f"{name} {100.0 * share:.1f} %" for name, share in listed))
