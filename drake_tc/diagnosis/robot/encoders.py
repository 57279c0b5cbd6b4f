"""Encoders that come late: columns of their delays beside all others, and runs whose readings are moved in time."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.problem.columns import BalanceCoefficients
from drake_tc.diagnosis.robot.joints import RobotFit
from drake_tc.diagnosis.robot.runs import LONGEST_S, RobotRuns
from drake_tc.diagnosis.shared.causes import CauseColumns, Piece
from drake_tc.diagnosis.shared.timing import OwnMotion, late_encoder_columns
from drake_tc.estimation.robot_loads import RobotLogs
from drake_tc.logs.record import Run


def with_encoders(logs: RobotLogs, fit: RobotFit) -> RobotRuns:
    """The robot's runs with columns of late encoders beside all others; as they are where no encoder tells its delay.

    Gears that couple joints have their encoders at the motors, and a servo's effort holds the position: there a late
    encoder acts as viscous friction.

    Args:
        logs: The robot.
        fit: Its joints' declared models, which tell links, viscous friction and inertia.
    """
    runs = fit.runs
    if logs.links is None or runs.turns is not None or "position_servo" in runs.rig.drive.values():
        return runs
    own = {}
    for name, joint in fit.joints.items():
        rotor = joint.prepared.train.samples.signals.rotor_inertia
        found = BalanceCoefficients.of(joint.best.terms, joint.best.beta, rotor)
        own[name] = OwnMotion(found.viscous, found.inertia + rotor)
    pi = logs.links.nominal - fit.moved()[: logs.links.nominal.size]
    late = late_encoder_columns(logs, logs.links, [*runs.train, *runs.held], pi, own)
    return replace(runs, causes=_beside(runs.causes, late))


def _beside(first: CauseColumns, second: CauseColumns) -> CauseColumns:
    """Both sets of columns over the same stretches; delays are as long as a first order allows at most."""
    at = first.causes[-1].columns.stop
    moved = [
        replace(c, columns=slice(at + c.columns.start, at + c.columns.stop), possible=(0.0, LONGEST_S))
        for c in second.causes
    ]
    pieces = {
        run: tuple(
            Piece(a.time, np.concatenate([a.values, b.values], axis=2))
            for a, b in zip(made, second.pieces[run], strict=True)
        )
        for run, made in first.pieces.items()
    }
    return CauseColumns((*first.causes, *moved), first.joints, pieces)


def in_time(runs: Sequence[Run], joint: str, delay: float) -> list[Run]:
    """The runs with the readings of one encoder at the time at which they were taken, q_j(t + d).

    The end of each stretch, whose readings came after it, is not used.
    """
    out = []
    for run in runs:
        segment, moved = run.segment.copy(), {}
        names = [name for name in (f"{joint}/position", f"{joint}/velocity") if name in run.columns]
        for part in run.segments():
            segment[part][run.time[part] + delay > run.time[part][-1]] = -1
        for name in names:
            values = np.array(run.columns[name])
            for part in run.segments():
                values[part] = np.interp(run.time[part] + delay, run.time[part], run.columns[name][part])
            moved[name] = values
        out.append(replace(run, columns=dict(run.columns) | moved, segment=segment))
    return out
