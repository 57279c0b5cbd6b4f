"""Notes on masses of links that a load imitates, for a robot with a fixed base whose links are known."""

from collections.abc import Sequence

from drake_tc.diagnosis.notes import LoadInAllRuns
from drake_tc.diagnosis.result.rig_result import SharedEffect
from drake_tc.estimation.robot_loads import RobotLogs
from drake_tc.robot.plant import make_plant


def link_notes(shared: Sequence[SharedEffect], logs: RobotLogs | None) -> tuple[LoadInAllRuns, ...]:
    """Which masses of links among `shared` may be loads.

    Gravity acts on a mass at a link's centre as on one beside it: a mass larger than the link's own is hardly an error
    of the file, but a tool or a load. An F/T sensor or an IMU tells these apart.

    Args:
        shared: Causes that no single joint owns.
        logs: The robot; None for a rig without one.
    """
    masses = [cause for cause in shared if cause.id == "link_mass"]
    if logs is None or not masses or not logs.robot.fixed_base or logs.reads_imu or logs.robot.force_torque:
        return ()
    plant = make_plant(logs.robot, 0.0, followers="free")
    whole = float(plant.CalcTotalMass(plant.CreateDefaultContext()))  # no arm carries more than itself
    notes = []
    for cause in masses:
        own, found = float(plant.GetBodyByName(cause.where).default_mass()), float(cause.parameters["mass"].value)
        notes += [LoadInAllRuns(cause.where, found, own)] if own < found < whole else []
    return tuple(notes)
