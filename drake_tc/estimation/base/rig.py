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
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import ParamsError, RigError
from drake_tc.estimation.base.spec import BaseEstimatorSpec, ContactSpec
from drake_tc.robot import fields as field
from drake_tc.robot.mounts import Mount
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.types import FloatArray

COLUMNS = (
    "time",
    "position",
    "velocity",
    "joint_order",
    "gyro",
    "accel",
    "roll_pitch",
    "truth_position",
    "truth_rpy",
)
_CONTACT = ("xyz", "rpy", "sole", "sensor", "wrench")
_CHOICES = ("ground", "reference")


@dataclass(frozen=True, eq=False)
class BaseRig:
    """What a rig file says.

    Attributes:
        robot: The robot.
        contacts: Where it may touch. wrench: For each, the columns of its wrench, or None for the canonical ones.
        columns: Column names that differ: one of `COLUMNS` to a name or a list of names.
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


def _names(where: str, value: object) -> str | tuple[str, ...]:
    return field.names(where, value) if isinstance(value, list) else field.text(where, value)


def _sole(where: str, value: object) -> tuple[tuple[float, float], ...] | None:
    if value is None:
        return None
    if isinstance(value, list) and len(value) == 4 and not any(isinstance(item, list) for item in value):
        x0, x1, y0, y1 = (field.number(where, item) for item in value)
        if not (x0 < x1 and y0 < y1):
            raise ParamsError(f"{where}: wanted [x from, x to, y from, y to]; got {value}")
        return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
    if isinstance(value, list) and all(isinstance(item, list) and len(item) == 2 for item in value):
        return tuple((field.number(where, x), field.number(where, y)) for x, y in value)
    raise ParamsError(f"{where}: wanted [x from, x to, y from, y to] or corners [[x, y], ...]; got {value!r}")


def _contact(name: str, entry: object) -> tuple[ContactSpec, str | tuple[str, ...] | None]:
    where = f"contacts.{name}"
    given = field.mapping(where, entry, ("link", "make", "break"), _CONTACT)
    sensor = None if given.get("sensor") is None else field.text(f"{where}.sensor", given["sensor"])
    if sensor is None and given.get("wrench") is None:
        raise ParamsError(f"{where}: wanted a sensor of the robot file, or the columns of its wrench; got neither")
    contact = ContactSpec(
        mount=Mount(name, field.text(f"{where}.link", given["link"]), field.pose(where, given)),
        polygon=_sole(f"{where}.sole", given.get("sole")),
        sensor=sensor,
        make=field.number(f"{where}.make", given["make"]),
        break_=field.number(f"{where}.break", given["break"]),
    )
    return contact, None if given.get("wrench") is None else _names(f"{where}.wrench", given["wrench"])


def _check_sensors(contacts: Sequence[ContactSpec], robot: Robot) -> None:
    there = [mount.name for mount in robot.force_torque]
    for contact in contacts:
        if contact.sensor is not None and contact.sensor not in there:
            raise ParamsError(
                f"contacts.{contact.mount.name}.sensor: no F/T sensor {contact.sensor!r} in the robot file;"
                f" there: {', '.join(there) or 'none'}"
            )


def _tuning(entry: object) -> dict[str, Any]:
    possible = [item.name for item in fields(BaseEstimatorSpec) if item.name not in ("contacts", "period")]
    given = field.mapping("estimator", entry, (), possible)
    return {
        key: value if key in _CHOICES else field.number(f"estimator.{key}", value, infinite=True)
        for key, value in given.items()
    }


def _start(entry: object) -> tuple[FloatArray, float] | None:
    if entry is None:
        return None
    given = field.mapping("start", entry, ("position",), ("yaw",))
    position = np.array(field.triple("start.position", given["position"]))
    return position, field.number("start.yaw", given.get("yaw", 0.0))


def load_base_rig(path: Path | str) -> BaseRig:
    """Read a rig file of `estimate-base`.

    Raises:
        RigError: the file or its robot cannot be used; the message names file and key.
    """
    source = Path(path)
    if not source.is_file():
        raise RigError(f"{source}: no such rig file")
    try:
        top = field.mapping(
            "rig", read_yaml(source, "rig file (YAML)"), ("robot", "contacts"), ("columns", "estimator", "start")
        )
        robot = load_robot(source.parent / field.text("robot", top["robot"]))
        entries = field.mapping("contacts", top["contacts"], optional=None)
        contacts = [_contact(name, entry) for name, entry in entries.items()]
        _check_sensors([contact for contact, _ in contacts], robot)
        columns = field.mapping("columns", top.get("columns"), (), COLUMNS)
        rig = BaseRig(
            robot=robot,
            contacts=tuple(contact for contact, _ in contacts),
            wrench=tuple(wrench for _, wrench in contacts),
            columns={key: _names(f"columns.{key}", value) for key, value in columns.items()},
            tuning=_tuning(top.get("estimator")),
            start=_start(top.get("start")),
            source=source,
        )
        rig.spec(1e-3)
        return rig
    except ParamsError as error:
        text = str(error)
        raise RigError(text if str(source) in text else f"{source}: {text}") from None
