"""The export of a model, tried on recorded runs without writing a file.

What an export loses, in sentences, and as a page beside the errors of free runs.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.config.joint_units import EFFORT_UNIT, JointUnits, in_units_of
from drake_tc.diagnosis.result.applications import ExportTrial
from drake_tc.exchange.comparison import RUNS, run_errors, run_notes
from drake_tc.exchange.mjcf import to_mjcf
from drake_tc.exchange.mujoco_run import file_notes
from drake_tc.exchange.projection import Projection, Vocabulary, project
from drake_tc.exchange.targets import TARGETS
from drake_tc.logs.checks.plausible import derivative
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.report.numbers import significant
from drake_tc.report.plain_page import PageSection, PageTable, plain_page
from drake_tc.report.sections import HOW, cells, headings
from drake_tc.report.sentences.words import title_of
from drake_tc.types import FloatArray


def sentences(projections: Sequence[Projection], target: Vocabulary) -> list[str]:
    """What is lost, joint by joint.

    Args:
        projections: One a joint.
        target: What they are projected to.
    """
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
    """The HTML of an export: what is lost, errors of free runs, and the terms that were written.

    Args:
        trial: Its rows are empty where nothing was run.
        projections: One a joint.
        target: What they are projected to.
    """
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
    rows = run_errors(models, projections, to, rig, runs[1], original)
    said = sentences(projections, target) + run_notes(projections, to, rig, original)
    said += file_notes(to_mjcf(projections), projections) if to == "mjcf" else []
    return ExportTrial(to, target.name, RUNS[to].name, model_file, tuple(said), tuple(rows))


def recorded_speeds(runs: Sequence[Run], rig: Rig, joints: Sequence[str]) -> dict[str, FloatArray]:
    """Joint to its velocities (T,) [rad/s] in usable rows of all runs.

    Args:
        runs: At least one.
        rig: Names the joints of the runs; others are left out.
        joints: Of the model.
    """
    return {
        joint: np.concatenate(
            [derivative(run.columns[f"{joint}/position"], run.period)[run.segment >= 0] for run in runs]
        )
        for joint in joints
        if joint in rig.joints
    }


def recorded_loads(runs: Sequence[Run], rig: Rig, joints: Sequence[str]) -> dict[str, FloatArray]:
    """Joint to its load torques (T,) [N m] in usable rows of all runs; without the joints whose load is not known.

    Args:
        runs: At least one.
        rig: Names the joints of the runs; others are left out.
        joints: Of the model.
    """
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
