"""What the base estimator is told: where the robot may touch, and how much it trusts which sensor.

The rig file of `estimate-base`: which robot, where it touches, and which columns of a log hold what.

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
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import BeforeValidator, WithJsonSchema

from drake_tc.config.keys import FileName, Keys, Name, Names, Number, Triple, key, saying
from drake_tc.config.quoted import quoted
from drake_tc.config.records import Checked, FromZero, Positive, Unbounded, record_keys, validated
from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import ParamsError, RigError
from drake_tc.robot.document import PoseKeys
from drake_tc.robot.fields import Mount
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.types import FloatArray

Point2 = tuple[float, float]
Ground = Literal["unknown", "level"]
Reference = Literal["rolling", "touchdown"]


@dataclass(frozen=True)
class ContactSpec:
    """A part of the robot that may touch its surroundings.

    Attributes:
        mount: C: name, link, and pose on it. Of a sole: in its surface, z out of the foot's top, so that the ground's
            force has a positive z; of a point: the point itself.
        polygon: Corners of the sole in C's xy plane [m], in order, convex; None for a point (a hand).
        sensor: F/T sensor of the robot whose reading shows this contact's load; None where the reading is the external
            wrench at C itself, in C's axes.
        make, break_: Load above which contact is made, and below which it is lost [N]: the normal force of a sole, the
            length of the force at a point.
        sole_stiffness: K of a soft sole, as its maker knows it [N/m]; None: rigid. It gives way by F/K and more under
            a load F off its middle (`soft_sole`).
        sole_points: Springs that it acts like, along x and y.
    """

    mount: Mount
    polygon: tuple[Point2, ...] | None
    sensor: str | None
    make: float
    break_: float
    sole_stiffness: float | None = None
    sole_points: tuple[int, int] = (5, 3)

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ParamsError: thresholds without 0 < break <= make, a polygon that is not convex or has no area, or a
            stiffness that is not positive or of a point.
        """
        where = f"contact {self.mount.name!r}"
        if not 0.0 < self.break_ <= self.make < np.inf:
            raise ParamsError(f"{where}: expected 0 < break <= make [N], got break {self.break_:g}, make {self.make:g}")
        if self.polygon is not None:
            half_planes(where, self.polygon)
        if self.sole_stiffness is not None:
            if self.polygon is None:
                raise ParamsError(f"{where}: sole_stiffness: expected a sole beside it; this contact is a point")
            if not 0.0 < self.sole_stiffness < np.inf:
                raise ParamsError(
                    f"{where}: sole_stiffness: expected a number above 0 [N/m], got {self.sole_stiffness!r}"
                )
        if len(self.sole_points) != 2 or min(self.sole_points) < 2:
            raise ParamsError(f"{where}: sole_points: expected two numbers >= 2, got {self.sole_points!r}")


def half_planes(where: str, corners: tuple[Point2, ...]) -> tuple[np.ndarray, np.ndarray]:
    """(m, 2) outward unit normals N and (m,) offsets d of a convex polygon: N x <= d inside.

    Raises:
        ParamsError: fewer than three corners, no area, or not convex.
    """
    points = np.asarray(corners, dtype=float)
    if points.ndim != 2 or points.shape[0] < 3 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ParamsError(f"{where}: expected at least three corners [x, y], got {corners!r}")
    edges = np.roll(points, -1, axis=0) - points
    area = 0.5 * float(np.sum(points[:, 0] * np.roll(points[:, 1], -1) - np.roll(points[:, 0], -1) * points[:, 1]))
    lengths = np.hypot(*edges.T)
    if not (abs(area) > 1e-8 and lengths.min() > 1e-6):
        raise ParamsError(f"{where}: expected a sole of some area, got corners {corners!r}")
    normals = np.sign(area) * np.column_stack([edges[:, 1], -edges[:, 0]]) / lengths[:, None]
    offsets = np.sum(normals * points, axis=1)
    if (points @ normals.T > offsets + 1e-6).any():
        raise ParamsError(f"{where}: expected a convex sole with its corners in order, got {corners!r}")
    return normals, offsets


@dataclass(frozen=True)
class BaseEstimatorSpec(Checked):
    """Contacts and tuning; SI units.

    Times say how long a source is trusted before the contacts overrule it: a larger one filters more.

    Attributes:
        contacts: In the order of every vector of contacts.
        period: Of a tick [s].
        imu_age: How old a reading of the IMU is at its tick [s].
        ground: "level": every sole's centre of pressure lies at one height; "unknown": heights are chained.
        reference: How a contact's reference moves with the centre of pressure: "rolling" with the foot's present
            orientation (exact for a foot that rolls, tilts or turns about it), "touchdown" with that of the touch-down
            (the paper's (10)).
        velocity_time: Of the accelerometer against the contacts' velocities [s].
        contact_velocity: Standard deviation of the velocity that encoders give a contact [m/s].
        cop_moment: Standard deviation of the moment of a sole about its centre of pressure [N m].
        position_time: Of the velocity's integral against the contacts' positions [s].
        yaw_time: Of the gyro's increments against the directions between contacts [s].
        yaw_bias_time: In which what yaw and directions disagree about becomes a yaw-rate bias [s].
        bias_time: In which the gyro's bias follows its mean while the robot stands still [s].
        tilt_time: Of the gyro against the accelerometer, where the IMU gives no roll and pitch [s].
        sole_time: Of the gyro against the tilt that soft soles show, on a level ground [s].
        still_rate: Joint and base rates below which the robot stands still [rad/s].
        anchor_time: In which contacts that disagree adapt their references [s].
        slip_speed: Speed of a contact against the others, the IMU included, at which it is dropped [m/s].
        slip_distance: Distance of a contact from its reference at which all references are taken anew [m].
        slip_turn: Angle between the gyro's yaw and the contacts' at which they are taken anew [rad].
        slip_time: Over which that speed is averaged [s].
        slip_hold: How long a dropped contact must stand still before it counts again [s].
        tilted: Angle of a loaded foot against its touch-down at which it is flagged [rad].
        force_offset: Mean load of a contact in the air at which its sensor is flagged [N].
        yaw_drift: Yaw-rate bias at which the gyro is flagged [rad/s].
        encoder_spike: Step of an encoder, beyond what its speed explains, that is not believed [rad].
        quick_start: For a robot that moves at once, on feet that do not slide yet: the contacts teach the gyro its bias
            about the vertical as fast as they can from the first tick on (`memory`), and new references are averaged
            over a tenth of a second where they disagree with the others. Else, and better on a robot that walks, the
            bias is learnt at rest and slowly from the contacts.
    """

    contacts: tuple[ContactSpec, ...]
    period: Positive
    imu_age: FromZero = 0.0
    ground: Ground = "unknown"
    reference: Reference = "rolling"
    velocity_time: Positive = 0.02
    contact_velocity: Positive = 0.02
    cop_moment: Positive = 0.5
    position_time: Positive = 0.01
    yaw_time: Unbounded = 0.5
    yaw_bias_time: Unbounded = 5.0
    bias_time: Unbounded = 5.0
    tilt_time: Unbounded = 3.0
    sole_time: Unbounded = 1.0
    still_rate: Positive = 0.05
    anchor_time: Unbounded = 20.0
    slip_speed: Unbounded = 0.05
    slip_distance: Unbounded = 0.01
    slip_turn: Unbounded = 0.02
    slip_time: Positive = 0.02
    slip_hold: Positive = 0.05
    tilted: Positive = 0.03
    force_offset: Unbounded = 8.0
    yaw_drift: Positive = 0.008
    encoder_spike: Positive = 0.05
    quick_start: bool = False

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ParamsError: no contact, a name given twice, an unknown choice, or a number that is not positive.
        """
        if not self.contacts:
            raise ParamsError("expected at least one contact, got none")
        names = [contact.mount.name for contact in self.contacts]
        if len(set(names)) < len(names):
            raise ParamsError(f"expected contacts of different names, got {names}")
        super().__post_init__()


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
