"""What a robot file may say. `load_robot` checks it against the URDF.

The sensors of a robot file: where IMUs and force/torque sensors sit.
"""

from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field, ValidationInfo, field_validator

from drake_tc.config.keys import (
    FileName,
    Flag,
    Keys,
    Name,
    Names,
    Number,
    NumberFromZero,
    PositiveUnboundedNumber,
    Triple,
    UnboundedNumber,
    key,
    saying,
    unknown_key,
)
from drake_tc.config.quoted import did_you_mean
from drake_tc.errors import ParamsError
from drake_tc.robot.fields import ForceTorqueMount, Mount, Pose
from drake_tc.robot.urdf_tree import LinkSplit, UrdfTree

_ZERO = "[0, 0, 0]"


class PoseKeys(Keys):
    """A place on a link, as in URDF."""

    xyz: Triple | None = key("Translation.", unit="m", example=[0.0, 0.0, 0.1], absent=_ZERO)
    rpy: Triple | None = key(
        "Roll, pitch and yaw about the fixed axes x, y and z.", unit="rad", example=[0.0, 1.5708, 0.0], absent=_ZERO
    )

    @property
    def pose(self) -> Pose:
        """The pose."""
        return Pose(self.xyz or (0.0, 0.0, 0.0), self.rpy or (0.0, 0.0, 0.0))


class FrameKeys(PoseKeys):
    """A frame on a link."""

    link: Name | None = key("The link.", example="foot", absent="the part beyond the sensor")


class SensorKeys(PoseKeys):
    """A sensor on a link or at a joint; the file gives one of `link` and `joint`."""

    link: Name | None = key("Link that carries the sensor.", example="torso", absent="that of `joint`")
    joint: Name | None = key("Joint whose child link carries the sensor.", example="neck", absent="`link` says it")

    @classmethod
    def check_together(cls, value: Mapping[str, object]) -> None:
        """One of `joint` and `link` is there."""
        if ("joint" in value) == ("link" in value):
            got = "both" if "joint" in value else "neither"
            raise ValueError(f"expected one of the keys 'joint' and 'link', got {got}")


class ImuSensorKeys(SensorKeys):
    """An IMU; the pose is that of its axes in the link."""


class ForceTorqueSensorKeys(SensorKeys):
    """A six-axis F/T sensor in a joint that does not move and carries all of the load, or inside a link.

    The pose is that of the sensor's axes in the joint's child link, or in the link.
    """

    mass_beyond: Annotated[float, Field(ge=0.0, le=1.0), saying("a share between 0 and 1")] | None = key(
        "Share of the link's mass that lies beyond a sensor inside the link.",
        unit="–",
        example=0.3,
        absent="required with `link`; not possible with `joint`",
    )
    contact: FrameKeys | None = key(
        "Frame that takes the external wrench of the part beyond the sensor.",
        example={"link": "foot", "xyz": [0.0, 0.0, -0.05]},
        absent="the frame of the part beyond the sensor",
    )

    @classmethod
    def check_together(cls, value: Mapping[str, object]) -> None:
        """`mass_beyond` goes with `link`."""
        super().check_together(value)
        if ("mass_beyond" in value) != ("link" in value):
            if "link" in value:
                raise ValueError("mass_beyond is missing; expected the share of the link's mass beyond the sensor")
            raise ValueError("mass_beyond: it belongs to `link`; the mass beyond a joint is in the URDF")


class LimitKeys(Keys):
    """Limits of a joint that replace those of the URDF."""

    effort: PositiveUnboundedNumber | None = key(
        "Largest torque or force.", unit="N·m or N", example=40.0, absent="the URDF's"
    )
    velocity: PositiveUnboundedNumber | None = key(
        "Largest speed.", unit="rad/s or m/s", example=6.0, absent="the URDF's"
    )
    lower: UnboundedNumber | None = key("Lowest position.", unit="rad or m", example=-1.5, absent="the URDF's")
    upper: UnboundedNumber | None = key("Highest position.", unit="rad or m", example=1.5, absent="the URDF's")


class RobotDocument(Keys):
    """What a robot file may say."""

    SCHEMA: ClassVar[str] = "robot"

    name: Name = key("Name of the robot.", example="leg", default=..., expected="a name")
    urdf: FileName = key(
        "The URDF: beside this file, or `package://NAME/path`, where NAME is looked for in `cmeel.prefix/share` of the "
        "Python environment and then in ROS_PACKAGE_PATH.",
        example="leg.urdf",
        default=...,
        expected="the name of a URDF",
    )
    base: Name = key(
        "Link that is welded to the world, or that floats.", example="waist", default=..., expected="the name of a link"
    )
    fixed_base: Flag = key(
        "Whether the base is welded to the world.", example=True, default=..., expected="true or false"
    )
    base_pose: PoseKeys | None = key(
        "Pose of the welded base in the world, or where a floating base starts.",
        example={"xyz": [0.0, 0.0, 1.0]},
        absent="where fixed joints from a link `world` of the URDF place the base, else at the origin",
    )
    joints: Names = key(
        "Driven joints, in the order of every vector of joints.",
        example=["hip", "knee"],
        default=...,
        expected="a list of names",
    )
    locked: dict[str, Number] | None = key(
        "By joint that is not driven: the position at which it is fixed.",
        unit="rad or m",
        example={"neck": 0.1},
        absent="0 or the nearest limit; a joint that mimics another one follows it, a driven one too",
    )
    imu: dict[str, ImuSensorKeys] | None = key(
        "IMUs by name.", example={"torso": {"link": "torso", "xyz": [0.0, 0.0, 0.15]}}, absent="none"
    )
    force_torque: dict[str, ForceTorqueSensorKeys] | None = key(
        "F/T sensors by name, in the order of their logs.", example={"ankle": {"joint": "ankle_ft"}}, absent="none"
    )
    actuators: FileName | None = key(
        "Actuator model file, relative to this file, such as the `model_after.yaml` of `close-loop`: masses and "
        "payloads of links that it found change the robot.",
        example="leg_actuators.yaml",
        absent="no actuator models",
    )
    rotor_inertia: dict[str, NumberFromZero] | None = key(
        "By joint, the rotor's inertia on the joint's side of the gear; only without `actuators`, whose file says it.",
        unit="kg m²",
        example={"knee": 0.3},
        absent="0",
    )
    limits: dict[str, LimitKeys] | None = key(
        "By joint, limits that replace the URDF's.", example={"knee": {"effort": 40.0}}, absent="the URDF's"
    )
    posture: dict[str, Number] | None = key(
        "By joint, the position at which it starts.",
        unit="rad or m",
        example={"knee": 0.87},
        absent="0 or the nearest limit",
    )

    @classmethod
    def check_together(cls, value: Mapping[str, object]) -> None:
        """Rotors are said once."""
        if value.get("rotor_inertia") and value.get("actuators") is not None:
            raise ValueError("rotor_inertia: it belongs to a robot without `actuators`, whose file says it, got both")

    @field_validator("rotor_inertia", "limits", "posture", mode="before")
    @classmethod
    def _of_joints(cls, value: object, info: ValidationInfo) -> object:
        joints: list[str] = info.data.get("joints") or []
        for name in value if isinstance(value, Mapping) and joints else ():
            if name not in joints:
                raise ValueError(unknown_key(name, joints))
        return value


def check_link(where: str, link: str, tree: UrdfTree) -> str:
    """The link's name.

    Raises:
        ParamsError: The URDF has no such link; with the nearest match.
    """
    if link not in tree.links:
        listed = f"links: {', '.join(tree.links)}"
        raise ParamsError(f"{where}: no link {link!r} in the URDF{did_you_mean(link, tree.links)}; {listed}")
    return link


def imu_mounts(entries: Mapping[str, ImuSensorKeys], tree: UrdfTree) -> tuple[Mount, ...]:
    """IMUs, each on a link, or on the child link of a joint.

    Raises:
        ParamsError: A link or joint that the URDF does not have.
    """
    mounts = []
    for name, entry in entries.items():
        if entry.joint is None:
            link = check_link(f"imu.{name}.link", entry.link or "", tree)
        elif entry.joint in tree.joints:
            link = tree.joints[entry.joint].child
        else:
            raise ParamsError(
                f"imu.{name}.joint: no joint {entry.joint!r} in the URDF{did_you_mean(entry.joint, tree.joints)}"
            )
        mounts.append(Mount(name, link, entry.pose))
    return tuple(mounts)


def link_splits(entries: Mapping[str, ForceTorqueSensorKeys], tree: UrdfTree) -> tuple[LinkSplit, ...]:
    """Links that force/torque sensors inside them divide.

    Args:
        entries: `force_torque` of the robot file.
        tree: The URDF as it is.

    Raises:
        ParamsError: A link that the URDF does not have or that has two sensors.
    """
    splits: dict[str, LinkSplit] = {}
    for name, entry in entries.items():
        if entry.link is None or entry.mass_beyond is None:
            continue
        at = f"force_torque.{name}.link"
        link = check_link(at, entry.link, tree)
        if link in splits:
            raise ParamsError(
                f"{at}: expected a link without another sensor; {link!r} has the sensor {splits[link].sensor!r} already"
            )
        splits[link] = LinkSplit(link, name, entry.mass_beyond)
    return tuple(splits.values())


def force_torque_mounts(
    entries: Mapping[str, ForceTorqueSensorKeys],
    joints: tuple[str, ...],
    base: str,
    tree: UrdfTree,
    splits: tuple[LinkSplit, ...],
) -> tuple[ForceTorqueMount, ...]:
    """Force/torque sensors, each in a joint that does not move, or inside a link.

    Args:
        entries: `force_torque` of the robot file.
        joints: Driven joints.
        base: Link that is welded or floats.
        tree: The URDF with its links split.
        splits: Of `link_splits`.

    Raises:
        ParamsError: A joint that moves, is not there or carries the base, or a contact that is not beyond the sensor.
    """
    inside = {split.sensor: split for split in splits}
    mounts = []
    for name, entry in entries.items():
        at = f"force_torque.{name}"
        split = inside.get(name)
        key, said = ("joint", entry.joint) if split is None else ("link", entry.link)
        joint = entry.joint or "" if split is None else split.joint
        if joint not in tree.joints or joint in joints:
            rigid = [other for other in tree.joints if other not in joints]
            raise ParamsError(
                f"{at}.joint: expected a joint that does not move, got {joint!r}{did_you_mean(joint, rigid)}; "
                "possible: "
                f"{', '.join(rigid)}"
            )
        beyond = tree.beyond(tree.joints[joint].child)
        if base in beyond:
            raise ParamsError(
                f"{at}.{key}: expected a {key} on the way to a tip; the base {base!r} hangs from {said!r}"
            )
        contact = _contact(name, entry.contact or FrameKeys(), tree.joints[joint].child, beyond, split)
        mounts.append(ForceTorqueMount(name, joint, entry.pose, contact))
    return tuple(mounts)


def _contact(name: str, place: FrameKeys, child: str, beyond: set[str], split: LinkSplit | None) -> Mount:
    """The frame that takes the external wrench; the link that a sensor divides stands for its part beyond."""
    link = place.link or child
    if split is not None and link == split.link:
        link = split.beyond
    if link not in beyond:
        raise ParamsError(
            f"force_torque.{name}.contact.link: expected a link beyond the sensor ({', '.join(sorted(beyond))}), got "
            f"{link!r}{did_you_mean(link, beyond)}"
        )
    return Mount(name, link, place.pose)
