"""Motion and efforts of all joints at some instants of the runs, to hold assumptions on the set-up against."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from drake_tc.estimation.robot_loads import RobotLogs, filters_of, usable_stretches
from drake_tc.filtering.savitzky_golay import smooth
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

MOST_ROWS = 600
"""Of all runs together: errors that are looked for are far larger than the noise."""
STRETCH = 10
"""Rows of a part that follow each other."""


@dataclass(frozen=True, eq=False)
class SetUpRows:
    """All joints at T instants, in the order of the robot's joints, by the filters of the loads.

    Attributes:
        position, velocity, acceleration: (T, n) of the joints [rad or m], as recorded.
        effort: (T, n) in the unit of each drive; 0 of joints that are not the rig's.
        run: (T,) name of the run.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    effort: FloatArray
    run: NDArray[np.str_]

    def before(self, others: "SetUpRows") -> "SetUpRows":
        """These rows, and others after them."""
        names = [field.name for field in fields(self)]
        return SetUpRows(*(np.concatenate([getattr(each, name) for each in (self, others)]) for name in names))

    def part(self, number: int, parts: int) -> "SetUpRows":
        """One of so many parts of these rows: stretches of `STRETCH` rows, dealt in turn."""
        mine = (np.arange(len(self.run)) // STRETCH) % parts == number
        return SetUpRows(*(getattr(self, field.name)[mine] for field in fields(self)))


def set_up_rows(logs: RobotLogs, runs: Sequence[Run], rig: Rig) -> SetUpRows:
    """The rows of these runs, evenly spaced in time, without the ends of the filters' windows.

    Args:
        logs: The robot.
        runs: With the columns of all of its joints.
        rig: Names the efforts.
    """
    parts = [(run.name, part) for run in runs for part in _stretches(logs, run, rig)]
    step = max(1, sum(len(part) for _, part in parts) // MOST_ROWS)
    every = np.concatenate([part[::step] for _, part in parts])
    names = np.concatenate([np.full(len(part[::step]), name) for name, part in parts])
    position, velocity, acceleration, effort = np.moveaxis(every, 1, 0)
    return SetUpRows(position, velocity, acceleration, effort, names)


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
