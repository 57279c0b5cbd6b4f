"""The causes that no single joint owns: their names, parameters, tolerances and columns over a rig's runs."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.problem.shared import cause_columns
from drake_tc.diagnosis.problem.shared.body_motion import (
    BodyMotion,
    Structure,
    body_motion,
    joint_is_prismatic,
    structure_of,
)
from drake_tc.diagnosis.problem.shared.payload import Payload, payload_of
from drake_tc.estimation.off_line import OffLineFilter, Row, smoothed
from drake_tc.estimation.robot_loads import RobotLogs, filters_of, usable_stretches
from drake_tc.filtering.savitzky_golay import smooth
from drake_tc.filtering.window_choice import Window
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.robot.link_parameters import UNITS, LinkModel
from drake_tc.robot.rigid_regressor import LINK_PARAMETERS
from drake_tc.types import BoolArray, FloatArray

GRID_SECONDS = 0.01
"""Columns of motion that has passed filters of nine times that width are computed this often and interpolated."""
COLUMN_WINDOWS = 3
"""Windows of the columns' motion over those of the torques."""

TITLES: Mapping[str, str] = {
    "link_mass": "mass of a link",
    "link_com": "centre of mass of a link",
    "encoder_offset": "encoder offset",
    "ft_bias": "bias of an F/T sensor",
    "ft_gain": "gain of an F/T sensor",
    "imu_bias": "bias of the IMU",
}
"""Causes that may be reported. Others are estimated along within their tolerances and never reported."""
AXES = ("x", "y", "z")
LINK_PARAMETERS_ID = "link_parameters"
"""All ten of a link whose parameters are fitted; never reported as a cause."""
PAYLOAD_ID = "payload_parameters"
"""All ten of what a link carries in one run; never reported as a cause."""


@dataclass(frozen=True)
class Cause:
    """One cause.

    Attributes:
        id: As in `TITLES`.
        where: Link, sensor or joint.
        parameters: Names. units: of each.
        columns: Its places among all columns.
        tolerance: (p,) standard deviations that its sensor's data sheet or owner gives the parameters; empty where
            nothing is known of them (a link's mass).
    """

    id: str
    where: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    columns: slice
    tolerance: tuple[float, ...] = ()

    @property
    def key(self) -> str:
        """`id` and `where` in one word."""
        return f"{self.id}@{self.where}"

    @property
    def scales(self) -> bool:
        """Whether its columns hold the noise of the torque estimate: they are made of the sensors' readings.

        A bias adds to the readings. The columns of a link come from motion that is smoothed more than the torques.
        """
        return self.id not in ("ft_bias", "imu_bias", "link_mass", "link_com", "encoder_offset")

    @property
    def may_scale(self) -> bool:
        """Whether it scales readings or the model, so that the drive gains follow it; a bias adds to them."""
        return self.id not in ("ft_bias", "imu_bias")

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.parameters)

    def physical(self, delta: FloatArray) -> FloatArray:
        """Reported parameters from delta (p,): what the sensor adds, or what the model lacks."""
        if self.id in ("link_mass", "link_com", LINK_PARAMETERS_ID, PAYLOAD_ID):
            return np.asarray(-delta)
        if self.id in ("ft_gain", "imu_gain"):
            return np.asarray(delta / (1.0 - delta))
        return np.asarray(delta)


@dataclass(frozen=True, eq=False)
class Piece:
    """Columns over one stretch of a run: time (G,) since the start of the run [s] and values (G, n, P)."""

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
        """(T, P) at times since the start of a run [s]; 0 outside its usable stretches."""
        j = self.joints.index(joint)
        width = self.causes[-1].columns.stop
        out = np.zeros((time.size, width))
        for piece in self.pieces[run]:
            inside = (time >= piece.time[0] - 1e-9) & (time <= piece.time[-1] + GRID_SECONDS)
            for column in range(width):
                out[inside, column] = np.interp(time[inside], piece.time, piece.values[:, j, column])
        return out


def list_causes(logs: RobotLogs, structure: Structure, rig: Rig) -> tuple[Cause, ...]:
    """Every cause that this robot's torques can have, with the rig's tolerances."""
    found: list[Cause] = []

    def add(name: str, where: str, parts: Sequence[tuple[str, str]], tolerance: Sequence[float] = ()) -> None:
        first = found[-1].columns.stop if found else 0
        names, units = zip(*parts, strict=True)
        found.append(Cause(name, where, names, units, slice(first, first + len(parts)), tuple(tolerance)))

    load = next(iter(rig.load.values()))
    if logs.links is not None and isinstance(load, RobotLoad):
        spread = logs.links.deviations(load.tolerance).reshape(-1, len(UNITS))
        for name, each in zip(logs.links.tree.links, spread, strict=True):
            add(LINK_PARAMETERS_ID, name, list(zip(LINK_PARAMETERS, UNITS, strict=True)), each.tolist())
        for run in load.payload:
            spread_of = logs.links.payload_deviations.tolist()
            add(PAYLOAD_ID, run, list(zip(LINK_PARAMETERS, UNITS, strict=True)), spread_of)
        return tuple(found)
    for link in structure.links:
        add("link_mass", link.name, [("mass", "kg")])
    for link in structure.links:
        add("link_com", link.name, [(f"com_{a}", "m") for a in AXES])
    if _encoders_alone(logs):
        for joint, slides in zip(logs.robot.joints, joint_is_prismatic(logs.model), strict=True):
            offset = rig.joint_sensors(joint).encoder_offset
            add("encoder_offset", joint, [("offset", "m" if slides else "rad")], [offset] if offset else ())
    turns = [(f"turn_{a}", "rad") for a in AXES]
    for mount in logs.robot.force_torque:
        known = rig.force_torque_tolerance(mount.name)
        biases = [(f"force_{a}", "N") for a in AXES] + [(f"torque_{a}", "N*m") for a in AXES]
        add("ft_bias", mount.name, biases, [known.force_bias] * 3 + [known.torque_bias] * 3)
        add("ft_gain", mount.name, [("force", "-"), ("torque", "-")], [known.gain] * 2)
        add("ft_alignment", mount.name, turns, [known.alignment] * 3)
    if logs.reads_imu:
        name = logs.robot.imu[0].name
        imu = rig.imu_tolerance(name)
        biases = [(f"accel_{a}", "m/s^2") for a in AXES] + [(f"gyro_{a}", "rad/s") for a in AXES]
        add("imu_bias", name, biases, [imu.accel_bias] * 3 + [imu.gyro_bias] * 3)
        add("imu_gain", name, [("accel", "-")], [imu.gain])
        add("imu_alignment", name, turns, [imu.alignment] * 3)
    return tuple(found)


def columns_over(logs: RobotLogs, runs: Sequence[Run], rig: Rig) -> CauseColumns:
    """The causes' columns over runs that have the sensors' columns."""
    structure = structure_of(logs.model)
    slides = joint_is_prismatic(logs.model)
    if logs.links is not None:
        payload = payload_of(rig, [run.name for run in runs], logs.links)
        made = {run.name: _link_pieces(logs, logs.links, run, payload) for run in runs}
        return CauseColumns(list_causes(logs, structure, rig), logs.robot.joints, made)
    pieces = {}
    for run in runs:
        filters = filters_of(logs, run)
        parts = usable_stretches(run, filters)
        pieces[run.name] = tuple(_piece(logs, structure, slides, run, part, filters) for part in parts)
    return CauseColumns(list_causes(logs, structure, rig), logs.robot.joints, pieces)


def _encoders_alone(logs: RobotLogs) -> bool:
    """Whether the loads are made of the joints' positions alone: other sensors would show a wrong encoder too."""
    return logs.robot.fixed_base and not logs.reads_imu and not logs.robot.force_torque


def _link_pieces(logs: RobotLogs, links: LinkModel, run: Run, payload: Payload) -> tuple[Piece, ...]:
    """Columns of all links' parameters, and of what one of them carries in some runs.

    At every sample: a play that is crossed within milliseconds makes accelerations that a coarser grid would alias.
    """
    pieces = []
    for time, q, v, vdot in smoothed_motion(logs, run):
        columns = links.columns(q, v, vdot)
        values = logs.at_motors(np.concatenate([columns, payload.columns(columns, run.name)], axis=2))
        pieces.append(Piece(time, values))
    return tuple(pieces)


def smoothed_motion(logs: RobotLogs, run: Run) -> Iterator[tuple[FloatArray, FloatArray, FloatArray, FloatArray]]:
    """Of each usable stretch of a run: time since its start (T,), q, v, vdot (T, n) by the filters of the loads."""
    filters = filters_of(logs, run)
    for part in usable_stretches(run, filters):
        q, v, vdot, *_ = smoothed(logs.model, logs.sensors(run, part), filters, None)
        yield run.time[part] - run.time[0], q, v, vdot


def column_filter(filters: OffLineFilter, samples: int) -> OffLineFilter:
    """The filter of the columns' motion: windows three times as long as those of the torques, where the log allows.

    A cause's column times its small parameter does not need the torques' bandwidth. Noise that the column shares with
    the torque, though, would act as an error in variables: gyro and accelerometer noise drew a link's mass by 1 to 5 %.
    """

    def wider(narrow: Window) -> Window:
        widest = samples - 1 + samples % 2
        return Window(min(COLUMN_WINDOWS * (narrow.samples - 1) + 1, widest), narrow.order)

    return OffLineFilter(wider(filters.encoder), wider(filters.inertial), wider(filters.wrench))


def _piece(
    logs: RobotLogs, structure: Structure, slides: BoolArray, run: Run, part: slice, filters: OffLineFilter
) -> Piece:
    sensors = logs.sensors(run, part)
    every = max(1, round(GRID_SECONDS / run.period))
    wide = column_filter(filters, len(sensors.position))
    rows = list(zip(*(each[::every] for each in smoothed(logs.model, sensors, wide, None)), strict=True))
    motion = body_motion(logs.model, structure, rows)
    blocks = [cause_columns.mass_column(motion, link, i, slides) for i, link in enumerate(structure.links)]
    blocks += [cause_columns.com_columns(motion, link, i, slides) for i, link in enumerate(structure.links)]
    if _encoders_alone(logs):
        blocks.append(cause_columns.encoder_columns(logs.model, rows))
    wrench = smooth(sensors.wrench, filters.wrench.samples, filters.wrench.order, sensors.dt).value[::every]
    for k in range(len(logs.robot.force_torque)):
        reading, own = cause_columns.reading_columns(motion, structure, k, slides), wrench[:, 6 * k : 6 * k + 6]
        blocks += [reading, cause_columns.gain_columns(reading, own), cause_columns.alignment_columns(reading, own)]
    if logs.reads_imu:
        blocks += _imu(logs, structure, slides, rows, motion)
    return Piece((run.time[part] - run.time[0])[::every], logs.at_motors(np.concatenate(blocks, axis=2)))


def _imu(
    logs: RobotLogs, structure: Structure, slides: BoolArray, rows: Sequence[Row], motion: BodyMotion
) -> list[FloatArray]:
    """Columns of the IMU's biases, of the accelerometer's gain and of the IMU's alignment."""

    def after(change: Callable[[FloatArray, Row], Row]) -> Callable[[FloatArray], BodyMotion]:
        def at(size: FloatArray) -> BodyMotion:
            if not size.any():
                return motion
            return body_motion(logs.model, structure, [change(size, row) for row in rows])

        return at

    def shifted(offset: FloatArray, row: Row) -> Row:
        q, v, a, imu, rate, wrench = row
        return q, v, a, imu + np.concatenate([offset, np.zeros(3)]), rate, wrench

    def turned(angle: FloatArray, row: Row) -> Row:
        q, v, a, imu, rate, wrench = row
        more = [imu[:3] + np.cross(angle, imu[:3]), imu[3:] + np.cross(angle, imu[3:])]
        return q, v, a, np.concatenate(more), rate + np.cross(angle, rate), wrench

    accel = cause_columns.accelerometer_columns(motion, structure, slides)
    gyro = cause_columns.gyro_columns(after(shifted), structure, slides)
    felt = np.array([row[3][3:] for row in rows])
    gain = np.einsum("tjp,tp->tj", accel, felt)[:, :, None]
    return [accel, gyro, gain, cause_columns.gyro_columns(after(turned), structure, slides)]
