"""The rig file of `estimate-base`: which robot, where it touches, and which columns of a log hold what.

robot: walker.yaml                 # robot file, relative to this one; floating base, an IMU
columns:                           # optional; where a log has other names
  time: stamp
  position: joints_q               # a (T, n) array (NPZ), or a list of n columns; else <joint>/position
  velocity: joints_qd              # optional; differences of the position without
  joint_order: joint_names         # optional; of those arrays: a list, or an array of names in the NPZ
  gyro: omega                      # else imu_<name>/gyro_{x,y,z};  accel: else imu_<name>/accel_{x,y,z}
  roll_pitch: rpy                  # optional; the IMU's own roll and pitch [rad], first two columns
  truth_position: base_xyz         # optional; (T, 3) [m];  truth_rpy: base_rpy, (T, 3) [rad]
contacts:
  left:
    link: l_sole                   # frame C: in the sole's surface, z out of the foot's top; xyz, rpy optional
    sole: [-0.05, 0.1, -0.03, 0.03]      # x and y from, to [m]; or corners [[x, y], ...]; neither: a point
    sensor: left_foot              # F/T sensor of the robot file; without: the log has the wrench at C, in C
    wrench: lf                     # (T, 6) array or six columns; else ft_<sensor>/{fx,fy,fz,tx,ty,tz}
    make: 150.0                    # load that makes contact [N], and break: that ends it
    break: 120.0
estimator: {ground: level}         # optional; fields of BaseEstimatorSpec but contacts and period
start: {position: [0, 0, 0.6], yaw: 0.0}   # optional; else the truth's first sample, else the robot file's pose
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import numpy as np
from pydantic import BeforeValidator, WithJsonSchema

from drake_tc.config.keys import FileName, Keys, Name, Names, Number, Triple, key, saying
from drake_tc.config.quoted import quoted
from drake_tc.config.records import record_keys, validated
from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import ParamsError, RigError
from drake_tc.estimation.base.spec import BaseEstimatorSpec, ContactSpec, Point2
from drake_tc.robot.document import PoseKeys
from drake_tc.robot.fields import Mount
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.types import FloatArray

_SOLE_SCHEMA = WithJsonSchema({"type": "array", "minItems": 3})
Columns: TypeAlias = Annotated[str | Names, saying("the name of a column, or a list of names")]


class ColumnKeys(Keys):
    """Where the log has other names than the canonical ones. Each key is the name of a column or a list of names."""

    time: Columns | None = key("Time [s].", example="stamp", absent="`time`")
    position: Columns | None = key(
        "Positions of the joints: an array (T, n) of an NPZ file, or n columns.",
        unit="rad",
        example="joints_q",
        absent="`<joint>/position`",
    )
    velocity: Columns | None = key(
        "Velocities of the joints.", unit="rad/s", example="joints_qd", absent="differences of the positions"
    )
    joint_order: Columns | None = key(
        "Joints of those arrays: a list of names, or an array of names in the NPZ file.",
        example="joint_names",
        absent="the robot file's order",
    )
    gyro: Columns | None = key("Angular rates.", unit="rad/s", example="omega", absent="`imu_<name>/gyro_{x,y,z}`")
    accel: Columns | None = key(
        "Proper accelerations.", unit="m/s²", example="acc", absent="`imu_<name>/accel_{x,y,z}`"
    )
    roll_pitch: Columns | None = key(
        "The IMU's own roll and pitch, in the first two columns.", unit="rad", example="rpy", absent="not used"
    )
    truth_position: Columns | None = key(
        "True position of the base (T, 3).", unit="m", example="base_xyz", absent="not known"
    )
    truth_rpy: Columns | None = key(
        "True roll, pitch and yaw of the base (T, 3).", unit="rad", example="base_rpy", absent="not known"
    )


class ContactKeys(PoseKeys):
    """A place where the robot may touch; z of its frame points out of the foot's top."""

    link: Name = key("Link of the contact.", example="left_foot", default=..., expected="the name of a link")
    sole: Annotated[tuple[Point2, ...], BeforeValidator(lambda value: _sole(value)), _SOLE_SCHEMA] | None = key(
        "Edges of a sole [x from, x to, y from, y to], or its corners [[x, y], ...].",
        unit="m",
        example=[-0.05, 0.1, -0.03, 0.03],
        absent="a point",
    )
    sensor: Name | None = key("F/T sensor of the robot file.", example="left_ankle", absent="`wrench` is needed")
    wrench: Columns | None = key(
        "Columns of the wrench: an array (T, 6) or six columns.",
        unit="N, N·m",
        example="lf",
        absent="`ft_<sensor>/...`",
    )
    make: Number = key("Load that makes contact.", unit="N", example=150.0, default=..., expected="a load [N]")
    break_: Number = key(
        "Load that ends contact.", unit="N", example=120.0, default=..., expected="a load [N]", name="break"
    )

    @classmethod
    def check_together(cls, value: Mapping[str, object]) -> None:
        """The wrench comes from somewhere."""
        if value.get("sensor") is None and value.get("wrench") is None:
            raise ValueError("expected a sensor of the robot file, or the columns of its wrench, got neither")

    def contact(self, name: str) -> ContactSpec:
        """The contact."""
        return ContactSpec(
            mount=Mount(name, self.link, self.pose),
            polygon=self.sole,
            sensor=self.sensor,
            make=self.make,
            break_=self.break_,
        )


class StartKeys(Keys):
    """Where the base starts."""

    position: Triple = key("Position.", unit="m", example=[0.0, 0.0, 0.6], default=..., expected="three numbers")
    yaw: Number = key("Yaw.", unit="rad", example=0.5, default=0.0)


class BaseRigDocument(Keys):
    """What the rig file of `estimate-base` may say."""

    robot: FileName = key(
        "Robot file with a floating base and an IMU, relative to this file.",
        example="walker.yaml",
        default=...,
        expected="the name of a robot file",
    )
    columns: ColumnKeys | None = key("Names in the log.", example={"time": "stamp"}, absent="the canonical names")
    contacts: dict[str, ContactKeys] = key(
        "By name, where the robot may touch.",
        example={"left": {"link": "l_foot", "sensor": "left_ankle", "make": 150.0, "break": 120.0}},
        default=...,
        expected="a mapping of name to contact",
    )
    estimator: record_keys(BaseEstimatorSpec, "contacts", "period") | None = key(  # type: ignore[valid-type]
        "Tuning of the estimator.", example={"ground": "level"}, absent="the defaults of its keys"
    )
    start: StartKeys | None = key(
        "Where the base starts.",
        example={"position": [0.0, 0.0, 0.6]},
        absent="the first true sample, otherwise the robot file's pose",
    )


@dataclass(frozen=True, eq=False)
class BaseRig:
    """What a rig file says.

    Attributes:
        robot: The robot.
        contacts: Where it may touch. wrench: For each, the columns of its wrench, or None for the canonical ones.
        columns: Column names that differ: a key of `ColumnKeys` to a name or a list of names.
        tuning: Fields of `BaseEstimatorSpec`.
        start: (position (3,) [m], yaw [rad]) of the base, or None.
        source: The file.
    """

    robot: Robot
    contacts: tuple[ContactSpec, ...]
    wrench: tuple[str | tuple[str, ...] | None, ...]
    columns: Mapping[str, str | tuple[str, ...]]
    tuning: Mapping[str, Any]
    start: tuple[FloatArray, float] | None
    source: Path

    def spec(self, period: float) -> BaseEstimatorSpec:
        """The estimator's specification at a period [s].

        Raises:
            RigError: a value that is not possible.
        """
        try:
            return BaseEstimatorSpec(self.contacts, period, **self.tuning)
        except ParamsError as error:
            raise RigError(f"{self.source}: {error}") from None


def _sole(value: object) -> object:
    """The corners of a sole, in order."""
    numbers = isinstance(value, list) and all(isinstance(x, int | float) and not isinstance(x, bool) for x in value)
    if isinstance(value, list) and numbers and len(value) == 4:
        x0, x1, y0, y1 = map(float, value)
        if x0 < x1 and y0 < y1:
            return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
    if isinstance(value, list) and value and all(isinstance(item, list) and len(item) == 2 for item in value):
        return tuple(tuple(item) for item in value)
    raise ValueError(f"expected [x from, x to, y from, y to] or corners [[x, y], ...], got {quoted(value)}")


def _check_sensors(contacts: Sequence[ContactSpec], robot: Robot) -> None:
    there = [mount.name for mount in robot.force_torque]
    for contact in contacts:
        if contact.sensor is not None and contact.sensor not in there:
            raise ParamsError(
                f"contacts.{contact.mount.name}.sensor: no F/T sensor {contact.sensor!r} in the robot file;"
                f" there: {', '.join(there) or 'none'}"
            )


def load_base_rig(path: Path | str) -> BaseRig:
    """Read a rig file of `estimate-base`.

    Raises:
        RigError: the file or its robot cannot be used; the message names file and key.
    """
    source = Path(path)
    document = read_yaml(source, "rig file (YAML)", RigError)
    read = validated(BaseRigDocument, document, str(source), RigError)
    try:
        robot = load_robot(source.parent / read.robot)
    except ParamsError as error:
        raise RigError(f"{source}: robot: {error}") from None
    try:
        contacts = tuple(entry.contact(name) for name, entry in read.contacts.items())
        _check_sensors(contacts, robot)
    except ParamsError as error:
        raise RigError(f"{source}: {error}") from None
    columns = {} if read.columns is None else read.columns.given()
    rig = BaseRig(
        robot=robot,
        contacts=contacts,
        wrench=tuple(_listed(entry.wrench) for entry in read.contacts.values()),
        columns={name: _listed(value) for name, value in columns.items()},
        tuning={} if read.estimator is None else read.estimator.given(),
        start=None if read.start is None else (np.array(read.start.position), read.start.yaw),
        source=source,
    )
    rig.spec(1e-3)
    return rig


def _listed(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
