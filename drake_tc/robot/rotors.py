"""What the drives of a robot add to its joints' inertia, as its files say."""

from drake_tc.actuation.model_file import models_of_joints
from drake_tc.robot.robot import Robot


def file_rotors(robot: Robot) -> dict[str, float]:
    """Reflected inertia of each joint's drive [kg m^2], as the robot's files say; 0 behind a spring or a gap.

    Raises:
        ParamsError: the actuator file cannot be read or has no model of a joint.
    """
    if robot.actuators is None:
        return dict(robot.rotor_inertia)
    models = models_of_joints(robot.actuators, robot.joints)
    return {joint: 0.0 if model.transmission_effects else model.inertia for joint, model in models.items()}
