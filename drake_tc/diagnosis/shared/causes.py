"""The causes that no single joint owns: their names, parameters and columns over a rig's runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from drake_tc.diagnosis.shared import cause_columns
from drake_tc.diagnosis.shared.body_motion import BodyMotion, Structure, body_motion, joint_is_prismatic, structure_of
from drake_tc.estimation.off_line import Row, smoothed
from drake_tc.estimation.robot_loads import RobotLogs, off_line_filter, usable_stretches
from drake_tc.logs.record import Run
from drake_tc.types import BoolArray, FloatArray

GRID_SECONDS = 0.01
"""Columns are computed this often and interpolated: they have passed filters of three times that width."""

TITLES: Mapping[str, str] = {
    "link_mass": "mass of a link",
    "link_com": "centre of mass of a link",
    "ft_bias": "bias of an F/T sensor",
    "ft_gain": "gain of an F/T sensor",
    "imu_bias": "bias of the IMU",
}
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Cause:
    """One cause.

    Attributes:
        id: As in `TITLES`.
        where: Link or sensor.
        parameters: Names. units: of each.
        columns: Its places among all columns.
    """

    id: str
    where: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    columns: slice

    @property
    def key(self) -> str:
        """`id` and `where` in one word."""
        return f"{self.id}@{self.where}"

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.parameters)

    def physical(self, delta: FloatArray) -> FloatArray:
        """Reported parameters from delta (p,): what the sensor adds, or what the model lacks."""
        if self.id in ("link_mass", "link_com"):
            return np.asarray(-delta)
        if self.id == "ft_gain":
            return np.asarray(delta / (1.0 - delta))
        return np.asarray(delta)


@dataclass(frozen=True, eq=False)
class Piece:
    """Columns over one stretch of a run: time (G,) [s] and values (G, n, P)."""

    time: FloatArray
    values: FloatArray


@dataclass(frozen=True, eq=False)
class CauseColumns:
    """All causes' columns over a set of runs.

    Attributes:
        causes: In the order of the columns.
        joints: Of the columns, n.
        pieces: By run name.
    """

    causes: tuple[Cause, ...]
    joints: tuple[str, ...]
    pieces: Mapping[str, tuple[Piece, ...]]

    def of(self, run: str, joint: str, time: FloatArray) -> FloatArray:
        """(T, P) at times of a run; 0 outside its usable stretches."""
        j = self.joints.index(joint)
        width = self.causes[-1].columns.stop
        out = np.zeros((time.size, width))
        for piece in self.pieces[run]:
            inside = (time >= piece.time[0] - 1e-9) & (time <= piece.time[-1] + GRID_SECONDS)
            for column in range(width):
                out[inside, column] = np.interp(time[inside], piece.time, piece.values[:, j, column])
        return out


def list_causes(logs: RobotLogs, structure: Structure) -> tuple[Cause, ...]:
    """Every cause that this robot's torques can have."""
    found: list[Cause] = []

    def add(name: str, where: str, parameters: Sequence[str], units: Sequence[str]) -> None:
        first = found[-1].columns.stop if found else 0
        found.append(Cause(name, where, tuple(parameters), tuple(units), slice(first, first + len(parameters))))

    for link in structure.links:
        add("link_mass", link.name, ["mass"], ["kg"])
    for link in structure.links:
        add("link_com", link.name, [f"com_{a}" for a in AXES], ["m"] * 3)
    for mount in logs.robot.force_torque:
        names = [f"force_{a}" for a in AXES] + [f"torque_{a}" for a in AXES]
        add("ft_bias", mount.name, names, ["N"] * 3 + ["N*m"] * 3)
    for mount in logs.robot.force_torque:
        add("ft_gain", mount.name, ["force", "torque"], ["-"] * 2)
    if logs.reads_imu:
        names = [f"accel_{a}" for a in AXES] + [f"gyro_{a}" for a in AXES]
        add("imu_bias", logs.robot.imu[0].name, names, ["m/s^2"] * 3 + ["rad/s"] * 3)
    return tuple(found)


def columns_over(logs: RobotLogs, runs: Sequence[Run]) -> CauseColumns:
    """The causes' columns over runs that have the sensors' columns."""
    structure = structure_of(logs.model)
    slides = joint_is_prismatic(logs.model)
    pieces = {
        run.name: tuple(_piece(logs, structure, slides, run, part) for part in usable_stretches(run)) for run in runs
    }
    return CauseColumns(list_causes(logs, structure), logs.robot.joints, pieces)


def _piece(logs: RobotLogs, structure: Structure, slides: BoolArray, run: Run, part: slice) -> Piece:
    sensors = logs.sensors(run, part)
    every = max(1, round(GRID_SECONDS / run.period))
    rows = list(islice(smoothed(logs.model, sensors, off_line_filter(run.period), None), 0, None, every))
    motion = body_motion(logs.model, structure, rows)
    blocks = [cause_columns.mass_column(motion, link, i, slides) for i, link in enumerate(structure.links)]
    blocks += [cause_columns.com_columns(motion, link, i, slides) for i, link in enumerate(structure.links)]
    readings = [
        cause_columns.reading_columns(motion, structure, k, slides) for k in range(len(logs.robot.force_torque))
    ]
    wrench = np.array([row[5] for row in rows])
    blocks += readings
    blocks += [cause_columns.gain_columns(reading, wrench[:, 6 * k : 6 * k + 6]) for k, reading in enumerate(readings)]
    if logs.reads_imu:
        blocks.append(cause_columns.accelerometer_columns(motion, structure, slides))
        blocks.append(_gyro(logs, structure, slides, rows, motion))
    return Piece(run.time[part][::every], np.concatenate(blocks, axis=2))


def _gyro(
    logs: RobotLogs, structure: Structure, slides: BoolArray, rows: Sequence[Row], motion: BodyMotion
) -> FloatArray:
    def at(offset: FloatArray) -> BodyMotion:
        if not offset.any():
            return motion
        shift = np.concatenate([offset, np.zeros(3)])
        moved = [(q, v, a, imu + shift, rate, wrench) for q, v, a, imu, rate, wrench in rows]
        return body_motion(logs.model, structure, moved)

    return cause_columns.gyro_columns(at, structure, slides)
