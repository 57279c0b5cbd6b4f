"""The drive gain that the rig file's keys declare, directly or as what a data sheet or a firmware states.

    current drive      K = 1/(torque_constant gear_ratio)     [A/(N m)]
    position servo     K = 1/proportional_gain                [rad/(N m)]

of a servo whose law is  tau = proportional_gain (q_d - q) - derivative_gain qdot.
"""

from collections.abc import Mapping

from drake_tc.logs.rig_document.by_joint import values_by_joint
from drake_tc.logs.rig_document.document import DriveKind, RigDocument

STATED = ("drive_gain", "torque_constant", "gear_ratio", "proportional_gain", "derivative_gain")
"""Keys of numbers > 0, one for all joints or by joint, that say how strong a drive is."""
_ONLY_FOR: Mapping[str, DriveKind] = {
    "torque_constant": "current",
    "gear_ratio": "current",
    "proportional_gain": "position_servo",
    "derivative_gain": "position_servo",
}
_NEEDS: Mapping[str, tuple[str, ...]] = {
    "torque_constant": ("gear_ratio",),
    "gear_ratio": ("torque_constant",),
    "derivative_gain": ("proportional_gain", "drive_gain"),
}
_WHY: Mapping[str, str] = {
    "torque_constant": "the motor's torque times the gear ratio is the joint's torque; write gear_ratio: 1 for a "
    "direct drive",
    "gear_ratio": "the ratio alone does not say how strong the drive is",
    "derivative_gain": "without it the scale of the servo's torques is not known",
}


def declared_gains(read: RigDocument) -> tuple[dict[str, float], dict[str, float]]:
    """By joint: the declared drive gain K [effort/(N m)], and the servo's derivative gain [N m s/rad].

    Raises:
        ValueError: Keys that do not go together; begins with the key.
    """
    joints = read.joint_names
    stated = {key: values_by_joint(getattr(read, key), joints) for key in STATED}
    drives = values_by_joint(read.drive, joints)
    gains: dict[str, float] = {}
    derivative: dict[str, float] = {}
    for joint in joints:
        given = {key: float(values[joint]) for key, values in stated.items() if values[joint] is not None}
        _check(joint, drives[joint], given)
        if "drive_gain" in given:
            gains[joint] = given["drive_gain"]
        elif "torque_constant" in given:
            gains[joint] = 1.0 / (given["torque_constant"] * given["gear_ratio"])
        elif "proportional_gain" in given:
            gains[joint] = 1.0 / given["proportional_gain"]
        if "derivative_gain" in given:
            derivative[joint] = given["derivative_gain"]
    return gains, derivative


def _check(joint: str, drive: DriveKind, given: Mapping[str, float]) -> None:
    for key in given:
        if drive != _ONLY_FOR.get(key, drive):
            raise ValueError(f"{key}: it belongs to `drive: {_ONLY_FOR[key]}`; the drive of {joint} is {drive}")
        if key in _NEEDS and not set(_NEEDS[key]) & set(given):
            raise ValueError(f"{key}: expected {' or '.join(_NEEDS[key])} for {joint} too: {_WHY[key]}")
        if "drive_gain" in given and key in ("torque_constant", "proportional_gain"):
            raise ValueError(f"{key}: {joint} has drive_gain too, and both state the drive's gain; remove one of them")
