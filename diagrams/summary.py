"""What a simulation comes to: tracking by joint, faults by time, and the files that are written."""

from pathlib import Path
from typing import Any

import numpy as np
from drake_tc.diagrams.recording import Recording, log_columns, write_log, write_rig

from drake_tc.errors import LogError, ParamsError
from drake_tc.estimation.off_line import OffLineFilter, SensorLog, TorqueLog, estimate_log, wrench_bias
from drake_tc.estimation.torque_model import TorqueModel

SETTLED = 0.7
"""Tracking is judged from here on [s]: the guard has let go of the start."""


def summarise(recording: Recording) -> dict[str, Any]:
    """Tracking errors [rad], largest commanded torque of each joint [N m], and faults, as plain data."""
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
        "faults": _faults(recording),
    }


def _faults(recording: Recording) -> list[dict[str, Any]]:
    """Each flag that was up: its name, and when first."""
    if "flags" not in recording.signals:
        return []
    flags = recording["flags"] > 0.0
    return [
        {"name": name, "first": float(recording.time[int(np.argmax(flags[:, i]))])}
        for i, name in enumerate(recording.flag_names)
        if flags[:, i].any()
    ]


def estimated(recording: Recording, window: int = 41) -> TorqueLog:
    """Link-side torques and contact wrenches from the log's own sensors, without delay (EQUATIONS A2, A4).

    The F/T sensors are zeroed on the first tenth of the run, at most 0.5 s, when nothing touches the robot.

    Args:
        recording: The simulation.
        window: Of the filters [samples].

    Raises:
        LogError: a robot without IMU, or a log with lost samples, from which nothing can be estimated.
    """
    robot = recording.robot
    try:
        model = TorqueModel(robot, angular_acceleration="zero" if robot.fixed_base else "gyro")
    except ParamsError as error:
        raise LogError(f"torque column: {error}") from error
    period = float(recording.time[1] - recording.time[0])
    wrench = recording["force_torque"] if robot.force_torque else np.zeros((recording.time.size, 0))
    log = SensorLog(recording["encoder"], recording["imu"][:, :6], wrench, period)
    filters = OffLineFilter(window=window)
    bias = None
    if robot.force_torque:
        still = slice(round(0.05 / period), min(round(0.5 / period), recording.time.size // 10))
        bias = wrench_bias(model, log, still, filters) if still.stop > still.start else None
    return estimate_log(model, log, filters, bias)


def write_results(recording: Recording, folder: Path, ending: str) -> list[Path]:
    """Write `log.ENDING` and `rig.yaml`, which `close-loop` reads; lost samples leave the torque out.

    Args:
        recording: The simulation.
        folder: Made where it is not there.
        ending: csv, parquet or npz.

    Returns:
        The files.

    Raises:
        LogError: a file that cannot be written.
    """
    try:
        torque = estimated(recording).torque
    except LogError:
        torque = None
    log = write_log(log_columns(recording, torque), folder / f"log.{ending}")
    return [log, write_rig(recording, folder / "rig.yaml")]
