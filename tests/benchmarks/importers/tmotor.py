"""AK80-9 actuator against a torque sensor (University of Michigan): the set with an independent torque.

The sensor's sign is opposite to the motor's torque. No position was logged, except in the ripple run, which has an
encoder of its own, and in the runs without a torque sensor. The scaling of the reported current was changed between
sessions, so a session is a rig. A row holds the sensor's torque of its own instant but the drive's reply to the row
before (in every log the torque matches the current of the next row best): current and speed are moved one row up, and
the last row is lost.
"""

from pathlib import Path

import numpy as np

from drake_tc.types import FloatArray
from tests.benchmarks.importers.files import find, floats, read_table, run_name, write_log, write_rig

JOINT = "actuator"
SESSIONS = {
    "early": ("sysid_test_1", "sysid_test_high_speed", "sysid_opposing_motor_2", "sysid_torque_rampup"),
    "new_current_calc": ("new_current_calc",),
    "lower_baud": ("lower_baud_not_stalled", "lower_baud_stall"),
    "final": ("sysid_final_trial5", "sysid_final_trial8", "sysid_final_trial9_compensation"),
    "ripple": ("ripple_trial_4_torque",),
    "free_running": ("current_chirp", "torque_step_1Nm"),
}
ANGLE_DELAY = 3.0
ANGLE_REDUCTION = 50.0
_NO_POSITION = "no position was logged"
LATE = "; current and speed moved one row (10 ms) up against the sensor"
_ENCODER = "position is the outer encoder's, whose clock starts about 3 s after the torque log's"


def _position(path: Path, time: FloatArray) -> dict[str, FloatArray]:
    """Column of the output angle (T,) [rad], NaN outside the encoder's time; none for a log without an encoder."""
    angle_file = path.with_name(path.name.replace("_torque", "_angle"))
    if angle_file == path or not angle_file.is_file():
        return {}
    table = np.loadtxt(angle_file, delimiter=",")
    clock = table[:, 0] + ANGLE_DELAY
    return {f"{JOINT}/position": np.interp(time, clock, table[:, 1] / ANGLE_REDUCTION, left=np.nan, right=np.nan)}


def _columns(path: Path, *, sensor: bool) -> dict[str, FloatArray]:
    table = read_table(path)
    if not sensor:
        return {
            "time": floats(table, "pi_time", path),
            f"{JOINT}/position": floats(table, "angle", path),
            f"{JOINT}/velocity": floats(table, "velocity", path),
            f"{JOINT}/current": floats(table, "current", path),
        }
    time = floats(table, "loop_time", path)[:-1]
    return {
        "time": time,
        **_position(path, time),
        f"{JOINT}/velocity": floats(table, "motor_measured_speed", path)[1:],
        f"{JOINT}/current": floats(table, "motor_measured_current", path)[1:],
        f"{JOINT}/torque": -floats(table, "adc_measured_torque", path)[:-1],
    }


def convert(src: Path, out: Path) -> tuple[Path, ...]:
    """Write one folder a session: `early`, `new_current_calc`, `lower_baud`, `final`, `ripple`, `free_running`.

    Raises:
        LogError: No such files in `src`, or one with other columns.
    """
    requested = [name for names in SESSIONS.values() for name in names]
    paths = {run_name(path): path for path in find(src, *(f"{name}.csv*" for name in requested))}
    rigs = []
    for session, names in SESSIONS.items():
        members = [name for name in names if name in paths]
        sensor = session != "free_running"
        for name in members:
            write_log(_columns(paths[name], sensor=sensor), out / session / f"{name}.parquet")
        if members:
            document = {
                "joint": JOINT,
                "drive": "current",
                "load": "torque" if sensor else "unknown",
                "units": {"position": "rad"} if session == "ripple" or not sensor else {"velocity": "rad/s"},
            }
            where = _ENCODER if session == "ripple" else _NO_POSITION if sensor else "no torque sensor in these runs"
            late = LATE if sensor else ""
            comment = f"AK80-9 on a torque bench, session {session}; current as reported in that session\n{where}{late}"
            rigs.append(write_rig(document, out / session / "rig.yaml", comment))
    return tuple(rigs)
