"""Free runs of held-out logs: the identified model in Drake, its export in the target, and what the user's file had."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.diagnosis.result.export_trial import ExportErrors
from drake_tc.errors import ParamsError
from drake_tc.exchange.bam_run import simulate_as_bam
from drake_tc.exchange.drake_run import simulate_in_drake, simulate_sdf_in_drake, simulate_urdf_in_drake
from drake_tc.exchange.mujoco_run import require_mujoco, simulate_in_mujoco, too_old_for
from drake_tc.exchange.projection import Projection, Vocabulary
from drake_tc.exchange.target_run import Runner, target_free_run
from drake_tc.exchange.targets import TARGETS
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.loops.joint_bench.rig_free_run import rig_free_run
from drake_tc.simulator_files.read import ANY_JOINT, read_joints
from drake_tc.simulator_files.terms import ReadJoint, Terms
from drake_tc.types import FloatArray

NO_FRICTION = MappingProxyType({"frictionloss": "Drake's parser does not use the friction of a joint"})
RUNS: Mapping[str, Runner] = MappingProxyType(
    {
        "mjcf": Runner("MuJoCo", simulate_in_mujoco, 1e-3, require_mujoco, too_old_for),
        "urdf": Runner("Drake's plant", simulate_urdf_in_drake, 2e-4, ignores=NO_FRICTION),
        "drake-urdf": Runner("Drake's plant", simulate_in_drake, 2e-4),
        "sdf": Runner("Drake's plant", simulate_sdf_in_drake, 2e-4, ignores=NO_FRICTION),
        "bam": Runner("BAM's equations", simulate_as_bam, 2e-4),
    }
)
"""Target, as on the command line, to what runs it. With 1 ms, the implicit servo of Drake's plant and BAM's integration
would err by some 0.2 % of the motion themselves."""


def run_errors(
    models: Mapping[str, ActuatorModel],
    projections: Sequence[Projection],
    target: str,
    rig: Rig,
    runs: Sequence[Run],
    into: Path | None,
) -> list[ExportErrors]:
    """One row a joint and run.

    Args:
        models: By joint.
        projections: Of these models.
        target: A key of `RUNS`.
        rig: Of the runs.
        runs: Held-out ones.
        into: The user's file; None: there is none.

    Raises:
        ParamsError: the target is not installed, or refuses the model; an unreadable file; a rig whose loads come from
            a robot's model.
    """
    runner = require_runner(target, rig)
    both = _terms_to_run(projections, target, into)

    def error(terms: Terms | None, joint: str, run: Run) -> float | None:
        if terms is None or runner.too_old(terms):
            return None
        return _rms(target_free_run(runner, models[joint], terms, rig, run))

    rows = []
    for run in runs:
        for joint, (exported, original) in both.items():
            ours = rig_free_run(models[joint], rig, joint, run)
            model = None if ours is None else _rms(ours[1:])
            rows.append(ExportErrors(joint, run.name, model, error(exported, joint, run), error(original, joint, run)))
    return rows


def run_notes(projections: Sequence[Projection], target: str, rig: Rig, into: Path | None) -> list[str]:
    """Sentences on what a run of the export does not have although the file has it, or on why it is not run.

    Args:
        projections: One a joint.
        target: A key of `RUNS`.
        rig: Of the runs.
        into: The user's file; None: there is none.
    """
    runner, lines = RUNS[target], []
    for joint, (exported, original) in _terms_to_run(projections, target, into).items():
        for what, terms in (("the export", exported), ("your file", original)):
            if terms is not None and (old := runner.too_old(terms)):
                lines.append(f"{joint}: {what} was not run: {old}.")
        lines += [
            f"{joint}: {why}: the runs are without it."
            for term, why in runner.ignores.items()
            if any(getattr(terms, term) for terms in (exported, original) if terms is not None)
        ]
        if not (TARGETS[target].has("armature") or exported.armature) and rig.load[joint] == "torque":
            lines.append(
                f"{joint}: the load is a recorded torque, so the run of the export has no inertia:"
                f" {TARGETS[target].name} has no rotor inertia."
            )
    return lines


def as_merged(projections: Sequence[Projection], target: str, into: Path | None) -> list[Projection]:
    """The projections as the file has them into which they were merged.

    A URDF or SDF file keeps the rotor inertia of Drake's tags, which the export does not write.

    Args:
        projections: One a joint.
        target: A key of `TARGETS`.
        into: The user's file; None: there is none.

    Raises:
        ParamsError: the file cannot be read.
    """
    if into is None or TARGETS[target].has("armature"):
        return list(projections)
    before = read_joints(into, ParamsError)
    inertias = {name: joint.terms.armature for name, joint in before.items()}
    return [replace(each, terms=replace(each.terms, armature=inertias.get(each.joint, 0.0))) for each in projections]


def require_runner(target: str, rig: Rig) -> Runner:
    """What runs an export of the models of a rig.

    Args:
        target: A key of `RUNS`.
        rig: Of the runs.

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


def _terms_to_run(
    projections: Sequence[Projection], target: str, into: Path | None
) -> dict[str, tuple[Terms, Terms | None]]:
    """By joint the terms of the export and those of the user's file; None where the file's cannot be run."""
    before = {} if into is None else read_joints(into, ParamsError)
    found = {}
    for projection in projections:
        was = before.get(projection.joint, before.get(ANY_JOINT))
        original = None if was is None else _original(was, projection.terms, TARGETS[target])
        found[projection.joint] = projection.terms, original
    return found


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
