"""Motion and efforts of all joints at some instants of the runs, to hold assumptions on the set-up against."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.estimation.robot_loads import RobotLogs, filters_of, usable_stretches
from drake_tc.filtering.savitzky_golay import smooth
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

MOST_ROWS = 600
"""Of all runs together: errors that are looked for are far larger than the noise."""


@dataclass(frozen=True, eq=False)
class SetUpRows:
    """All joints at T instants, in the order of the robot's joints, by the filters of the loads.

    Attributes:
        position, velocity, acceleration: (T, n) of the joints [rad or m], as recorded.
        effort: (T, n) in the unit of each drive; 0 of joints that are not the rig's.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    effort: FloatArray


def set_up_rows(logs: RobotLogs, runs: Sequence[Run], rig: Rig) -> SetUpRows:
    """The rows of these runs, evenly spaced in time, without the ends of the filters' windows.

    Args:
        logs: The robot.
        runs: With the columns of all of its joints.
        rig: Names the efforts.
    """
    parts = [part for run in runs for part in _stretches(logs, run, rig)]
    step = max(1, sum(len(part) for part in parts) // MOST_ROWS)
    every = np.concatenate([part[::step] for part in parts])
    return SetUpRows(*np.moveaxis(every, 1, 0))


def _stretches(logs: RobotLogs, run: Run, rig: Rig) -> list[FloatArray]:
    """Of each usable stretch (T, 4, n): position, velocity, acceleration and effort."""
    filters = filters_of(logs, run)
    window, edge = filters.encoder, filters.longest // 2
    found = []
    for part in usable_stretches(run, filters):
        motion = smooth(logs.sensors(run, part).position, window.samples, window.order, run.period)
        effort = np.column_stack([_effort(run, rig, joint)[part] for joint in logs.robot.joints])
        felt = smooth(effort, window.samples, window.order, run.period).value
        every = np.stack([motion.value, motion.first_derivative, motion.second_derivative, felt], axis=1)
        found.append(every[edge : len(every) - edge])
    return found


def _effort(run: Run, rig: Rig, joint: str) -> FloatArray:
    if joint not in rig.joints:
        return np.zeros(len(run))
    command = run.columns[rig.command_column(joint)]
    return command - run.columns[f"{joint}/position"] if rig.drive[joint] == "position_servo" else command
