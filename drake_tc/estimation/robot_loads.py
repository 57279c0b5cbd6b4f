"""Link-side torques of a rig's joints from the model of its robot: encoders, IMU and F/T sensors of a recorded run.

The motion's part passes the off-line filters; the F/T sensors' part is linear in their readings and takes these as they
are, so that whoever filters the torque afterwards filters them like every other channel (Del Prete et al., 2016,
Algorithm 1).

Joint torques with the links' inertial parameters of a model file, in place of those of the URDF.

Gears that couple joints: a motor that turns with more than its own joint.

Motor angles in joint units are q_m = R q, and by power balance the joints' torques are tau = R' tau_m. Friction, rotors
and drives act on the motors, so each joint's balance is written at its motor: position (R q)_j and load (R'^-1 tau)_j.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from drake_tc.actuation.model_file import load_model_file
from drake_tc.config.quoted import did_you_mean
from drake_tc.errors import LogError, ParamsError, RigError
from drake_tc.estimation.off_line import (
    OffLineFilter,
    SensorLog,
    chosen_filter,
    smoothed,
    torques_of_motion,
    wrench_bias,
)
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.filtering.savitzky_golay import savgol_weights
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.record import Run
from drake_tc.logs.rig import WRENCH_AXES, Rig
from drake_tc.robot.rigid_regressor import LINK_PARAMETERS, LinkModel, link_model
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.types import FloatArray

ACCELERATION = "smoothed_acceleration"
"""Last part of the column of a joint's acceleration from the filters of the links' columns, where these are fitted."""
TURNING = ("position", "position_command", "velocity", ACCELERATION)
"""Channels of a joint that turn with its motor."""


def motor_turns(coupled: Mapping[str, Mapping[str, float]], joints: Sequence[str]) -> FloatArray:
    """R (n, n).

    Args:
        coupled: By joint, turns of its motor for one turn of another joint, gear ratio taken out.
        joints: Names.

    Raises:
        RigError: R has no inverse: two motors turn alike.
    """
    turns = np.eye(len(joints))
    for joint, others in coupled.items():
        for other, share in others.items():
            turns[joints.index(joint), joints.index(other)] += share
    if np.linalg.cond(turns) > 1e8:
        raise RigError(f"coupled: {dict(coupled)!r}: expected motors whose angles tell all joints' positions")
    return turns


def motor_loads(turns: FloatArray, torque: FloatArray) -> FloatArray:
    """R'^-1 tau (T, n, ...) of joint torques tau (T, n, ...)."""
    return np.asarray(np.einsum("ji,tj...->ti...", np.linalg.inv(turns), torque))


def at_motors(turns: FloatArray, joints: Sequence[str], runs: Sequence[Run]) -> list[Run]:
    """The runs with the motors' positions, position commands and velocities in place of the joints'."""
    if (turns == np.eye(len(joints))).all():
        return list(runs)
    out = []
    for run in runs:
        changed: dict[str, FloatArray] = {}
        for name in TURNING:
            columns = [run.columns.get(f"{joint}/{name}") for joint in joints]
            for i, joint in enumerate(joints):
                parts = [(turns[i, j], columns[j]) for j in np.flatnonzero(turns[i])]
                if all(column is not None for _, column in parts):
                    changed[f"{joint}/{name}"] = np.sum([r * c for r, c in parts if c is not None], axis=0)
        out.append(replace(run, columns=dict(run.columns) | changed))
    return out


IMU_AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
LEAST_STRETCH = 40
"""Samples from which the filters can be chosen."""
MOST_LOOKED_AT = 60_000
"""Samples of a stretch from which they are chosen."""


@dataclass(frozen=True, eq=False)
class RobotLogs:
    """A rig's robot, ready to read its logs.

    Attributes:
        robot: Without F/T sensors where the rig asks for inverse dynamics.
        model: Its torque estimation.
        reads_imu: Whether the base's motion comes from the robot's first IMU.
        links: Of a robot whose links' parameters are fitted; None otherwise.
        turns: (n, n) of the motors, in the order of the robot's joints (`coupled_gears`); None: each with its joint.
        tares: Of the rig: begin and end of the stretch of every run in which an F/T sensor is zeroed [s], by its column
            name.
    """

    robot: Robot
    model: TorqueModel
    reads_imu: bool
    links: LinkModel | None = None
    tares: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    turns: FloatArray | None = None

    def at_motors(self, torque: FloatArray) -> FloatArray:
        """Loads (T, n, ...) of the motors from torques or columns (T, n, ...) of the joints."""
        return torque if self.turns is None else motor_loads(self.turns, torque)

    def sensors(self, run: Run, part: slice) -> SensorLog:
        """The readings of one stretch of a run."""
        joints = [f"{joint}/position" for joint in self.robot.joints]
        imu = [f"imu_{self.robot.imu[0].name}/{axis}" for axis in IMU_AXES] if self.reads_imu else []
        wrench = [f"ft_{mount.name}/{axis}" for mount in self.robot.force_torque for axis in WRENCH_AXES]
        position, inertial, felt = (_stacked(run, names, part) for names in (joints, imu, wrench))
        return SensorLog(position, inertial if self.reads_imu else None, felt, run.period)


def _stacked(run: Run, names: Sequence[str], part: slice) -> FloatArray:
    size = part.stop - part.start
    if not names:
        return np.zeros((size, 0))
    for name in names:
        if name not in run.columns:
            hint = did_you_mean(name, run.columns)
            raise LogError(
                f"{run.source or run.name}: no column with readings {name!r}, which the robot's model needs{hint};"
                f" map it in the rig file: columns: {{{name}: NAME_IN_FILE}}"
            )
    return np.stack([np.asarray(run.columns[name][part], dtype=np.float64) for name in names], axis=1)


def robot_logs(rig: Rig, runs: Sequence[Run]) -> RobotLogs | None:
    """The rig's robot, or None where no robot's model gives its loads.

    A welded robot whose logs hold no IMU is taken to stand as its file says.

    Raises:
        ParamsError: a robot file that cannot be read, or a floating robot without IMU.
    """
    load = next(iter(rig.load.values()))
    if not isinstance(load, RobotLoad) or rig.robot is None:
        return None
    robot = load_robot(rig.robot, found_links=False)
    turns = motor_turns(rig.coupled, robot.joints) if rig.coupled else None
    if load.method == "inverse_dynamics":
        robot = replace(robot, force_torque=())
    if load.fitted:
        robot = replace(robot, force_torque=(), imu=())
        links = link_model(robot)  # first, as it says what is wrong with a robot that floats
        return RobotLogs(robot, TorqueModel(robot, base="fixed"), reads_imu=False, links=links, turns=turns)
    first = f"imu_{robot.imu[0].name}/accel_x" if robot.imu else ""
    reads_imu = bool(robot.imu) and (not robot.fixed_base or all(first in run.columns for run in runs))
    if robot.fixed_base:
        model = TorqueModel(robot, base="imu" if reads_imu else "fixed", angular_acceleration="zero")
    else:
        model = TorqueModel(robot)
    return RobotLogs(robot, model, reads_imu, tares=rig.tares, turns=turns)


def filters_of(logs: RobotLogs, run: Run) -> OffLineFilter:
    """The off-line filters of a run, chosen from its longest stretch (`chosen_filter`).

    Raises:
        LogError: No stretch of `LEAST_STRETCH` samples, or a sensor that is missing.
    """
    longest = max(run.segments(), key=lambda part: part.stop - part.start, default=slice(0, 0))
    if longest.stop - longest.start < LEAST_STRETCH:
        raise LogError(
            f"{run.source or run.name}: expected a stretch of at least {LEAST_STRETCH} samples for the robot's torque "
            f"estimate; the longest has {longest.stop - longest.start}"
        )
    return chosen_filter(logs.sensors(run, slice(longest.start, min(longest.stop, longest.start + MOST_LOOKED_AT))))


def usable_stretches(run: Run, filters: OffLineFilter) -> Iterator[slice]:
    """Stretches that are longer than the filters' windows."""
    return (part for part in run.segments() if part.stop - part.start > filters.longest)


def tared(logs: RobotLogs, run: Run) -> Run:
    """The run without what its F/T sensors show while nothing touches the robot; see `wrench_bias`.

    Raises:
        LogError: The run has no usable stretch longer than the filters' windows in the time that the rig file states.
    """
    columns, notes, filters = dict(run.columns), [], None
    for index, mount in enumerate(logs.robot.force_torque):
        name = f"ft_{mount.name}"
        if name not in logs.tares:
            continue
        begin, end = logs.tares[name]
        filters = filters or filters_of(logs, run)
        since = run.time - run.time[0]
        parts = [
            slice(p.start + int(np.searchsorted(since[p], begin)), p.start + int(np.searchsorted(since[p], end)))
            for p in run.segments()
        ]
        part = max(parts, key=lambda p: p.stop - p.start)
        if part.stop - part.start <= filters.longest:
            raise LogError(
                f"{run.source or run.name}: sensors: {name}: tare: no usable stretch of more than "
                f"{filters.longest} samples between {begin:g} and {end:g} s"
            )
        bias = wrench_bias(logs.model, logs.sensors(run, part), slice(None), filters)
        mine = bias[6 * index : 6 * index + 6]
        for axis, value in zip(WRENCH_AXES, mine, strict=True):
            columns[f"{name}/{axis}"] = columns[f"{name}/{axis}"] - value
        shown = ", ".join(f"{value:.3g}" for value in mine)
        notes.append(f"Sensor {name} was zeroed between {begin:g} and {end:g} s: [{shown}] (N, N*m) were taken off.")
    return replace(run, columns=columns, notes=(*run.notes, *notes)) if notes else run


def with_robot_loads(
    logs: RobotLogs, runs: Sequence[Run], joints: Sequence[str], *, filter_wrenches: bool = False
) -> list[Run]:
    """The runs with `<joint>/torque` columns [N m] from the robot's model, in place of any that were recorded.

    Stretches that are shorter than the filters' windows are marked as not to be used. Where the links are fitted, the
    runs also have the joints' accelerations from the same filters, as `<joint>/smoothed_acceleration` [rad/s^2]:
    a rotor's inertia and a link's about the same axis would be told apart by their filters otherwise.

    Args:
        logs: The robot.
        runs: Runs on uniform clocks, with encoders, IMU and F/T sensors.
        joints: Of the rig; each one of the robot's.
        filter_wrenches: Filter the F/T sensors' readings too; for torques that nobody filters afterwards.

    Raises:
        LogError: a sensor that is missing, a joint that the robot does not have, or a log too short for the filters.
    """
    unknown = [joint for joint in joints if joint not in logs.robot.joints]
    if unknown:
        hint = did_you_mean(unknown[0], logs.robot.joints)
        raise LogError(f"joint {unknown[0]!r}: {logs.robot.source} drives {', '.join(logs.robot.joints)}{hint}")
    return [_with_loads(logs, tared(logs, run), joints, filter_wrenches=filter_wrenches) for run in runs]


def smoothed_motion(logs: RobotLogs, run: Run) -> Iterator[tuple[slice, FloatArray, FloatArray, FloatArray]]:
    """Of each usable stretch of a run: its rows, and q, v, vdot (T, n) by the filters of the loads."""
    filters = filters_of(logs, run)
    for part in usable_stretches(run, filters):
        q, v, vdot, *_ = smoothed(logs.model, logs.sensors(run, part), filters, None)
        yield part, q, v, vdot


def _with_loads(logs: RobotLogs, run: Run, joints: Sequence[str], *, filter_wrenches: bool) -> Run:
    filters = filters_of(logs, run)
    torque = np.full((len(run), len(logs.robot.joints)), np.nan)
    acceleration = torque.copy()
    segment = np.full(len(run), -1, dtype=np.int64)
    for part in usable_stretches(run, filters):
        torque[part], acceleration[part] = _torque(
            logs, logs.sensors(run, part), filters, filter_wrenches=filter_wrenches
        )
        segment[part] = run.segment[part]
    order = [logs.robot.joints.index(joint) for joint in joints]
    columns = dict(run.columns) | {f"{j}/torque": torque[:, i] for j, i in zip(joints, order, strict=True)}
    if logs.links is not None:
        columns |= {f"{j}/{ACCELERATION}": acceleration[:, i] for j, i in zip(joints, order, strict=True)}
    dropped = int(((run.segment >= 0) & (segment < 0)).sum())
    notes = (*run.notes, *logs.robot.unused)
    if dropped:
        notes += (f"{dropped} rows in stretches too short for the robot's torque estimate were left out.",)
    window = filters.encoder
    weights = None if logs.links is None else savgol_weights(window.samples, window.order, derivative=2, dt=run.period)
    return replace(run, columns=columns, segment=segment, notes=notes, acceleration_weights=weights)


def _torque(
    logs: RobotLogs, sensors: SensorLog, filters: OffLineFilter, *, filter_wrenches: bool
) -> tuple[FloatArray, FloatArray]:
    """The estimate with filtered motion and, unless they are to be filtered, raw wrenches; and the filtered
    accelerations; (T, n) each.
    """
    q, v, vdot, imu, rate, felt = smoothed(logs.model, sensors, filters, None)
    wrench = felt if filter_wrenches else sensors.wrench
    if not logs.model.num_sensors and not logs.model.uses_imu:
        return logs.at_motors(torques_of_motion(logs.model, q, v, vdot)), vdot
    torque = logs.model.estimate_log(q, v, vdot, imu, rate, wrench)[:, : logs.model.size]
    return logs.at_motors(torque), vdot


def fitted_links(path: Path | str, links: LinkModel) -> FloatArray:
    """Pi (10 n,) of a model file that `close-loop` wrote, in the order of `links.tree.parameters`.

    Raises:
        ParamsError: the file cannot be read, has no links, lacks one of the robot's or one of its parameters.
    """
    known = load_model_file(path).links
    if not known:
        raise ParamsError(
            f"{path}: links: expected the links' parameters, got none; close-loop writes them to model_after.yaml with "
            "`load: {robot: fitted}`"
        )
    return np.concatenate([_of_link(path, known.get(name, {}), name, list(known)) for name in links.tree.links])


def _of_link(path: Path | str, given: Mapping[str, object], name: str, known: Sequence[str]) -> FloatArray:
    """(10,) of one link."""
    if not given:
        raise ParamsError(
            f"{path}: links: no link {name!r}{did_you_mean(name, known)}; links there: {', '.join(known)}"
        )
    for parameter in LINK_PARAMETERS:
        value = given.get(parameter)
        if not isinstance(value, int | float) or not np.isfinite(value):
            raise ParamsError(f"{path}: links: {name}: {parameter}: expected a number, got {value!r}")
    return np.array([given[parameter] for parameter in LINK_PARAMETERS], dtype=np.float64)


def with_fitted_links(
    logs: RobotLogs, links: LinkModel, runs: Sequence[Run], joints: Sequence[str], parameters: FloatArray
) -> list[Run]:
    """The runs with tau + Y (pi - pi_0) as `<joint>/torque` [N m].

    Args:
        logs: The robot.
        links: Of its file, with pi_0.
        runs: With the torques of pi_0 (`with_robot_loads`).
        joints: Of the rig.
        parameters: pi (10 n,).
    """
    change = parameters - links.nominal
    out = []
    for run in runs:
        torque = {joint: run.columns[f"{joint}/torque"].copy() for joint in joints}
        for part, q, v, vdot in smoothed_motion(logs, run):
            more = logs.at_motors(links.columns(q, v, vdot) @ change)
            for joint, values in torque.items():
                values[part] += more[:, logs.robot.joints.index(joint)]
        columns = {f"{joint}/torque": values for joint, values in torque.items()}
        out.append(replace(run, columns=dict(run.columns) | columns))
    return out
