"""What a plot of a run shows over time: tracking, torques, and the flags that were up."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from drake_tc.loops.recording import Recording
from drake_tc.loops.series_elastic.loop import SeaRecording
from drake_tc.loops.torque.running import TorqueRecording
from drake_tc.loops.whole_body.running import TsidRecording, task_errors
from drake_tc.robot.plant import joint_limits
from drake_tc.tsid.law import Status
from drake_tc.types import BoolArray, FloatArray

EVERY = 10
"""Ticks between two points of a task's error."""


@dataclass(frozen=True, eq=False)
class TimePanel:
    """Lines over time in one frame.

    Attributes:
        title: Of the frame.
        unit: Of the values.
        time: (T,) [s].
        lines: Name to values (T,).
        dashed: Name to values (T,) of what the line of that name should be.
    """

    title: str
    unit: str
    time: FloatArray
    lines: Mapping[str, FloatArray]
    dashed: Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False)
class RunPlot:
    """One page of a run.

    Attributes:
        title: What was run.
        panels: From the top to the bottom.
        time: (T,) of the flags [s].
        flags: Name to (T,) whether it was up, of those that were up at all.
    """

    title: str
    panels: tuple[TimePanel, ...]
    time: FloatArray
    flags: Mapping[str, BoolArray]


def torque_plot(recording: TorqueRecording) -> RunPlot:
    """Positions and their references, tracking errors, and torques of the drives, by joint."""
    joints, time = recording.robot.joints, recording.time
    reference = recording["reference"][:, : recording.size]
    return RunPlot(
        recording.robot.name,
        (
            _panel("position (dashed: reference)", "rad", time, joints, recording.position, reference),
            _panel("tracking error", "mrad", time, joints, 1e3 * recording.tracking_error),
            _panel("torque of the drives", "N m", time, joints, recording["actuation"]),
        ),
        time,
        _flags(recording),
    )


def tsid_plot(recording: TsidRecording) -> RunPlot:
    """Errors of the tasks, torques as a share of their limits, and the probability that all limits are kept."""
    robot, time = recording.law.model.robot, recording.time
    errors = task_errors(recording, EVERY)
    share = 100.0 * recording["torque"] / joint_limits(robot).effort
    return RunPlot(
        robot.name,
        (
            TimePanel(
                "error of the tasks",
                "mm",
                time[::EVERY],
                {name: 1e3 * np.linalg.norm(error, axis=1) for name, error in errors.items()},
                {},
            ),
            _panel("torque over its limit", "%", time, robot.joints, share),
            TimePanel("probability that all limits are kept", "-", time, {"p_ind": recording.status(Status.P_IND)}, {}),
        ),
        time,
        _flags(recording) | {"fallback": recording.status(Status.FALLBACK) > 0.0},
    )


def sea_plot(recording: SeaRecording) -> RunPlot:
    """Torque of the spring and its reference, the error, and the voltage."""
    joint, time = recording.scenario.joint, recording.time
    return RunPlot(
        joint,
        (
            TimePanel(
                "torque of the spring (dashed: reference)",
                "N m",
                time,
                {joint: recording["spring_torque"]},
                {joint: recording["reference_torque"]},
            ),
            TimePanel("torque error", "N m", time, {joint: recording.torque_error}, {}),
            TimePanel("voltage", "V", time, {joint: recording["voltage"]}, {}),
        ),
        time,
        _flags(recording),
    )


def _panel(
    title: str,
    unit: str,
    time: FloatArray,
    names: tuple[str, ...],
    values: FloatArray,
    dashed: FloatArray | None = None,
) -> TimePanel:
    lines = {name: values[:, i] for i, name in enumerate(names)}
    return TimePanel(title, unit, time, lines, {} if dashed is None else {n: dashed[:, i] for i, n in enumerate(names)})


def _flags(recording: Recording) -> dict[str, BoolArray]:
    if not recording.flag_names or "flags" not in recording.signals:
        return {}
    up = recording.signals["flags"] > 0.0
    return {name: up[:, i] for i, name in enumerate(recording.flag_names) if up[:, i].any()}
