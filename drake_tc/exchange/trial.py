"""The export of a model, tried on recorded runs without writing a file."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.diagnosis.result.export_trial import ExportTrial
from drake_tc.exchange.account import sentences
from drake_tc.exchange.comparison import RUNS, run_errors, run_notes
from drake_tc.exchange.mjcf import to_mjcf
from drake_tc.exchange.mujoco_run import file_notes
from drake_tc.exchange.projection import project
from drake_tc.exchange.targets import TARGETS
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.plausible import derivative
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray


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
