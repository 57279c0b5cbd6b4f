"""`drake-tc export`: an identified model in another simulator's terms, with the loss of each effect."""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drake_tc.cli.export_options import ExportOptions, Target
from drake_tc.cli.export_ranges import export_ranges
from drake_tc.cli.out_files import result_file, result_folder
from drake_tc.cli.terminal import print_wide
from drake_tc.config.quoted import json_value
from drake_tc.errors import ParamsError

if TYPE_CHECKING:
    from onnx import ModelProto

    from drake_tc.actuation.model import ActuatorModel
    from drake_tc.actuation.remainder import Remainder
    from drake_tc.diagnosis.result.applications import ExportErrors
    from drake_tc.exchange.projection import Projection
    from drake_tc.exchange.trial import Exported


MJCF = (Target.mjcf, Target.playground, Target.newton)
"""Targets whose file is an MJCF file."""
PROGRAMS = {
    Target.isaaclab: "an Isaac Lab",
    Target.isaaclab_bam: "an Isaac Lab",
    Target.mjlab: "an mjlab",
}
"""Targets whose file is a program, into which nothing is merged, with the article of their names."""


def export_command(options: ExportOptions) -> None:
    """Write the model in the parameters of another simulator, and list the effects that it cannot express.

    Friction that the target lacks (Stribeck friction in most) is replaced by a refit of the friction that it has; the
    error is printed with and without the refit. With --rig and --holdout the export is run on these runs in MuJoCo, in
    a plant of Drake or by BAM's equations. Its error is compared with that of the model in Drake and, with --into, with
    that of the file before. For MJCF the version of MuJoCo that the file needs is printed.

    With --to c the command writes the torque control of the joints as one C99 file and its header: the inverse of the
    drives' models, torque feedback, a position filter, and with --robot gravity and external torques.

    With --remainder the command also writes the torque that no effect of a model explains, one ONNX file a joint.

    With --ranges the command writes the 95 % intervals of the diagnosis as what simulators randomise, and lists the
    parameters that the logs could not show.
    """
    from drake_tc.actuation.model_file import load_model_file
    from drake_tc.config.joint_units import JointUnits
    from drake_tc.diagnosis.result.applications import ExportTrial
    from drake_tc.exchange.actuator_configs import limited_by_supply, to_isaaclab_bam
    from drake_tc.exchange.bam import voltage_motor
    from drake_tc.exchange.links import with_links
    from drake_tc.exchange.mjcf import with_torque_constant
    from drake_tc.exchange.projection import TARGETS, project, vocabulary
    from drake_tc.exchange.trial import RUNS, Exported, changes, export_page, sentences
    from drake_tc.report.sections import cells, headings

    options.require_used()
    to, out, into, runs = options.to, options.out, options.into, options.runs
    if (runs.log or runs.holdout) and runs.rig is None:
        raise ParamsError(
            "export: expected --rig RIG.yaml with --log and --holdout, got none; it says what the columns of the logs"
            " are"
        )
    if options.ranges:
        refused = {"--into": into, "--holdout": runs.holdout, "--page": runs.page, "--remainder": options.remainder}
        given = [name for name, value in refused.items() if value]
        if given:
            raise ParamsError(f"export --ranges: {given[0]} has no use here; leave it out")
        export_ranges(options)
        return
    if options.report is not None or options.unit:
        given_for = "--report" if options.report is not None else "--unit"
        raise ParamsError(f"export: {given_for} belongs to --ranges, which is missing")
    if to is Target.parquet:
        raise ParamsError("export --to parquet writes samples: add --ranges")
    if into is not None and to in PROGRAMS:
        raise ParamsError(
            f"--into: {PROGRAMS[to]} configuration is a program; write a file and import ACTUATORS from it"
        )
    read = load_model_file(options.model)
    models = _chosen(read.models, options.joint, options.model)
    remainders = {name: each for name, each in read.remainders.items() if name in models}
    of_remainders, networks = _remainders(remainders, models, to, options.remainder)
    if to is Target.c:
        export_c(options, models, of_remainders)
        return
    if runs.holdout and to.value not in RUNS:
        raise ParamsError(
            f"export: --holdout needs a target that can be simulated; expected --to {', '.join(RUNS)}, got --to"
            f" {to.value}"
        )
    speeds, torque_constant = runs.speeds(list(models)), options.servo.torque_constant
    projections = []
    for name, each in models.items():
        target = vocabulary(to.value, each.drive.kind, torque_constant)
        projection = project(each, target, *speeds.get(name, (None, None)))
        if torque_constant is not None:
            projection = with_torque_constant(projection, torque_constant, target)
        projections.append(projection)
    if to is Target.isaaclab_bam:
        for projection in projections:
            voltage_motor(projection, to.value)  # before the settings: of another drive they are no use
        settings = options.servo.settings()
        projections = [limited_by_supply(each, settings) for each in projections]
        text = to_isaaclab_bam(projections, settings)
    else:
        text = _writer(to)(projections, into)
    text, of_links = with_links(text, "mjcf" if to in MJCF else to.value, into, read.shared, read.links)
    errors: list[ExportErrors] = []
    notes: list[str] = []
    if runs.holdout and runs.rig is not None:
        exported = Exported(projections, to.value, into, None if into is None else text)
        errors, notes = _errors(models, exported, runs.rig, runs.holdout)
    notes += _file_notes(to, text, projections, into)
    if into is not None and to is not Target.bam:
        notes += changes(text, projections, into)
    notes += [_not_in_newton_metres(models[name]) for name in read.torque_as_effort if name in models]
    notes += of_remainders
    notes += of_links
    lines = (*sentences(projections, TARGETS[to.value]), *notes)
    inputs = [options.model, into, *runs.files]
    runner = RUNS[to.value].name if errors else ""
    if runs.page is not None:
        trial = ExportTrial(to.value, TARGETS[to.value].name, runner, options.model.name, lines, tuple(errors))
        with result_file(runs.page, "--page", inputs=inputs, force=options.force) as path:
            path.write_text(export_page(trial, projections, TARGETS[to.value]), encoding="utf-8")
    if out is not None:
        with result_file(out, "--out", inputs=inputs, force=options.force) as path:
            path.write_text(text, encoding="utf-8")
    written = _write_networks(networks, options.remainder, inputs, force=options.force)
    if options.as_json:
        document = _document(to, projections, errors, out) | {"networks": list(map(str, written)), "notes": notes}
        print(json.dumps(json_value(document), indent=1))
        return
    if out is None:
        sys.stdout.write(text)
    for line in lines:
        print(line, file=options.shown)
    if errors:
        title = "RMS error of the free-running position"
        print_wide(
            headings(errors, runner),
            cells(errors, {name: JointUnits(each.joint_type) for name, each in models.items()}),
            left=("joint", "run"),
            title=title,
            file=options.shown,
        )
    for place in (runs.page, *written, out):
        if place is not None:
            print(place, file=options.shown)


def _chosen(
    models: "Mapping[str, ActuatorModel]", joints: Sequence[str] | None, path: Path
) -> "dict[str, ActuatorModel]":
    for name in joints or []:
        if name not in models:
            raise ParamsError(f"{path}: no joint {name!r}; joints: {', '.join(models)}")
    return {name: each for name, each in models.items() if not joints or name in joints}


def _writer(to: Target) -> "Callable[[Sequence[Projection], Path | None], str]":
    from drake_tc.exchange.actuator_configs import to_isaaclab, to_mjlab_actuators
    from drake_tc.exchange.bam import to_bam
    from drake_tc.exchange.mjcf import to_mjcf
    from drake_tc.exchange.urdf import to_sdf, to_urdf

    return {
        Target.mjcf: to_mjcf,
        Target.playground: to_mjcf,
        Target.newton: to_mjcf,
        Target.mjlab: lambda projections, _into: to_mjlab_actuators(projections),
        Target.urdf: to_urdf,
        Target.drake_urdf: lambda projections, into: to_urdf(projections, into, drake=True),
        Target.sdf: to_sdf,
        Target.isaaclab: lambda projections, _into: to_isaaclab(projections),
        Target.bam: to_bam,
    }[to]


def _not_in_newton_metres(model: "ActuatorModel") -> str:
    from drake_tc.config.joint_units import EFFORT_UNIT, in_units_of

    text = (
        f"{model.joint}: the torques of this model are not in N m but in the unit of the effort"
        f" ({EFFORT_UNIT[model.drive.kind]}), because nothing in the rig file fixed their scale. Inertia and friction"
        " in the exported file have this scale too. Declare `drive_gain` in the rig file and run close-loop again."
    )
    return in_units_of(model.joint_type, text)


def _remainders(
    remainders: "Mapping[str, Remainder]", models: "Mapping[str, ActuatorModel]", to: Target, folder: Path | None
) -> "tuple[list[str], dict[str, ModelProto]]":
    """Sentences on the remainders of joints, and with a folder the networks by the names of their files."""
    from drake_tc.exchange.remainder_network import (
        TARGETS_OF_NETWORKS,
        lost_remainder,
        network_names,
        to_onnx,
        written_remainder,
    )

    types = {name: models[name].joint_type for name in remainders}
    if folder is None:
        return [lost_remainder(name, each, types[name], to.value) for name, each in remainders.items()], {}
    if to.value not in TARGETS_OF_NETWORKS:
        raise ParamsError(f"export --remainder: expected --to {', '.join(TARGETS_OF_NETWORKS)}, got --to {to.value}")
    if not remainders:
        return ["No network was written: no joint of this model has a remainder."], {}
    files = network_names(remainders)
    networks = {files[name]: to_onnx(each, name, types[name]) for name, each in remainders.items()}
    return [written_remainder(name, each, types[name], files[name]) for name, each in remainders.items()], networks


def _write_networks(
    networks: "Mapping[str, ModelProto]", folder: Path | None, inputs: Sequence[Path | None], *, force: bool
) -> list[Path]:
    """Write them, and tell where."""
    if folder is None or not networks:
        return []
    with result_folder(folder, "--remainder", names=networks, inputs=inputs, force=force) as place:
        for name, network in networks.items():
            (place / name).write_bytes(network.SerializeToString())
    return [folder / name for name in networks]


def _file_notes(to: Target, text: str, projections: "Sequence[Projection]", into: Path | None) -> list[str]:
    """Sentences on what the written file needs."""
    from drake_tc.exchange.drake_run import loaded
    from drake_tc.exchange.mujoco_run import file_notes

    if to is Target.bam and into is None:
        return ["BAM loads a file whose entry `actuator` names one of its servos: add it, or give --into."]
    if to is Target.drake_urdf:
        try:
            loaded(text)
        except ParamsError as problem:
            return [f"The written file cannot be loaded: {problem}."]
    return file_notes(text, projections, into) if to in MJCF else []


def _errors(
    models: "dict[str, ActuatorModel]", exported: "Exported", rig: Path, runs: Sequence[Path]
) -> "tuple[list[ExportErrors], list[str]]":
    """Errors of the runs, and sentences on them."""
    from drake_tc.exchange.trial import run_errors, run_notes
    from drake_tc.logs.prepare import load_runs
    from drake_tc.logs.rig import load_rig

    what = load_rig(rig)
    problems: list[str] = []
    rows = run_errors(models, exported, what, load_runs(runs, what), problems)
    return rows, [*problems, *run_notes(exported, what)]


def _document(
    to: Target, projections: "Sequence[Projection]", errors: "Sequence[ExportErrors]", out: Path | None
) -> dict[str, Any]:
    from dataclasses import asdict

    from drake_tc.config.joint_units import JointUnits

    units = {each.joint: JointUnits(each.joint_type) for each in projections}
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
        "free_runs": [{**asdict(row), "unit": units[row.joint].position} for row in errors],
    }


def export_c(options: ExportOptions, models: "Mapping[str, ActuatorModel]", notes: Sequence[str]) -> None:
    """Write the torque control of a model's joints as one C99 file and its header, and print what they hold.

    Args:
        options: Of the command.
        models: Joint to its drive.
        notes: Sentences on what is not written.

    Raises:
        ParamsError: no file to write, or what cannot be written in C.
    """
    from drake_tc.exchange.c_code import to_c
    from drake_tc.robot.link_changes import link_changes
    from drake_tc.robot.robot import load_robot

    out, file = options.out, options.code.robot
    if out is None or out.suffix != ".c":
        raise ParamsError(f"export --to c: expected --out NAME.c, beside which NAME.h is written, got {out or 'none'}")
    spec = options.code.spec(out.stem)
    robot = None
    if file is not None:
        robot = replace(load_robot(file, found_links=False), changes=link_changes(options.model))
    files = to_c(models, robot, spec)
    paths = (out, out.with_suffix(".h"))
    for path, text in zip(paths, (files.source, files.header), strict=True):
        with result_file(path, "--out", inputs=[options.model, file], force=options.force) as place:
            place.write_text(text, encoding="utf-8")
    joints = list(models) if robot is None else list(robot.joints)
    if options.as_json:
        what = {"name": "export", "to": "c", "files": list(map(str, paths))}
        print(json.dumps({**what, "joints": joints, "notes": notes}))
        return
    print(f"joints: {', '.join(joints)}")
    for note in notes:
        print(note)
    if robot is None:
        print("no inverse dynamics, gravity and external torques: add --robot ROBOT.yaml with a fixed base")
    for path in paths:
        print(path)
