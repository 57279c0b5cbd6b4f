"""What a simulation comes to: tracking by joint, faults by time, and the files that are written."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.errors import LogError
from drake_tc.estimation.off_line import OffLineFilter, SensorLog, TorqueLog, estimate_log, wrench_bias
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.loops.recording import write_log, write_rig
from drake_tc.loops.torque.running import TorqueRecording, log_columns, rig_of
from drake_tc.robot.robot import Robot

SETTLED = 0.7
"""Tracking is evaluated from here on [s]: the guard has let go of the start."""
ZEROED = (0.05, 0.5)
"""The F/T sensors are zeroed within these times [s]."""


def summarise(recording: TorqueRecording) -> dict[str, Any]:
    """Tracking errors [rad], largest torque of each joint's drive [N m], and faults, as plain data.

    Errors are evaluated from `SETTLED` on, or over the second half of a run that is shorter than twice that.
    """
    late = recording.time >= min(SETTLED, 0.5 * recording.time[-1])
    error, torque = recording.tracking_error[late], np.abs(recording["actuation"])
    joints = [
        {
            "joint": joint,
            "rms_error": float(np.sqrt(np.mean(error[:, i] ** 2))),
            "max_error": float(np.abs(error[:, i]).max()),
            "max_torque": float(torque[:, i].max()),
        }
        for i, joint in enumerate(recording.robot.joints)
    ]
    return {
        "robot": recording.robot.name,
        "duration": float(recording.time[-1]),
        "real_time_factor": recording.real_time_factor,
        "joints": joints,
        "faults": recording.raised_flags(),
    }


def estimated(recording: TorqueRecording, window: int = 41) -> TorqueLog:
    """Link-side torques and contact wrenches from the log's own sensors, without delay.

    Source: Del Prete et al., 2016, Algorithm 1.

    The F/T sensors are zeroed between 0.05 s and a tenth of the run, at most 0.5 s, when nothing touches the robot; a
    run of less than half a second has no such span, and its F/T biases stay in. A robot without IMU is taken to have a
    base at rest.

    Args:
        recording: The simulation.
        window: Of the filters [samples].

    Raises:
        LogError: a log with lost samples, or one shorter than the window, from which nothing can be estimated.
        ParamsError: a floating robot without IMU, or a window that is no window.
    """
    robot, samples = recording.robot, recording.time.size
    if samples < window:
        raise LogError(f"torque column: expected at least {window} samples; the log has {samples}")
    model = _torque_model(robot)
    period = float(recording.time[1] - recording.time[0])
    wrench = recording["force_torque"] if robot.force_torque else np.zeros((samples, 0))
    log = SensorLog(recording["encoder"], recording["imu"][:, :6] if robot.imu else None, wrench, period)
    filters = OffLineFilter.of(window)
    still = slice(round(ZEROED[0] / period), min(round(ZEROED[1] / period), samples // 10))
    zero = robot.force_torque and still.stop > still.start
    return estimate_log(model, log, filters, wrench_bias(model, log, still, filters) if zero else None)


def _torque_model(robot: Robot) -> TorqueModel:
    if not robot.fixed_base:
        return TorqueModel(robot)
    return TorqueModel(robot, base="imu" if robot.imu else "fixed", angular_acceleration="zero")


def write_results(
    recording: TorqueRecording, folder: Path, ending: str, tell: Callable[[str], None] | None = None
) -> list[Path]:
    """Write `log.ENDING` and `rig.yaml`, which `close-loop` reads.

    A log with lost samples, or one too short, has no torque columns; its rig file then says that the load is unknown.

    Args:
        recording: The simulation.
        folder: Made where it is not there.
        ending: csv, parquet or npz.
        tell: Told why the torque is left out, where it is.

    Returns:
        The files.

    Raises:
        LogError: a file that cannot be written.
    """
    try:
        torque = estimated(recording).torque
    except LogError as error:
        torque = None
        if tell:
            tell(f"no torque columns in the log: {error}")
    log = write_log(log_columns(recording, torque), folder / f"log.{ending}")
    return [log, write_rig(rig_of(recording, torque=torque is not None), folder / "rig.yaml")]
