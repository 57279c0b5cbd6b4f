"""What the base estimator is told: where the robot may touch, and how much it trusts which sensor."""

from dataclasses import dataclass, fields
from typing import Literal

import numpy as np

from drake_tc.config.records import Unbounded, check_choices, unbounded_fields
from drake_tc.errors import ParamsError
from drake_tc.robot.fields import Mount

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
            raise ParamsError(f"{where}: sole_points: expected two numbers, 2 or more each, got {self.sole_points!r}")


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
class BaseEstimatorSpec:
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
    period: float
    imu_age: float = 0.0
    ground: Ground = "unknown"
    reference: Reference = "rolling"
    velocity_time: float = 0.02
    contact_velocity: float = 0.02
    cop_moment: float = 0.5
    position_time: float = 0.01
    yaw_time: Unbounded = 0.5
    yaw_bias_time: Unbounded = 5.0
    bias_time: Unbounded = 5.0
    tilt_time: Unbounded = 3.0
    sole_time: Unbounded = 1.0
    still_rate: float = 0.05
    anchor_time: Unbounded = 20.0
    slip_speed: Unbounded = 0.05
    slip_distance: Unbounded = 0.01
    slip_turn: Unbounded = 0.02
    slip_time: float = 0.02
    slip_hold: float = 0.05
    tilted: float = 0.03
    force_offset: Unbounded = 8.0
    yaw_drift: float = 0.008
    encoder_spike: float = 0.05
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
        check_choices(self)
        if not 0.0 <= self.imu_age < np.inf:
            raise ParamsError(f"imu_age: expected a time >= 0 [s], got {self.imu_age!r}")
        for item in fields(self):
            if item.name in ("contacts", "ground", "reference", "imu_age", "quick_start"):
                continue
            value = getattr(self, item.name)
            good = isinstance(value, (int, float)) and value > 0.0
            if not (good and (np.isfinite(value) or item.name in unbounded_fields(BaseEstimatorSpec))):
                raise ParamsError(f"{item.name}: expected a positive number, got {value!r}")
