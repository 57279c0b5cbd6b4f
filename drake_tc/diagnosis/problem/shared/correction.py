"""Loads without what the shared causes add to them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.problem.shared.causes import CauseColumns
from drake_tc.logs.record import Run
from drake_tc.types import FloatArray, IntArray


def corrected(
    runs: Sequence[Run], causes: CauseColumns, joints: Sequence[str], columns: IntArray, delta: FloatArray
) -> list[Run]:
    """The runs with tau_meas - C delta as torque, joint by joint.

    Args:
        runs: With torque columns from the robot's model.
        causes: Columns over these runs.
        joints: Of the rig.
        columns: (p,) which of them. delta: (p,).
        delta: Their coefficients.
    """
    if columns.size == 0:
        return list(runs)
    out = []
    for run in runs:
        changed = {}
        for joint in joints:
            name = f"{joint}/torque"
            extra = causes.of(run.name, joint, run.time - run.time[0])[:, columns] @ delta
            changed[name] = np.asarray(run.columns[name] - extra)
        out.append(replace(run, columns=dict(run.columns) | changed))
    return out
