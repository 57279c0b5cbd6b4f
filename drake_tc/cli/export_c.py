"""`drake-tc export --to c`: the torque control of a model's joints as one C99 file and its header."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from drake_tc.cli.out_files import result_file
from drake_tc.errors import ParamsError

if TYPE_CHECKING:
    from drake_tc.actuation.model import ActuatorModel


@dataclass(frozen=True)
class CRequest:
    """What was asked for: see the options of `export`."""

    model: Path
    out: Path | None
    robot: Path | None
    kp: float
    ki: float
    period: float
    window: int
    force: bool
    as_json: bool
    notes: Sequence[str]


def export_c(request: CRequest, models: "Mapping[str, ActuatorModel]") -> None:
    """Write both files, and print what they hold.

    Args:
        request: The options.
        models: Joint to its drive.

    Raises:
        ParamsError: no file to write, or what cannot be written in C.
    """
    from drake_tc.exchange.c_code import CSpec, to_c
    from drake_tc.robot.link_changes import link_changes
    from drake_tc.robot.robot import load_robot

    if request.out is None or request.out.suffix != ".c":
        raise ParamsError(
            f"export --to c: expected --out NAME.c, beside which NAME.h is written, got {request.out or 'none'}"
        )
    spec = CSpec(name=request.out.stem, dt=request.period, window=request.window, kp=request.kp, ki=request.ki)
    robot = None
    if request.robot is not None:
        robot = replace(load_robot(request.robot, found_links=False), changes=link_changes(request.model))
    files = to_c(models, robot, spec)
    paths = (request.out, request.out.with_suffix(".h"))
    for path, text in zip(paths, (files.source, files.header), strict=True):
        with result_file(path, "--out", inputs=[request.model, request.robot], force=request.force) as place:
            place.write_text(text, encoding="utf-8")
    joints = list(models) if robot is None else list(robot.joints)
    if request.as_json:
        print(
            json.dumps(
                {"name": "export", "to": "c", "files": list(map(str, paths)), "joints": joints, "notes": request.notes}
            )
        )
        return
    print(f"joints: {', '.join(joints)}")
    for note in request.notes:
        print(note)
    if robot is None:
        print("no inverse dynamics, gravity and external torques: add --robot ROBOT.yaml with a fixed base")
    for path in paths:
        print(path)
