"""`drake-tc estimate-base`: pose and velocity of a floating base from a log, beside the chain from a foot's centre."""

import json
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from drake_tc.cli.out_files import Force, result_folder
from drake_tc.cli.progress import progress_bar
from drake_tc.cli.seed_option import UnusedSeed
from drake_tc.cli.wide_table import print_wide
from drake_tc.config.quoted import json_value
from drake_tc.errors import LogError

if TYPE_CHECKING:
    from drake_tc.estimation.base.evaluate import BaseResult

_ROWS = ("x, m", "y, m", "z, m", "roll, deg", "pitch, deg", "yaw, deg", "vx, m/s", "vy, m/s", "vz, m/s")
FILES = ("estimate.csv", "estimate.json")


def estimate_base_command(
    rig: Annotated[Path, typer.Option(help="Rig file: robot, contacts, columns.")],
    log: Annotated[Path, typer.Option(help="A log: CSV, Parquet, NPZ, MAT, JSON, LeRobot, MCAP or a ROS bag.")],
    out: Annotated[Path | None, typer.Option(help="Folder for estimate.csv and estimate.json.")] = None,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
    seed: UnusedSeed = 0,
) -> None:
    """Estimate base position, yaw and velocity from encoders, IMU and contact loads.

    Where the log has the true motion, the RMS errors are printed.
    """
    from drake_tc.estimation.base.evaluate import evaluate_log
    from drake_tc.estimation.base.rig import load_base_rig

    what = load_base_rig(rig)
    place = (
        nullcontext()
        if out is None
        else result_folder(out, "--out", names=FILES, inputs=[rig, log], force=force, error=LogError)
    )
    with place as folder, progress_bar("estimate-base", quiet=as_json) as progress:
        result = evaluate_log(what, log, progress)
        document = json_value({"name": "estimate-base", "rig": str(rig), "log": str(log), **result.to_json()})
        if folder is not None:
            result.table().to_csv(folder / FILES[0], index=False)
            (folder / FILES[1]).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    if as_json:
        print(json.dumps(document))
    else:
        _print(result)
    for note in result.notes:
        print(f"estimate-base: {log}: {note}", file=sys.stderr)
    if out is not None and not as_json:
        print(out / FILES[0])


def _print(result: "BaseResult") -> None:
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
