"""`CopEstimator`: one tick of the base estimator, a pure function of a state and a sample.

What all base estimators are built on: the tables of a robot and its contacts, and a state before the first tick.

The baselines: the chain from a foot whose centre is taken to stand still, without the IMU and with it.

The program of the velocity update where a centre of pressure ends at its sole's edge.

The equations are those of `drake_tc.kernels.base.velocity`, whose closed form serves everywhere else.

How far a soft sole gives way under its centre of pressure (CoP).

A sole is n springs of stiffness K/n that only push. Under a force F with its CoP at c the springs' forces f_i F have
the least energy of all that bear the load:

    g(c) = n min sum f_i^2   s.t. sum f_i = 1, sum f_i x_i = c, f >= 0        sink at c: s = F g(c)/K

As long as all springs touch, g = 1 + (c_x/r_x)^2 + (c_y/r_y)^2, r^2 = a^2 (m + 1)/(3 (m - 1)) of m springs in a row of
half length a; beyond, the sole rolls onto its edge and g grows faster.

The point of the foot's frame that stands still is (c, s), at the floor. The energy E* = F^2 g(F c/F)/(2K) gives the
deflection's parts at c: the material there sinks by

    ds_material = (g dF + F dg/2)/K

and as c moves along the tilted sole, F dg/(2K) is the way back to the floor, whose slope in the sole is F (dg/dc)/(2K).

`BaseEstimator` is the estimator as a Drake system.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from daqp import solve  # type: ignore[import-not-found, import-untyped, unused-ignore]

from drake_tc.array_stage import Arrays, ArrayStage, StageSystem, places
from drake_tc.errors import ParamsError
from drake_tc.estimation import base_kinematics as base
from drake_tc.estimation.base_rig import BaseEstimatorSpec, ContactSpec, Point2, half_planes
from drake_tc.kernels.calls import BASE_OUTPUTS, Kernel, KernelCall, copying
from drake_tc.robot.robot import Robot
from drake_tc.types import Call, FloatArray

_NODES = 25
"""Of the table, each way."""
_INSIDE = 1e-9


@dataclass(frozen=True, eq=False)
class SoftSole:
    """g over a sole, between the nodes of a table linearly (`drake_tc.kernels.base.contacts.shape_of`).

    Attributes:
        stiffness: K [N/m].
        origin, step: Of the nodes [m].
        table: (25, 25) g, first index along x [-].
    """

    stiffness: float
    origin: tuple[float, float]
    step: tuple[float, float]
    table: FloatArray


def spring_points(polygon: tuple[Point2, ...], numbers: tuple[int, int]) -> FloatArray:
    """(n, 2) where the springs of a sole are: a grid between its extremes, as far as it is inside [m]."""
    corners = np.array(polygon)
    low, high = corners.min(axis=0), corners.max(axis=0)
    x, y = (np.linspace(low[i], high[i], numbers[i]) for i in (0, 1))
    grid = np.stack([each.ravel() for each in np.meshgrid(x, y, indexing="ij")], axis=1)
    normals, offsets = half_planes("sole", polygon)
    return np.asarray(grid[(grid @ normals.T <= offsets + _INSIDE).all(axis=1)])


def shape_at(points: FloatArray, c: FloatArray) -> float:
    """g(c) by its program; of a c that no push of the springs can have, that of the nearest that one can.

    Args:
        points: (n, 2) springs [m].
        c: (2,) centre of pressure [m].
    """
    n = len(points)
    scale = np.abs(points - points.mean(axis=0)).max(axis=0)
    rows = np.column_stack([(points - c) / scale, np.ones(n)])
    heavy = 1e4  # of c against energy; the sum of f is an equation
    hessian: Any = np.eye(n) + heavy * rows[:, :2] @ rows[:, :2].T
    A, low, high = np.ascontiguousarray(rows[:, 2:].T), np.append(np.zeros(n), 1.0), np.append(np.ones(n), 1.0)
    sense = np.append(np.zeros(n), 5).astype(np.int32)  # 5: an equation
    f = np.asarray(solve(hessian, np.zeros(n), A, high, low, sense)[0])
    return float(n * f @ f)


def soft_sole(contact: ContactSpec) -> SoftSole | None:
    """The table of a contact; None of one that is rigid or a point."""
    if contact.sole_stiffness is None or contact.polygon is None:
        return None
    return SoftSole(contact.sole_stiffness, *_tabled(contact.polygon, contact.sole_points))


@lru_cache(maxsize=32)
def _tabled(polygon: tuple[Point2, ...], numbers: tuple[int, int]) -> tuple[Point2, Point2, FloatArray]:
    """(origin, step, rows) of a sole's table."""
    points = spring_points(polygon, numbers)
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = (np.linspace(low[i], high[i], _NODES) for i in (0, 1))
    table = np.array([[shape_at(points, np.array([a, b])) for b in y.tolist()] for a in x.tolist()])
    step = (high - low) / (_NODES - 1)
    return (float(low[0]), float(low[1])), (float(step[0]), float(step[1])), table


_NO_LIMIT = 1e30


@dataclass(frozen=True, eq=False)
class Soles:
    """The soles of k contacts as half planes N x <= d, padded to the same number m of rows.

    Attributes:
        normals: (k, m, 2); zero rows pad, and all rows of a point are padding: it has no room to leave.
        offsets: (k, m) [m]; `_NO_LIMIT` where padded.
        middle: (k, 2) mean of the corners [m]; zero of a point.
        flat: (k,) 1 for a sole, 0 for a point.
        rows, nothing, sense: (k m, 3 + 2k), (k m,), (k m,) the half planes as the solver takes them.
        template: (k, 3, 3 + 2k) [I 0 ... 0].
    """

    normals: FloatArray
    offsets: FloatArray
    middle: FloatArray
    flat: FloatArray
    rows: FloatArray
    nothing: FloatArray
    sense: Any
    template: FloatArray


def soles_of(contacts: tuple[ContactSpec, ...]) -> Soles:
    """The soles of the contacts.

    Raises:
        ParamsError: a polygon that is not convex.
    """
    k, m = len(contacts), max((len(c.polygon) for c in contacts if c.polygon is not None), default=1)
    normals, offsets = np.zeros((k, m, 2)), np.full((k, m), _NO_LIMIT)
    middle, flat = np.zeros((k, 2)), np.zeros(k)
    for i, contact in enumerate(contacts):
        if contact.polygon is not None:
            rows, limits = half_planes(f"contact {contact.mount.name!r}", contact.polygon)
            normals[i, : len(rows)], offsets[i, : len(rows)] = rows, limits
            middle[i], flat[i] = np.mean(contact.polygon, axis=0), 1.0
    whole = np.zeros((k * m, 3 + 2 * k))
    for i in range(k):
        whole[i * m : (i + 1) * m, 3 + 2 * i : 5 + 2 * i] = normals[i]
    template = np.zeros((k, 3, 3 + 2 * k))
    template[:, :, :3] = np.eye(3)
    below = np.full(k * m, -_NO_LIMIT)
    return Soles(normals, offsets, middle, flat, whole, below, np.zeros(k * m, dtype=np.int32), template)


def rows_of(contacts: tuple[ContactSpec, ...]) -> FloatArray:
    """(k, w) a row a contact, as `drake_tc.kernels.base.sample` has it.

    Raises:
        ParamsError: a polygon that is not convex.
    """
    soles, rows = soles_of(contacts), []
    planes = np.concatenate((soles.normals, soles.offsets[:, :, None]), axis=2)
    for contact, flat, middle, limits in zip(contacts, soles.flat, soles.middle, planes, strict=True):
        sole = soft_sole(contact)
        give = (0.0, 0.0, 0.0, 1.0, 1.0) if sole is None else (sole.stiffness, *sole.origin, *sole.step)
        rows.append([flat, contact.make, contact.break_, *give, *middle, *limits.ravel()])
    return np.array(rows)


def solve_program(program: FloatArray, soles: Soles) -> FloatArray:
    """(4 + 3k,): 1, ydot, x_1 ..., 1 for each sole that ends there; -1 first where the solver gives nothing.

    Points keep x_cop.

    Args:
        program: (5 + 13k,) as `drake_tc.kernels.base.velocity.write_program` has it.
        soles: Limits of the centres of pressure.
    """
    k = len(soles.flat)
    n = 3 + 2 * k
    reference, trust, deviation = program[:3], program[3], program[4]
    matrix, still, pressure, spread, weight = np.split(program[5:], np.cumsum([6 * k, 3 * k, 2 * k, k]))
    A = soles.template.copy()
    curvature = np.full(n, trust)
    for i in np.flatnonzero(spread > 0.0):
        A[i, :, 3 + 2 * i : 5 + 2 * i] = matrix.reshape(k, 3, 2)[i]
        curvature[3 + 2 * i : 5 + 2 * i] = 1.0 / (spread[i] * spread[i])
    # about [ydot_ref; x_cop]: z = goal + dz, so that numbers are small
    scale = np.sqrt(weight)[:, None] / deviation
    A *= scale[:, :, None]
    A = A.reshape(3 * k, n)
    b = (scale * (reference + still.reshape(k, 3))).ravel()
    hessian = A.T @ A
    hessian.flat[:: n + 1] += curvature
    room = soles.offsets - (soles.normals @ pressure.reshape(k, 2, 1))[:, :, 0]
    dz, _, flag, told = solve(hessian, A.T @ b, soles.rows, room.ravel(), soles.nothing, soles.sense, primal_tol=1e-9)
    if flag <= 0 or not dz @ dz < np.inf:
        return np.full(4 + 3 * k, -1.0)
    ends = told["lam"].reshape(k, -1).any(axis=1)
    return np.concatenate(([1.0], reference + dz[:3], pressure + dz[3:], ends))


class OnKinematics(ABC):
    """A base estimator without its recursion.

    Attributes:
        spec: Contacts and tuning.
        kinematics: Of the robot.
        num_joints, num_contacts: n, k.
        options: (27,) in the order of `drake_tc.kernels.base.sample.Options`.
        soles: (k, w) rows of the contacts, see `drake_tc.kernels.base.sample`.
        tables: (k, m m) shapes of soft soles, see `drake_tc.kernels.base.contacts.shape_of`; zero of rigid ones.
    """

    def __init__(self, robot: Robot, spec: BaseEstimatorSpec) -> None:
        """Build the tables.

        Args:
            robot: With a floating base and an IMU.
            spec: Contacts and tuning.

        Raises:
            ParamsError: what robot and contacts lack, or a sole that is not convex.
        """
        self.spec = spec
        self.kinematics = base.BaseKinematics(robot, spec.contacts)
        self.num_joints, self.num_contacts = len(robot.joints), len(spec.contacts)
        self._limits = soles_of(spec.contacts)
        soft = [soft_sole(contact) for contact in spec.contacts]
        self.options = _options(spec, self.kinematics.weight, any_soft=any(sole is not None for sole in soft))
        self.soles = rows_of(spec.contacts)
        tables = [np.zeros(4) if sole is None else sole.table.ravel() for sole in soft]
        self.tables = np.zeros((len(tables), max(table.size for table in tables)))
        for row, table in zip(self.tables, tables, strict=True):
            row[: table.size] = table
        known = self.kinematics.between, *self.kinematics.tree
        self._fixed = (self.options, self.soles, self.tables, *known)

    @abstractmethod
    def advance(self, state: FloatArray, sample: base.Sample, after: FloatArray) -> None:
        """Write the packed state after one sample into `after`; it never holds a NaN but an unknown ground.

        Args:
            state: (s,) packed, before it.
            sample: Of all sensors.
            after: (s,).
        """

    def step(self, state: base.BaseState, sample: base.Sample) -> base.BaseState:
        """The state after one sample; never raises."""
        before = base.packed(state)
        after = np.empty_like(before)
        self.advance(before, sample, after)
        return base.unpacked(after, self.num_joints, self.num_contacts)

    def initial_state(self, position: FloatArray, yaw: float) -> base.BaseState:
        """Before the first tick, with the base at `position` (3,) [m] and `yaw` [rad]."""
        return base.initial_state(self.kinematics.robot.posture, self.num_contacts, position, yaw)


def _options(spec: BaseEstimatorSpec, weight: float, *, any_soft: bool) -> FloatArray:
    """(27,) in the order of `drake_tc.kernels.base.sample.Options`."""
    level, touchdown = spec.ground == "level", spec.reference == "touchdown"
    row = (
        spec.period, spec.imu_age, level, touchdown, spec.velocity_time, spec.contact_velocity, spec.cop_moment,
        spec.position_time, spec.yaw_time, spec.yaw_bias_time, spec.bias_time, spec.tilt_time, spec.sole_time,
        spec.still_rate, spec.anchor_time, spec.slip_speed, spec.slip_distance, spec.slip_turn, spec.slip_time,
        spec.slip_hold, spec.tilted, spec.force_offset, spec.yaw_drift, spec.encoder_spike, spec.quick_start, any_soft,
        weight,
    )  # fmt: skip
    return np.array(row, dtype=float)


_TICK = Kernel("base.tick", "tick")


class CopEstimator(OnKinematics):
    """Base position, velocity and yaw from the point of each contact that stands still, the centre of pressure.

    Stage 1 (`drake_tc.kernels.base.velocity`), then stage 2 (`drake_tc.kernels.base.pose`), every tick; roll and pitch
    from the IMU, or from gyro and accelerometer (`base.attitude`). A contact that carries load holds its centre of
    pressure where it was: a reference that follows the centre of pressure as it moves over the sole, and slowly adapts
    where contacts disagree. What cannot be believed, or gives no numbers, gives way to what the last tick knew, and
    raises a flag (`state.FLAGS`).
    """

    def __init__(self, robot: Robot, spec: BaseEstimatorSpec) -> None:
        """As `OnKinematics`."""
        super().__init__(robot, spec)
        k = self.num_contacts
        self._unsolved, self._program_size = np.zeros(4 + 3 * k), 5 + 13 * k

    def advance(self, state: FloatArray, sample: base.Sample, after: FloatArray) -> None:
        """As `OnKinematics.advance`; where a centre of pressure ends at its sole's edge, with a quadratic program."""
        program, given = np.empty(self._program_size), (state, tuple(sample), self._fixed)
        if not _TICK(*given, (self._unsolved, program), after):
            _TICK(*given, (solve_program(program, self._limits), program), after)


_CHAIN_TICK = Kernel("base.chain", "tick")


class FootCentreEstimator(OnKinematics):
    """Leg odometry: the most loaded contact is fixed in the world, position and orientation, until another takes over.

    With F the fixed contact:   X_WB = X_WF X_BF^-1,   V_WB from no velocity of F.   Orientation comes from the chain;
    where the robot starts, from the IMU's roll and pitch if there are any. Of the tuning, only what concerns sensors'
    faults counts.
    """

    by_imu: ClassVar[bool] = False

    def advance(self, state: FloatArray, sample: base.Sample, after: FloatArray) -> None:
        """As `OnKinematics.advance`."""
        _CHAIN_TICK(state, tuple(sample), self._fixed, self.by_imu, after)


class FootCentreImuEstimator(FootCentreEstimator):
    """The same with roll, pitch and angular velocity by the IMU, as the whole estimator has them; yaw by the chain.

    The foot's centre is still taken to stand still, whichever way the foot tilts. Without a gyro it is the chain alone.
    """

    by_imu: ClassVar[bool] = True


METHODS: dict[str, type[CopEstimator] | type[FootCentreEstimator]] = {
    "cop": CopEstimator,
    "foot_centre": FootCentreEstimator,
    "foot_centre_imu": FootCentreImuEstimator,
}


_OUTPUTS = Kernel("base.pose", "outputs")


class BaseEstimator(StageSystem):
    """Pose and velocity of a floating base from encoders, IMU and loads; n joints, k contacts.

    Inputs, read at the ticks alone:
        position (n), velocity (n): encoders [rad, rad/s], in the robot's order.
        imu (6): [gyro; accel], the IMU's axes [rad/s, m/s^2].
        imu_tilt (2): its roll and pitch [rad]; not connected or NaN: from gyro and accelerometer.
        wrench (6k): [f; t] of each contact's sensor, its axes [N, N m], in the contacts' order.
        contact_switch (k): 0 by the load's thresholds, 1 held on, -1 held off; not connected: 0.
    Outputs, all of the state alone, never NaN:
        base_pose (7): R_WB as quaternion [w x y z], p_WB [m].
        base_velocity (6): [omega; v] of B in W [rad/s, m/s].
        estimated_state (nq + nv): [q; v] of the robot's plant (`make_plant`), joints included.
        cop (2k): centres of pressure in their contacts' frames [m].
        status (9 + 5k): `flag_names`.
    State: x, a packed `BaseState`; y shows the sample of the last tick, x[n+1] = step(x[n], u[n]), y[n] = read(x[n]).
    """

    def __init__(
        self,
        robot: Robot,
        spec: BaseEstimatorSpec,
        *,
        method: str = "cop",
        position: FloatArray | None = None,
        yaw: float | None = None,
    ) -> None:
        """Declare ports, state and the periodic update.

        Args:
            robot: With a floating base and an IMU.
            spec: Contacts, period and tuning.
            method: "cop", or a baseline: "foot_centre", "foot_centre_imu".
            position: (3,) where the base starts [m]; the robot file's base pose by default.
            yaw: Its yaw there [rad].

        Raises:
            ParamsError: an unknown method, or what robot and contacts lack.
        """
        super().__init__()
        if method not in METHODS:
            raise ParamsError(f"BaseEstimator: method: expected one of {', '.join(METHODS)}, got {method!r}")
        self._estimator = METHODS[method](robot, spec)
        n, k = self._estimator.num_joints, self._estimator.num_contacts
        self._n, self._k = n, k
        start = robot.base_pose
        place = np.array(start.xyz if position is None else position, dtype=float)
        heading = start.rpy[2] if yaw is None else float(yaw)
        if place.shape != (3,) or not (np.isfinite(place).all() and np.isfinite(heading)):
            raise ParamsError(f"BaseEstimator: expected a finite start, got position {place.tolist()}, yaw {heading}")
        self._start, self._dt = base.packed(self._estimator.initial_state(place, heading)), spec.period
        self._order = np.array(self._estimator.kinematics.order, dtype=np.int64)
        joints = {"position": n, "velocity": n}
        self._declare({**joints, "imu": 6, "imu_tilt": 2, "wrench": 6 * k, "contact_switch": k})

    @property
    def flag_names(self) -> tuple[str, ...]:
        """Names of `status`: those of the whole, then `<contact>/<flag>`."""
        contacts = self._estimator.spec.contacts
        return (*base.FLAGS, *(f"{contact.mount.name}/{flag}" for contact in contacts for flag in base.CONTACT_FLAGS))

    def base_state(self, context: Any) -> base.BaseState:
        """All that is remembered."""
        self.ValidateContext(context)
        return base.unpacked(np.array(context.get_discrete_state(self._memory).value()), self._n, self._k)

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        n, k = self._n, self._k
        cop, flags = base.place_of("pressure", n, k), slice(base.place_of("flags", n, k).start, None)
        shown = 14 + 2 * n + self._estimator.kinematics.state_size
        absent = {"imu_tilt": np.full(2, np.nan), "contact_switch": np.zeros(k)}
        names = ("position", "velocity", "imu", "imu_tilt", "wrench", "contact_switch")
        ends = np.cumsum([shown, *(self._start[part].size for part in (cop, flags))]).tolist()

        def bind(arrays: Arrays) -> tuple[list[Call], Call]:
            given = absent | {
                name: arrays.inputs[name] for name in names if name not in absent or name in arrays.inputs
            }
            sample, before, after = base.Sample(*(given[name] for name in names)), arrays.before, arrays.after
            whole, pressure, status = np.split(arrays.out, ends[:2])

            def show(time: float) -> None:
                _OUTPUTS(before, n, k, self._order, whole)

            def update(time: float) -> None:
                self._estimator.advance(before, sample, after)

            showing = KernelCall(BASE_OUTPUTS, show, before, n, k, self._order, whole)
            return [showing, copying(before[cop], pressure), copying(before[flags], status)], update

        parts = {"base_pose": slice(7), "base_velocity": slice(7 + n, 13 + n)}
        parts |= {"estimated_state": slice(14 + 2 * n, shown), "cop": slice(*ends[:2]), "status": slice(*ends[1:])}
        updates = frozenset(names)
        return ArrayStage(ends[2], places(parts), bind, updates=updates, start=self._start, period=self._dt)
