"""An export tried on held-out logs, and what it loses, in sentences and as a page.

Free runs are those of the identified model in Drake, of its export in the target, and of what the user's file had.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.config.joint_units import EFFORT_UNIT, JointUnits, in_units_of
from drake_tc.diagnosis.result.applications import ExportErrors, ExportTrial
from drake_tc.errors import ParamsError
from drake_tc.exchange.bam import simulate_as_bam
from drake_tc.exchange.drake_run import simulate_file_in_drake, simulate_in_drake, simulate_plain_in_drake
from drake_tc.exchange.mjcf import NAMING, put_includes, to_mjcf
from drake_tc.exchange.mujoco_run import file_notes, require_mujoco, simulate_in_mujoco, simulate_mjcf, too_old_for
from drake_tc.exchange.projection import TARGETS, Projection, Vocabulary, project
from drake_tc.exchange.target_run import Runner, WrittenFile, target_free_run
from drake_tc.exchange.urdf import to_sdf, to_urdf
from drake_tc.exchange.xml_text import read_xml, to_text, top
from drake_tc.logs.checks.plausible import derivative
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.loops.joint_bench import rig_free_run
from drake_tc.report.numbers import significant
from drake_tc.report.pages import PageSection, PageTable, plain_page
from drake_tc.report.sections import HOW, cells, headings
from drake_tc.report.words import title_of
from drake_tc.simulator_files.read import ANY_JOINT, joints_of_text, read_joints
from drake_tc.simulator_files.terms import ReadJoint, Terms
from drake_tc.simulator_files.xml_tree import place, states, xml_tree
from drake_tc.types import FloatArray

NO_FRICTION = MappingProxyType({"frictionloss": "Drake's parser does not use the friction of a joint"})
URDF, SDF = (partial(simulate_plain_in_drake, write) for write in (to_urdf, to_sdf))
RUNS: Mapping[str, Runner] = MappingProxyType(
    {
        "mjcf": Runner("MuJoCo", simulate_in_mujoco, 1e-3, simulate_mjcf, 5e-4, require_mujoco, too_old_for),
        "urdf": Runner("Drake's plant", URDF, 2e-4, simulate_file_in_drake, ignores=NO_FRICTION),
        "drake-urdf": Runner("Drake's plant", simulate_in_drake, 2e-4, simulate_file_in_drake),
        "sdf": Runner("Drake's plant", SDF, 2e-4, simulate_file_in_drake, ignores=NO_FRICTION),
        "bam": Runner("BAM's equations", simulate_as_bam, 2e-4),
    }
)
"""Target, as on the command line, to what runs it. With 1 ms, the implicit servo of Drake's plant and BAM's integration
would err by some 0.2 % of the motion themselves."""


@dataclass(frozen=True)
class Exported:
    """Models in the terms of another simulator, and the user's file beside them.

    Attributes:
        projections: One a joint.
        target: A key of `RUNS`.
        original: The user's file; None: there is none.
        text: Of the file that the terms were merged into; the run is that of this file. None: of a bench of the terms.
    """

    projections: Sequence[Projection]
    target: str
    original: Path | None = None
    text: str | None = None


def run_errors(
    models: Mapping[str, ActuatorModel],
    exported: Exported,
    rig: Rig,
    runs: Sequence[Run],
    problems: list[str] | None = None,
) -> list[ExportErrors]:
    """One row a joint and run.

    Args:
        models: By joint.
        exported: These models.
        rig: Of the runs.
        runs: Held-out ones.
        problems: Takes sentences on files that their simulator does not load, whose errors are None; None: they raise.

    Raises:
        ParamsError: the target is not installed, or refuses the model; an unreadable file; a rig whose loads come from
            a robot's model.
    """
    runner, text = require_runner(exported.target, rig), exported.text
    both = _to_run(exported, rig)

    def error(what: Terms | WrittenFile | None, terms: Terms | None, joint: str, run: Run) -> float | None:
        if what is None or terms is None or runner.too_old(terms):
            return None
        try:
            return _rms(target_free_run(runner, models[joint], what, rig, run))
        except ParamsError as problem:
            if problems is None or not isinstance(what, WrittenFile):
                raise
            told = f"{joint}: {'the export' if what.text == text else 'your file'} was not run: {problem}."
            if told not in problems:
                problems.append(told)
            return None

    rows = []
    for run in runs:
        for joint, (new, was) in both.items():
            ours = rig_free_run(models[joint], rig, joint, run)
            model = None if ours is None else _rms(ours[1:])
            rows.append(ExportErrors(joint, run.name, model, error(*new, joint, run), error(*was, joint, run)))
    return rows


def run_notes(exported: Exported, rig: Rig) -> list[str]:
    """Sentences on what a run of the export does not have although the file has it, or on why it is not run."""
    target, into = exported.target, exported.original
    runner, lines = RUNS[target], list[str]()
    read = {} if into is None else read_joints(into, ParamsError)
    inertias = {name: each.terms.armature for name, each in read.items()}
    for joint, (new, original) in _terms_to_run(exported).items():
        for what, terms in (("the export", new), ("your file", original)):
            if terms is not None and (old := runner.too_old(terms)):
                lines.append(f"{joint}: {what} was not run: {old}.")
        lines += [
            f"{joint}: {why}: the runs are without it."
            for term, why in runner.ignores.items()
            if any(getattr(terms, term) for terms in (new, original) if terms is not None)
        ]
        has_inertia = TARGETS[target].has("armature") or new.armature or inertias.get(joint)
        if not has_inertia and rig.load[joint] == "torque":
            lines.append(
                f"{joint}: the load is a recorded torque, so the run of the export has no inertia:"
                f" {TARGETS[target].name} has no rotor inertia."
            )
    return lines


def require_runner(target: str, rig: Rig) -> Runner:
    """What runs an export of the models of a rig.

    Raises:
        ParamsError: the target is not installed, or the rig's loads come from a robot's model: the load on the joint
            is then no column of the runs.
    """
    if rig.robot is not None:
        raise ParamsError(
            "the export runs each joint by itself: expected a rig with a torque column or a load of its own, got loads"
            " that the model of a robot computes; run the exported robot in its simulator instead"
        )
    RUNS[target].require()
    return RUNS[target]


def _terms_to_run(exported: Exported) -> dict[str, tuple[Terms, Terms | None]]:
    """By joint the terms of the export and those of the user's file; None where the file's cannot be run."""
    before = {} if exported.original is None else read_joints(exported.original, ParamsError)
    found = {}
    for projection in exported.projections:
        was = before.get(projection.joint, before.get(ANY_JOINT))
        original = None if was is None else _original(was, projection.terms, TARGETS[exported.target])
        found[projection.joint] = projection.terms, original
    return found


_What = tuple[Terms | WrittenFile | None, Terms | None]


def _to_run(exported: Exported, rig: Rig) -> dict[str, tuple[_What, _What]]:
    """By joint what runs of the export and of the user's file: a file where its own links are the load, with terms."""
    found: dict[str, tuple[_What, _What]] = {}
    target, original, text = exported.target, exported.original, exported.text
    files = RUNS[target].simulate_file is not None
    for joint, (terms, was) in _terms_to_run(exported).items():
        whole = files and (isinstance(rig.load[joint], Pendulum) or rig.load[joint] == "torque")
        new: _What = terms, terms
        old: _What = was, was
        if whole and text is not None and original is not None:
            new = _file(text, joint, terms, original), terms
            old = None if was is None else _file(_flat(original, target), joint, was, original), was
        found[joint] = new, old
    return found


def _flat(path: Path, target: str) -> str:
    """The text of the user's file, with what it includes."""
    if target != "mjcf":
        return path.read_text(encoding="utf-8")
    document = read_xml(path, "mujoco")
    put_includes(top(document), path.parent)
    return to_text(document)


def _file(text: str, joint: str, terms: Terms, path: Path) -> WrittenFile:
    servo = (terms.kp, 0.0) if terms.drive == "position_servo" else None
    return WrittenFile(text, joint, path.parent, servo, terms.kp)


def changes(text: str, projections: Sequence[Projection], into: Path) -> list[str]:
    """Sentences on what the file had beside the model: what went, and what stays in the file that was written.

    Raises:
        ParamsError: the file cannot be read.
    """
    before, after = read_joints(into, ParamsError), joints_of_text(text, into, ParamsError)
    files = ", ".join(_INCLUDE.findall(into.read_text(encoding="utf-8")))
    lines = [f"The files that your file includes were merged into the written file: {files}."] if files else []
    if (tree := xml_tree(text)).tag == "mujoco":
        lines += _gone_with_states(xml_tree(_flat(into, "mjcf")), tree)
    for each in projections:
        was, now = (found.get(each.joint, found.get(ANY_JOINT)) for found in (before, after))
        if was is None or now is None:
            continue
        left = [_term(name, now.terms) for name in LEFTOVERS if _differs(name, now.terms, each.terms)]
        if now.driven and now.terms.drive == each.terms.drive:
            more = now.derivative_gain - each.terms.derivative_gain
            left += [f"a servo gain of {now.terms.kp:.4g} N m/rad"] if _other(now.terms.kp, each.terms.kp) else []
            other = _other(now.derivative_gain, each.terms.derivative_gain)
            left += [f"a servo damping of {more:.4g} N m s/rad"] if other else []
        gone = [
            _term(name, was.terms)
            for name in LEFTOVERS
            if getattr(was.terms, name) and not getattr(now.terms, name) and not getattr(each.terms, name)
        ]
        words, still = ([_LINE.sub("", told) for told in found.unused] for found in (was, now))
        kinds = [_TAG.sub("<", told) for told in still]  # the drive may have another tag
        acting = [told for told in words if told.startswith(DRIVING) or "range of" in told]
        gone += [told for told in acting if _TAG.sub("<", told) not in kinds]
        if was.driven and (not now.driven or was.terms.drive != now.terms.drive):
            gone.append(f"a drive whose command is a {was.terms.drive.removesuffix('_servo')}")
        more = now.with_servo_damping().damping - each.terms.damping
        left += [f"a damping of {more:.4g} N m s/rad beside the model's"] if more > SAME * each.terms.damping else []
        more = now.terms.frictionloss - each.terms.frictionloss
        left += (
            [f"a dry friction of {more:.4g} N m beside the model's"] if more > SAME * each.terms.frictionloss else []
        )
        left += [told for told in dict.fromkeys(still) if told in words or "range" in told or told.endswith(DISABLED)]
        for what, why, found in (("removed", "because", gone), ("kept", "although", left)):
            told = f"{each.joint}: {what} from your file, {why} the model does not have it: {', '.join(found)}."
            lines += [in_units_of(each.joint_type, told)] if found else []
    return lines


def _gone_with_states(before: ET.Element, after: ET.Element) -> list[str]:
    """Sentences on what an MJCF file had of joints and of states of drives that it has no more."""
    lines = list[str]()
    for name in (each for each in states(before) if each not in states(after)):
        naming = (each for each in before.iter() if name in map(each.get, NAMING))
        lines += [
            f"{_LINE.sub('', place(each))} was removed from your file, because it refers to the removed joint {name}."
            for each in naming
        ]
    if any(key.get("act") for key in before.iter("key")) and not any(key.get("act") for key in after.iter("key")):
        lines.append(
            "The actuator states (act) were removed from the keyframes, because the drive has other states now."
        )
    return lines


LEFTOVERS: Mapping[str, str] = MappingProxyType(
    {
        "stiffness": "a spring of {:.4g} N m/rad",
        "lag": "a filter of the command of {:.4g} s",
        "delay": "a delay of {:.4g} s",
        "integral_rate": "integral action of {:.4g} 1/s",
        "backlash": "a play of {:.4g} rad",
        "compliance": "an elasticity of {:.4g} rad/(N m)",
        "quadratic": "quadratic friction of {:.4g} N m s^2/rad^2",
        "ripple": "a torque ripple",
        "stribeck": "a Stribeck peak",
        "armature": "a rotor inertia of {:.4g} kg m^2",
        "torque_limit": "a limit of the torque of {:.4g} N m",
    }
)
"""Terms that a file may have and a model lack, in words."""
_INCLUDE = re.compile(r"<include\s+file=[\"']([^\"']+)")
DRIVING = ("its actuator", "the command of", "the constant force of", "that the command of")
"""Begins of what is not used of a file and drives a joint."""
DISABLED = "which <flag> disables"
_LINE = re.compile(r" in line \d+")
_TAG = re.compile(r"<\w+")


SAME = 1e-6
"""Relative difference of two numbers that are the same but for their digits in a file."""


def _other(value: float, wanted: float) -> bool:
    return abs(value - wanted) > SAME * max(abs(wanted), SAME)


def _differs(name: str, now: Terms, wanted: Terms) -> bool:
    here, there = getattr(now, name), getattr(wanted, name)
    return bool(here) and (not there or (name == "torque_limit" and here < (1.0 - SAME) * there))


def _term(name: str, terms: Terms) -> str:
    value = getattr(terms, name)
    return LEFTOVERS[name].format(value) if isinstance(value, float | int) else LEFTOVERS[name]


def _original(was: ReadJoint, exported: Terms, target: Vocabulary) -> Terms | None:
    """The file's terms, where they are all of its model and its drive takes the recorded command.

    Where the target has no gain for such a drive, the user's controller has it: it is the same in both runs.
    """
    if "load_dependent_friction" in was.effects:
        return None
    if was.driven:
        return was.with_servo_damping() if was.terms.drive == exported.drive else None
    return None if exported.drive in target.drives else replace(was.terms, drive=exported.drive, kp=exported.kp)


def _rms(run: tuple[FloatArray, FloatArray] | None) -> float | None:
    return None if run is None else float(np.sqrt(np.mean((run[0] - run[1]) ** 2)))


def sentences(projections: Sequence[Projection], target: Vocabulary) -> list[str]:
    """What is lost, joint by joint."""
    out = []
    for each in projections:
        lines = []
        if each.refit is not None:
            r = each.refit
            where = (
                f"the recorded speeds (up to {r.speed:.3g} rad/s)" if r.recorded else f"speeds up to {r.speed:g} rad/s"
            )
            has = f"has no {' and '.join(map(title_of, r.effects))}"
            if each.terms.stribeck is not None and "stribeck" in r.effects:
                others = " and ".join(title_of(name) for name in r.effects if name != "stribeck")
                has = f"has Stribeck friction with the exponent {each.terms.stribeck.exponent:g} only"
                has += f", and no {others}" if others else ""
            lines.append(
                f"{each.joint}: {target.name} {has}. The friction that it has was fitted to the model's over {where};"
                f" the RMS error of the friction torque is {r.refitted:.3g} N m, and {r.dropped:.3g} N m without this"
                " fit."
            )
        for loss in each.losses:
            effect = title_of(loss.effect)
            has = f"has {effect} only in part" if loss.partly else f"has no {effect}"
            lines.append(f"{each.joint}: {target.name} {has}{f': {loss.why}' if loss.why else ''}.")
        out += [in_units_of(each.joint_type, line) for line in lines]
    return out or [f"{target.name} expresses all effects of this model."]


def export_page(trial: ExportTrial, projections: Sequence[Projection], target: Vocabulary) -> str:
    """The HTML of an export: what is lost, errors of free runs, and the terms that were written."""
    sections = []
    if trial.rows:
        names = headings(trial.rows, trial.runner)
        table = PageTable(
            names, cells(trial.rows, {each.joint: JointUnits(each.joint_type) for each in projections}), names[2:]
        )
        title = "RMS error of the free-running position on held-out runs"
        sections.append(PageSection(title, paragraphs=[HOW], tables=(table,)))
    names = ("joint", "term", "value")
    sections.append(
        PageSection("What was written", tables=(PageTable(names, _terms(projections, target), ("value",)),))
    )
    return plain_page(f"The model in {target.name}", f"export · {trial.model_file}", trial.losses, sections)


def _terms(projections: Sequence[Projection], target: Vocabulary) -> list[tuple[str, str, str]]:
    rows = []
    for each in projections:
        t = each.terms
        found: list[tuple[str, float | None, str]] = [
            (
                "torque for one unit of command",
                t.kp if t.drive in target.drives else None,
                f"N·m/{EFFORT_UNIT[t.drive]}",
            ),
            ("torque constant", t.torque_constant, "N·m/A"),
            ("rotor inertia at the joint", t.armature, "kg·m²"),
            ("viscous friction", t.damping, "N·m·s/rad"),
            ("quadratic friction", t.quadratic, "N·m·s²/rad²"),
            ("dry friction", t.frictionloss, "N·m"),
            ("Stribeck peak", t.stribeck.height if t.stribeck else None, "N·m"),
            ("Stribeck velocity", t.stribeck.velocity if t.stribeck else None, "rad/s"),
            ("Stribeck exponent", t.stribeck.exponent if t.stribeck else None, ""),
            ("friction under load, share of the load", t.load_friction, ""),
            ("delay of the command", t.delay, "s"),
            ("limit of the torque", t.torque_limit, "N·m"),
            ("play of the gear", t.backlash, "rad"),
            ("stiffness of the spring", t.stiffness, "N·m/rad"),
            ("torque of the spring at position 0", t.preload, "N·m"),
            ("filter of the command", t.lag, "s"),
            ("integral gain over the gain", t.integral_rate, "1/s"),
            ("damping inside of the limit", t.derivative_gain, "N·m·s/rad"),
            ("compliance of the gear", t.compliance, "rad/(N·m)"),
            ("torque ripple, cosine", t.ripple.cosine if t.ripple else None, "N·m"),
            ("torque ripple, sine", t.ripple.sine if t.ripple else None, "N·m"),
            ("torque ripple, periods a turn", t.ripple.cycles if t.ripple else None, ""),
        ]
        rows += [
            (each.joint, name, f"{significant(value, 5)} {in_units_of(each.joint_type, unit)}".strip())
            for name, value, unit in found
            if value
        ]
    return rows


def try_export(
    models: Mapping[str, ActuatorModel],
    model_file: str,
    to: str,
    rig: Rig,
    runs: tuple[Sequence[Run], Sequence[Run]],
    original: Path | None,
) -> ExportTrial:
    """Errors of the model, of its export and of the user's own file on held-out runs.

    Args:
        models: By joint.
        model_file: Name of their file.
        to: A key of `RUNS`.
        rig: Of the runs.
        runs: Training runs, whose speeds weight the refit of friction, and held-out runs.
        original: The user's file; None: there is none.

    Raises:
        ParamsError: the target is not installed, or cannot run this rig; an unreadable file.
    """
    target = TARGETS[to]
    speeds, loads = recorded_speeds(runs[0], rig, list(models)), recorded_loads(runs[0], rig, list(models))
    projections = [project(model, target, speeds.get(name), loads.get(name)) for name, model in models.items()]
    exported = Exported(projections, to, original)
    rows = run_errors(models, exported, rig, runs[1])
    said = sentences(projections, target) + run_notes(exported, rig)
    said += file_notes(to_mjcf(projections), projections) if to == "mjcf" else []
    return ExportTrial(to, target.name, RUNS[to].name, model_file, tuple(said), tuple(rows))


def recorded_speeds(runs: Sequence[Run], rig: Rig, joints: Sequence[str]) -> dict[str, FloatArray]:
    """Velocities (T,) [rad/s] of joints of the rig in usable rows of all runs."""
    return {
        joint: np.concatenate(
            [derivative(run.columns[f"{joint}/position"], run.period)[run.segment >= 0] for run in runs]
        )
        for joint in joints
        if joint in rig.joints
    }


def recorded_loads(runs: Sequence[Run], rig: Rig, joints: Sequence[str]) -> dict[str, FloatArray]:
    """Load torques (T,) [N m] of joints of the rig in usable rows of all runs; without those that are not known."""
    found = {}
    for joint in joints:
        parts = [_load(run, rig, joint) for run in runs] if joint in rig.joints else [None]
        known = [part for part in parts if part is not None]
        if len(known) == len(parts):
            found[joint] = np.concatenate(known)
    return found


def _load(run: Run, rig: Rig, joint: str) -> FloatArray | None:
    used, load = run.segment >= 0, rig.load[joint]
    if isinstance(load, Pendulum):
        link, q = load.in_run(run), run.columns[f"{joint}/position"]
        acceleration = derivative(derivative(q, run.period), run.period)
        return np.asarray(link.weight * np.sin(q - link.zero) + link.inertia * acceleration)[used]
    torque = run.columns.get(f"{joint}/torque")
    return None if torque is None else np.asarray(torque[used])
