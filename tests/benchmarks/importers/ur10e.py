"""UR10e: excitation, joint-wise and point-to-point runs of a six-joint arm (Innopolis University), motor currents.

The gains are the controller's own: its torque over its current, both predicted by its rigid model, at standstill.
Joints 2 to 5 show them; joint 1 has the drive of joint 2, joint 6 that of joint 5. Two other published sets of gains
differ from them by -17 to +24 %, and the mass of a payload by them by -11 and +10 %. One run, `exc_0131_load`, carries
a load: `rig_load.yaml` reads the same logs and names that run as one with an unknown payload.
"""

from pathlib import Path

from tests.benchmarks.importers.files import FITTED_ROBOT, find, read_logs, read_text, write_log, write_rig, write_robot

TORQUE_PER_AMPERE = {
    "shoulder_pan_joint": 11.976,
    "shoulder_lift_joint": 11.976,
    "elbow_joint": 9.839,
    "wrist_1_joint": 10.763,
    "wrist_2_joint": 10.763,
    "wrist_3_joint": 10.763,
}
"""Joints in the order of the columns, and the controller's own constants at the joint [N m/A]."""
GAIN_TOLERANCE = 0.1
"""Standard deviation of the common relative error of these constants: the spread of the published sets."""
LOAD = {"robot": "fitted", "drive_gain_tolerance": GAIN_TOLERANCE}
LOADED_RUN = "exc_0131_load"
CHANNELS = {"q": "position", "qd": "velocity", "current": "current"}


def convert(src: Path, out: Path) -> tuple[Path, ...]:
    """Write one log a run, the robot, `rig.yaml` and, where the loaded run is there, `rig_load.yaml`.

    Raises:
        LogError: No runs or no URDF in `src`, or a file with other columns.
    """
    urdf = read_text(find(src, "ur10e.urdf*")[0])
    names = {
        f"{joint}/{name}": f"{key}_{number}"
        for number, joint in enumerate(TORQUE_PER_AMPERE, start=1)
        for key, name in CHANNELS.items()
    }
    runs = []
    for run, columns in read_logs(src, "*.csv*", names):
        runs.append(run)
        write_log(columns, out / f"{run}.parquet")
    write_robot(urdf, "ur10e", "base_link", tuple(TORQUE_PER_AMPERE), out)
    document = {
        **FITTED_ROBOT,
        "drive": "current",
        "load": LOAD,
        "declared": ["rotor_inertia", "asymmetric_friction"],
        "drive_gain": {joint: round(1.0 / constant, 6) for joint, constant in TORQUE_PER_AMPERE.items()},
    }
    head = "Six-joint arm, motor currents\ndrive_gain [A/(N m)]: the controller's own torque over current at standstill"
    rigs = [write_rig(document, out / "rig.yaml", head)]
    if LOADED_RUN in runs:
        loaded = document | {"load": LOAD | {"unknown_payload": [LOADED_RUN]}}
        rigs.append(write_rig(loaded, out / "rig_load.yaml", f"{head}\n{LOADED_RUN} carries a load at the flange"))
    return tuple(rigs)
