"""Free runs of held-out logs: the identified model in Drake, its export in the target, and what the user's file had."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.diagnosis.result.export_trial import ExportErrors
from drake_tc.errors import ParamsError
from drake_tc.exchange.bam_run import simulate_as_bam
from drake_tc.exchange.drake_run import simulate_in_drake
from drake_tc.exchange.mujoco_run import require_mujoco, simulate_in_mujoco
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.target_run import Runner, target_free_run
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.loops.joint_bench.rig_free_run import rig_free_run
from drake_tc.simulator_files.read import ANY_JOINT, read_joints
from drake_tc.simulator_files.terms import ReadJoint
from drake_tc.types import FloatArray

RUNS: Mapping[str, Runner] = MappingProxyType(
    {
        "mjcf": Runner("MuJoCo", simulate_in_mujoco, 1e-3, require_mujoco),
        "drake-urdf": Runner("Drake's plant", simulate_in_drake, 2e-4),
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
    before = {} if into is None else read_joints(into, ParamsError)
    rows = []
    for run in runs:
        for projection in projections:
            joint, terms = projection.joint, projection.terms
            model = models[joint]
            ours = rig_free_run(model, rig, joint, run)
            was = before.get(joint, before.get(ANY_JOINT))
            rows.append(
                ExportErrors(
                    joint,
                    run.name,
                    None if ours is None else _rms(ours[1:]),
                    _rms(target_free_run(runner, model, terms, rig, run)),
                    _rms(target_free_run(runner, model, was.with_servo_damping(), rig, run))
                    if was is not None and _can_run(was, terms.drive)
                    else None,
                )
            )
    return rows


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


def _can_run(was: ReadJoint, drive: str) -> bool:
    """Whether the file's drive takes the recorded command, and its terms are all of its model."""
    return was.driven and was.terms.drive == drive and "load_dependent_friction" not in was.effects


def _rms(run: tuple[FloatArray, FloatArray] | None) -> float | None:
    return None if run is None else float(np.sqrt(np.mean((run[0] - run[1]) ** 2)))
