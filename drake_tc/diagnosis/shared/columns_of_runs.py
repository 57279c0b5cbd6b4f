"""The columns of a robot's causes over its runs, what a link carries in some of them, and loads without the causes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.config.quoted import did_you_mean
from drake_tc.diagnosis.shared import cause_columns
from drake_tc.diagnosis.shared.body_motion import (
    BodyMotion,
    Structure,
    body_motion,
    joint_is_prismatic,
    structure_of,
)
from drake_tc.diagnosis.shared.causes import GRID_SECONDS, CauseColumns, Piece, encoders_alone, list_causes
from drake_tc.errors import RigError
from drake_tc.estimation.off_line import OffLineFilter, Row, smoothed
from drake_tc.estimation.robot_loads import RobotLogs, filters_of, smoothed_motion, usable_stretches
from drake_tc.filtering.savitzky_golay import Window
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.robot.rigid_regressor import LINK_PARAMETERS, LinkModel, link_model
from drake_tc.types import BoolArray, FloatArray, IntArray

COLUMN_WINDOWS = 3
"""Windows of the columns' motion over those of the torques."""


@dataclass(frozen=True)
class Payload:
    """An unknown load.

    Attributes:
        runs: Names of the logs in which it is carried; one load for each.
        link: Number of the link that carries it, in the order of the tree.
    """

    runs: tuple[str, ...]
    link: int

    def columns(self, links: FloatArray, run: str) -> FloatArray:
        """Columns (T, n, 10 m) of the m loads in one run, of all links' (T, n, 10 n): 0 of other runs' loads."""
        size = len(LINK_PARAMETERS)
        own = links[:, :, size * self.link : size * (self.link + 1)]
        parts = [own if run == name else np.zeros_like(own) for name in self.runs]
        return np.concatenate([links[:, :, :0], *parts], axis=2)


def columns_over(
    logs: RobotLogs, runs: Sequence[Run], rig: Rig, offsets: Mapping[str, float] | None = None
) -> CauseColumns:
    """The causes' columns over runs that have the sensors' columns.

    Args:
        logs: The robot.
        runs: With its sensors.
        rig: With a `RobotLoad`.
        offsets: Of encoders by joint, as far as they are known: their columns are then those of this offset, not of a
            small one [rad, m].
    """
    structure = structure_of(logs.model)
    slides = joint_is_prismatic(logs.model)
    if logs.links is not None:
        payload = payload_of(rig, [run.name for run in runs], logs.links)
        made = {run.name: _link_pieces(logs, logs.links, run, payload) for run in runs}
        return CauseColumns(list_causes(logs, structure, rig), logs.robot.joints, made)
    pieces = {}
    known = np.array([(offsets or {}).get(joint, 0.0) for joint in logs.robot.joints])
    for run in runs:
        filters = filters_of(logs, run)
        parts = usable_stretches(run, filters)
        pieces[run.name] = tuple(_piece(logs, structure, slides, run, part, filters, known) for part in parts)
    return CauseColumns(list_causes(logs, structure, rig), logs.robot.joints, pieces)


def _link_pieces(logs: RobotLogs, links: LinkModel, run: Run, payload: Payload) -> tuple[Piece, ...]:
    """Columns of all links' parameters, and of what one of them carries in some runs.

    At every sample: a play that is crossed within milliseconds makes accelerations that a coarser grid would alias.
    """
    pieces = []
    for part, q, v, vdot in smoothed_motion(logs, run):
        columns = links.columns(q, v, vdot)
        values = logs.at_motors(np.concatenate([columns, payload.columns(columns, run.name)], axis=2))
        pieces.append(Piece(run.time[part] - run.time[0], values))
    return tuple(pieces)


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
    logs: RobotLogs,
    structure: Structure,
    slides: BoolArray,
    run: Run,
    part: slice,
    filters: OffLineFilter,
    offsets: FloatArray,
) -> Piece:
    sensors = logs.sensors(run, part)
    every = max(1, round(GRID_SECONDS / run.period))
    wide = column_filter(filters, len(sensors.position))
    rows = list(zip(*(each[::every] for each in smoothed(logs.model, sensors, wide, None)), strict=True))
    motion = body_motion(logs.model, structure, rows)
    blocks = [cause_columns.mass_column(motion, link, i, slides) for i, link in enumerate(structure.links)]
    blocks += [cause_columns.com_columns(motion, link, i, slides) for i, link in enumerate(structure.links)]
    if encoders_alone(logs):
        blocks += [cause_columns.encoder_columns(logs.model, rows, offsets), *_bodies(logs, rows)]
    for k in range(len(logs.robot.force_torque)):
        reading = cause_columns.reading_columns(motion, structure, k, slides)
        blocks += [reading, np.zeros((*reading.shape[:2], 2 + 3))]  # gains and alignment follow from the readings
    if logs.reads_imu:
        blocks += _imu(logs, structure, slides, rows, motion)
    time = run.time[part] - run.time[0]
    return Piece(time[::every], logs.at_motors(np.concatenate(blocks, axis=2)), time, sensors.wrench)


def _bodies(logs: RobotLogs, rows: Sequence[Row]) -> list[FloatArray]:
    """(T, n, 10) parameters of what each outermost link may carry, and (T, n, 6) inertias of all links."""
    links = link_model(logs.robot)
    q, v, vdot = (np.array(each) for each in list(zip(*rows, strict=True))[:3])
    columns = links.columns(q, v, vdot)
    size = len(LINK_PARAMETERS)
    starts = (size * links.tree.links.index(name) for name in links.outermost)
    carried = [columns[:, :, start : start + size] for start in starts]
    return [*carried, *(columns[:, :, start + 4 : start + size] for start in range(0, columns.shape[2], size))]


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


def payload_of(rig: Rig, runs: Sequence[str], links: LinkModel) -> Payload:
    """The unknown load that a rig file declares.

    Raises:
        RigError: A log is not among the runs, the robot's joints move no link of that name, or the rig file names no
            link and the robot has several outermost ones.
    """
    load = next(iter(rig.load.values()))
    if not isinstance(load, RobotLoad) or not load.payload:
        return Payload((), 0)
    source, known = rig.source or "rig", links.tree.links
    for name in load.payload:
        if name not in runs:
            raise RigError(
                f"{source}: load: unknown_payload: no log {name!r}{did_you_mean(name, runs)}; logs: {', '.join(runs)}"
            )
    if not load.carrier and len(links.outermost) > 1:
        raise RigError(
            f"{source}: load: payload_link: the robot has several outermost links ({', '.join(links.outermost)}); name "
            "the one that carries the unknown load"
        )
    carrier = load.carrier or links.outermost[0]
    if carrier not in known:
        raise RigError(
            f"{source}: load: payload_link: no joint of the robot moves a link {carrier!r}"
            f"{did_you_mean(carrier, known)}; "
            f"links: {', '.join(known)}"
        )
    return Payload(load.payload, known.index(carrier))


def corrected(
    runs: Sequence[Run], causes: CauseColumns, joints: Sequence[str], columns: IntArray, delta: FloatArray
) -> list[Run]:
    """The runs with tau_meas - C delta as torque, joint by joint."""
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
