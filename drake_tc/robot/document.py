"""What a robot file may say. `load_robot` checks it against the URDF."""

from collections.abc import Mapping
from typing import Annotated

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
from drake_tc.robot.fields import Pose

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
        absent="at the origin",
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
