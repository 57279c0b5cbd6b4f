"""Notes on errors of links that something else imitates, for a robot with a fixed base whose links are known."""

from collections.abc import Sequence

from drake_tc.diagnosis.link_notes import LinkNote, LoadInAllRuns, ZeroOrCentre
from drake_tc.diagnosis.result.rig_result import SharedEffect
from drake_tc.estimation.robot_loads import RobotLogs
from drake_tc.robot.plant import make_plant
from drake_tc.robot.rigid_regressor import link_tree


def link_notes(shared: Sequence[SharedEffect], logs: RobotLogs | None) -> tuple[LinkNote, ...]:
    """What else may be behind the errors of links among `shared`.

    Gravity acts on a mass at a link's centre as on one beside it: a mass larger than the link's own is hardly an error
    of the file, but a tool or a load. A wrong zero of a joint turns the gravity of all that is beyond it, as a shift of
    the next link's centre does. An F/T sensor or an IMU tells these apart.

    Args:
        shared: Causes that no single joint owns.
        logs: The robot; None for a rig without one.
    """
    asked = [cause for cause in shared if cause.id in ("link_mass", "link_com")]
    if logs is None or not asked or not logs.robot.fixed_base or logs.reads_imu or logs.robot.force_torque:
        return ()
    plant = make_plant(logs.robot, 0.0)
    tree = link_tree(plant)
    whole = float(plant.CalcTotalMass(plant.CreateDefaultContext()))  # no arm carries more than itself
    notes: list[LinkNote] = []
    for cause in asked:
        body = plant.GetBodyByName(cause.where)
        if cause.id == "link_mass":
            own, found = float(body.default_mass()), float(cause.parameters["mass"].value)
            notes += [LoadInAllRuns(cause.where, found, own)] if own < found < whole else []
            continue
        welded = {each.name() for each in plant.GetBodiesWeldedTo(body)}
        mover = next((joint for link, joint in zip(tree.links, tree.joints, strict=True) if link in welded), None)
        notes += [] if mover is None else [ZeroOrCentre(cause.where, mover)]
    return tuple(notes)
