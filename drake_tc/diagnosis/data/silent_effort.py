"""Efforts that a drive reports as nothing while its joint moves."""

import numpy as np

from drake_tc.diagnosis.data.channels import Channels
from drake_tc.diagnosis.notes import SilentEffort
from drake_tc.types import BoolArray, FloatArray

SILENT = 0.3
"""Share of the samples in motion, from which on exact zeros are no coincidence of a current that changes its sign."""


def silent_effort(channels: Channels, column: str, effort: FloatArray, moving: BoolArray) -> tuple[SilentEffort, ...]:
    """A note on each run whose effort is exactly 0 in much of the motion: the drive's report has a dead zone.

    Args:
        channels: Of the joint.
        column: Of the effort, `<joint>/current` or `<joint>/torque_command`; other efforts may be 0 while it coasts.
        effort: (T,) as recorded.
        moving: (T,) where the joint resolvably moves.
    """
    if column.rpartition("/")[2] not in ("current", "torque_command"):
        return ()
    out = []
    for index in np.unique(channels.run_of_sample[moving]):
        own = moving & (channels.run_of_sample == index)
        share = float(np.mean(effort[own] == 0.0))
        if share >= SILENT:
            name = next(run.name for i, run, _ in channels.pieces if i == index)
            out.append(SilentEffort(name, column, share))
    return tuple(out)
