"""A motion of a whole robot that identifies its links and its joints' friction.

    tau_i = Y_i(q, qdot, qddot) pi + F_v,i qdot_i + F_c,i sign(qdot_i)

With the columns of the base parameters of pi, in units of their tolerances, the friction columns of each joint and the
noise s_i [N m] of its torque, M = sum_i Z_i' Z_i n/(T s_i^2); D: max log det M, E: max lambda_min(M).

Source: Swevers, Ganseman, Tukel, De Schutter and Van Brussel (1997) for Fourier series under limits; the friction
columns and the minimum distance between links are added here.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue
from pydrake.solvers import MathematicalProgram, SnoptSolver, SolverOptions

from drake_tc.errors import ParamsError
from drake_tc.experiments.design.basis import BasisKind, MotionBasis, motion_basis, scaled
from drake_tc.experiments.design.collisions import SelfCollision
from drake_tc.experiments.design.lead import lead_in, quintic
from drake_tc.experiments.design.limits import JointLimits
from drake_tc.experiments.design.run import DEFAULT_HZ, Expected
from drake_tc.experiments.design.solve import DIFFERENCE
from drake_tc.identification.base_parameters import independent_columns
from drake_tc.identification.excitation import MotionLimits, growing_sinusoid
from drake_tc.robot.link_parameters import LinkModel, link_model
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray, IntArray

Progress = Callable[[str, float], None]
STEP = 0.05
PERIOD = 10.0
BANDWIDTH_HZ = 0.8
FREQUENCIES = 4
ACCELERATION_TIME = 0.4
"""Time in which a joint may reach its largest speed [s]: the acceleration limit where the robot file gives none."""
NOISE_SHARE = 0.005
"""Noise of a joint's torque over its effort limit."""
PER_SECOND = 20.0
"""Independent samples a second."""
COLLISION_SAMPLES, CHECKED_SAMPLES = 25, 100
UNKNOWN_SPAN = np.pi
"""Travel of a joint without position limits, to both sides of its posture [rad]."""


@dataclass(frozen=True, eq=False)
class RobotGoal:
    """The criterion for a whole robot.

    Attributes:
        links: Kinematics and nominal parameters. base: (b,) indices of the base parameters.
        scale: (b,) their tolerances.
        effort, speed: (n,) limits [N m], [rad/s].
        duration: Of the experiment [s]. smallest: E- instead of D-optimality.
    """

    links: LinkModel
    base: IntArray
    scale: FloatArray
    effort: FloatArray
    speed: FloatArray
    duration: float
    smallest: bool

    def information(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """M (b + 2 n, b + 2 n) of motions (T, n)."""
        count, n = q.shape
        y = self.links.columns(q, v, a)[:, :, self.base] * self.scale
        direction = np.tanh(v / (0.04 * self.speed))
        size = self.base.size + 2 * n
        out = np.zeros((size, size))
        rate = PER_SECOND * self.duration / count
        for i in range(n):
            z = np.zeros((count, size))
            z[:, : self.base.size] = y[:, i]
            z[:, self.base.size + 2 * i] = 0.05 * self.effort[i] * v[:, i] / self.speed[i]
            z[:, self.base.size + 2 * i + 1] = 0.05 * self.effort[i] * direction[:, i]
            out += rate / (NOISE_SHARE * self.effort[i]) ** 2 * z.T @ z
        return out

    def value(self, q: FloatArray, v: FloatArray, a: FloatArray) -> float:
        """Log det M or log lambda_min(M), less a penalty for torques beyond the limits."""
        eigen = np.maximum(np.linalg.eigvalsh(self.information(q, v, a)), 1e-9)
        found = float(np.log(eigen[0]) if self.smallest else np.sum(np.log(eigen)))
        over = np.maximum(np.abs(self.torque(q, v, a)) / self.effort - 1.0, 0.0)
        return found - 1e3 * float(np.mean(over**2))

    def torque(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """(T, n) of the nominal links, with 5 % of the effort limit as friction [N m]."""
        rigid = self.links.columns(q, v, a) @ self.links.nominal
        return np.asarray(rigid + 0.05 * self.effort * np.sign(v))


@dataclass(frozen=True, eq=False)
class RobotDesign:
    """The designed motion of a robot.

    Attributes:
        joints: Names. limits: By joint. bases: Functions of each joint's motion. x: (n, m) their parameters.
        repeats: Periods. expected, sentences: What it is expected to bring.
        value, start_value: Of the criterion, designed and of the best random motion.
        pairs: Pairs of shapes that could touch. distance: Least distance that was asked for [m].
    """

    joints: tuple[str, ...]
    limits: tuple[JointLimits, ...]
    bases: tuple[MotionBasis, ...]
    x: FloatArray
    repeats: int
    expected: tuple[Expected, ...]
    sentences: tuple[str, ...]
    value: float
    start_value: float
    pairs: int
    distance: float

    def motion(self, rate_hz: float) -> tuple[FloatArray, dict[str, FloatArray]]:
        """(time (T,), joint to motion (4, T)): all joints lead in together and begin and end at rest."""
        period = self.bases[0].period
        made, leads = [], []
        for joint, limits, basis, x in zip(self.joints, self.limits, self.bases, self.x, strict=True):
            one = basis.motion(x)
            leads.append((lead_in(one[:3, 0], limits, joint), lead_in(one[:3, 0] * [1, -1, 1], limits, joint)))
            made.append(one)
        length = max(found[1] for pair in leads for found in pair)
        whole = self.repeats * period
        time = np.arange(round((whole + 2.0 * length) * rate_hz) + 1) / rate_hz
        out = {}
        for joint, basis, one, pair in zip(self.joints, self.bases, made, leads, strict=True):
            grid = np.arange(one.shape[1] + 1) * basis.step
            closed = np.concatenate([one, one[:, :1]], axis=1)
            rows = np.stack([np.interp(np.mod(time - length, period), grid, row) for row in closed])
            out[joint] = _with_leads(rows, time, (length, whole), one[:3, 0], pair)
        return time, out


def _with_leads(
    rows: FloatArray,
    time: FloatArray,
    lengths: tuple[float, float],
    state: FloatArray,
    leads: tuple[tuple[float, float], tuple[float, float]],
) -> FloatArray:
    """The motion (4, T) with rest, lead-in, lead-out and rest in place of what lies outside the periods."""
    length, whole = lengths
    (start, first), (end, last) = leads
    before = time < length
    at = np.maximum(time[before] - (length - first), 0.0)
    rows[:, before] = quintic(np.array([start, 0.0, 0.0]), state, first, at)
    after = time > length + whole
    left = np.maximum(last - (time[after] - length - whole), 0.0)
    turned = np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    rows[:, after] = turned * quintic(np.array([end, 0.0, 0.0]), state * [1.0, -1.0, 1.0], last, left)
    for resting in (time < length - first, time > length + whole + last):
        rows[1:, resting] = 0.0
    return rows


@dataclass(frozen=True)
class RobotOptions:
    """How a robot's motion is looked for: see `design.run.DesignOptions`. distance: between links, at least [m]."""

    duration: float = 30.0
    basis: BasisKind = "fourier"
    smallest: bool = False
    starts: int = 2
    iterations: int = 15
    seed: int = 0
    distance: float = 0.01


def robot_limits(robot: Robot, **given: float | None) -> tuple[JointLimits, ...]:
    """Of the robot file, narrowed by what is given (velocity, acceleration, jerk, bandwidth_hz).

    Raises:
        ParamsError: Limits that are not possible.
    """
    known = joint_limits(robot)
    out = []
    for i in range(len(robot.joints)):
        middle = float(robot.posture[i])
        low = float(known.lower[i]) if np.isfinite(known.lower[i]) else middle - UNKNOWN_SPAN
        high = float(known.upper[i]) if np.isfinite(known.upper[i]) else middle + UNKNOWN_SPAN
        speed = float(known.velocity[i]) if np.isfinite(known.velocity[i]) else 2.0
        speed = min(speed, given.get("velocity") or np.inf)
        effort = float(known.effort[i]) if np.isfinite(known.effort[i]) else np.inf
        limits = JointLimits(
            position=(low, high),
            velocity=speed,
            acceleration=given.get("acceleration") or speed / ACCELERATION_TIME,
            jerk=given.get("jerk") or np.inf,
            torque=min(effort, given.get("torque") or np.inf),
            bandwidth_hz=given.get("bandwidth_hz") or BANDWIDTH_HZ,
        )
        out.append(limits)
    return tuple(out)


def design_robot(
    robot: Robot,
    limits: tuple[JointLimits, ...],
    options: RobotOptions,
    progress: Progress = lambda text, share: None,
) -> RobotDesign:
    """The best motion of a robot with a fixed base.

    Args:
        robot: From `load_robot`.
        limits: Of each joint.
        options: How it is looked for.
        progress: Told how far it is.

    Raises:
        ParamsError: The robot touches itself in the middle of its motion, or no motion keeps the limits.
        IdentificationError: A robot whose base is not fixed.
    """
    collision = SelfCollision(robot, options.distance)
    if not collision.allows(robot.posture[None, :]):
        raise ParamsError(
            f"{robot.source}: in its posture the robot's links are closer than {options.distance:g} m; give another "
            "posture in the robot file, or a smaller --distance"
        )
    links = link_model(robot)
    rng = np.random.default_rng(options.seed)
    repeats = max(1, round(options.duration / PERIOD))
    period = options.duration / repeats
    bases = tuple(
        scaled(motion_basis(options.basis, period, STEP, each.bandwidth_hz, FREQUENCIES), each) for each in limits
    )
    goal = _goal(links, limits, options, bases, rng)
    search = _Search(robot, bases, tuple(each.with_margin(0.02) for each in limits), goal, collision)
    tried = []
    for number in range(10):
        x = search.random(rng)
        tried.append((search.value(x), x))
        progress("random motions", 0.15 * (number + 1) / 10)
    tried.sort(key=lambda pair: -pair[0])
    best = tried[0]
    for number, (_, start) in enumerate(tried[: options.starts]):
        x = search.within(search.solve(start, options.iterations))
        best = max(best, (search.value(x), x), key=lambda pair: pair[0])
        progress(f"start {number + 1} of {options.starts}", 0.15 + 0.85 * (number + 1) / options.starts)
    return _described(robot, limits, options, search, repeats, best, tried[0][0])


def _goal(
    links: LinkModel,
    limits: tuple[JointLimits, ...],
    options: RobotOptions,
    bases: tuple[MotionBasis, ...],
    rng: np.random.Generator,
) -> RobotGoal:
    n = len(limits)
    q = np.stack([rng.uniform(*each.position, 300) for each in limits], axis=-1)
    v, a = (
        np.stack([rng.uniform(-1.0, 1.0, 300) * getattr(each, name) for each in limits], axis=-1)
        for name in ("velocity", "acceleration")
    )
    columns = links.columns(q, v, a).reshape(300 * n, -1)
    base = independent_columns(columns)
    effort = np.array([each.torque for each in limits])
    typical = np.sqrt(np.mean((links.columns(q, v, a) @ links.nominal) ** 2, axis=0))
    effort = np.where(np.isfinite(effort), effort, 3.0 * np.maximum(typical, 1e-3))
    speed = np.array([each.velocity for each in limits])
    scale = np.maximum(links.deviations(1.0)[base], 1e-9)
    return RobotGoal(links, base, scale, effort, speed, options.duration, options.smallest)


@dataclass(frozen=True, eq=False)
class _Search:
    """The program of one robot."""

    robot: Robot
    bases: tuple[MotionBasis, ...]
    limits: tuple[JointLimits, ...]
    goal: RobotGoal
    collision: SelfCollision

    def motions(self, x: FloatArray) -> FloatArray:
        """(4, T, n) of x (n, m)."""
        return np.stack([b.motion(row) for b, row in zip(self.bases, x, strict=True)], axis=-1)

    def value(self, x: FloatArray) -> float:
        """Of the criterion."""
        q, v, a, _ = self.motions(x)
        return self.goal.value(q, v, a)

    def random(self, rng: np.random.Generator) -> FloatArray:
        """A random motion about the robot's posture that keeps all limits."""
        x = rng.normal(size=(len(self.bases), self.bases[0].size)) * 0.5
        return self.within(x)

    def default(self, duration: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(q, v, a) (T, n) of a growing sinusoid of each joint, at frequencies that differ, within all limits."""
        time: FloatArray = np.asarray(np.arange(round(duration / STEP)) * STEP, dtype=np.float64)
        size = 1.0
        while True:
            made = []
            for i, (each, centre) in enumerate(zip(self.limits, self.robot.posture, strict=True)):
                low, high = each.position
                half = size * 0.5 * (high - low)
                bounds = MotionLimits(each.position, each.velocity, each.acceleration)
                middle = float(np.clip(centre, low + 0.05 * (high - low), high - 0.05 * (high - low)))
                grows = 0.95 * half / duration
                made.append(growing_sinusoid(time, DEFAULT_HZ * (1.0 + 0.1 * i), 0.05 * half, grows, bounds, middle))
            q, v, a = (
                np.stack([getattr(m, name) for m in made], axis=-1) for name in ("position", "velocity", "acceleration")
            )
            if (np.abs(self.goal.torque(q, v, a)) <= self.goal.effort).all() or size < 0.01:
                return q, v, a
            size *= 0.8

    def within(self, x: FloatArray) -> FloatArray:
        """The motion shrunk about the posture until it keeps limits, torques and distances.

        Raises:
            ParamsError: Not even a motion of a thousandth of the size keeps them.
        """
        centre = np.array([np.clip(p, *each.position) for p, each in zip(self.robot.posture, self.limits, strict=True)])
        rows = []
        for basis, limits, row, middle in zip(self.bases, self.limits, x, centre, strict=True):
            ones = np.linalg.lstsq(basis.matrices[0], np.ones(basis.matrices.shape[1]), rcond=None)[0]
            own = float(np.mean(basis.matrices[0] @ row))
            low, high = limits.position
            mean = float(
                np.clip(own if abs(own) > 1e-9 else middle, low + 0.05 * (high - low), high - 0.05 * (high - low))
            )
            swing = row - own * ones
            q, v, a, j = basis.matrices @ swing
            rooms = (
                (high - mean, q.max()), (mean - low, -q.min()), (limits.velocity, np.abs(v).max()),
                (limits.acceleration, np.abs(a).max()), (limits.jerk, np.abs(j).max()),
            )  # fmt: skip
            share = min([1.0, *(float(room / size) for room, size in rooms if size > 0.0)])
            rows.append((mean, ones, share * swing, middle))
        factor = 1.0
        while factor > 1e-3:
            tried = np.stack([(m + (1.0 - factor) * (c - m)) * one + factor * s for m, one, s, c in rows])
            if self._allowed(tried):
                return tried
            factor *= 0.8
        raise ParamsError(
            f"{self.robot.source}: no motion about the posture keeps the torque limits and the distance between links"
        )

    def _allowed(self, x: FloatArray) -> bool:
        q, v, a, _ = self.motions(x)
        if (np.abs(self.goal.torque(q, v, a)) > self.goal.effort).any():
            return False
        every = max(1, q.shape[0] // CHECKED_SAMPLES)
        return not self.collision.active or self.collision.allows(q[::every])

    def solve(self, start: FloatArray, iterations: int) -> FloatArray:
        """What the solver finds from a start (n, m)."""
        program: Any = MathematicalProgram()
        n, m = start.shape
        x = program.NewContinuousVariables(n * m, "x")
        for i, (basis, limits) in enumerate(zip(self.bases, self.limits, strict=True)):
            mine = x[i * m : (i + 1) * m]
            low, high = limits.position
            bounds = ((low, high), *((-b, b) for b in (limits.velocity, limits.acceleration, limits.jerk)))
            for order, (lower, upper) in enumerate(bounds):
                if np.isfinite(upper):
                    rows = basis.matrices[order, ::3]
                    program.AddLinearConstraint(rows, np.full(len(rows), lower), np.full(len(rows), upper), mine)
        if self.collision.active:
            self._add_distances(program, x, (n, m))
        program.AddCost(self._cost((n, m)), vars=x)
        options = SolverOptions()
        options.SetOption(SnoptSolver.id(), "Major iterations limit", iterations)
        options.SetOption(SnoptSolver.id(), "Timing level", 0)
        solver: Any = SnoptSolver()
        found = np.asarray(solver.Solve(program, start.ravel(), options).GetSolution(x)).reshape(n, m)
        return found if np.isfinite(found).all() else start

    def _cost(self, shape: tuple[int, int]) -> Callable[[Any], Any]:
        """-criterion; a joint's parameters move that joint alone, so its slopes come from its own columns."""

        def cost(at: Any) -> Any:
            if at.dtype != object:
                return -self.value(at.reshape(shape))
            plain = ExtractValue(at).ravel()
            here = self.value(plain.reshape(shape))
            steps = DIFFERENCE * np.eye(plain.size)
            slope = np.array([(self.value((plain + s).reshape(shape)) - here) / DIFFERENCE for s in steps])
            return AutoDiffXd(-here, -slope @ ExtractGradient(at))

        return cost

    def _add_distances(self, program: Any, x: Any, shape: tuple[int, int]) -> None:
        """The minimum distance at samples of one period."""
        n, m = shape
        samples = np.linspace(0, self.bases[0].matrices.shape[1] - 1, COLLISION_SAMPLES).astype(int)
        for k in samples:
            rows = np.zeros((n, n * m))
            for i, basis in enumerate(self.bases):
                rows[i, i * m : (i + 1) * m] = basis.matrices[0, k]

            def distance(at: Any, rows: FloatArray = rows) -> Any:
                if at.dtype != object:
                    return np.array([self.collision.value(rows @ at)])
                value, slope = self.collision.gradient(rows @ ExtractValue(at).ravel())
                return np.array([AutoDiffXd(value, slope @ rows @ ExtractGradient(at))])

            program.AddConstraint(distance, lb=np.array([-np.inf]), ub=np.array([1.0]), vars=x)


def _described(
    robot: Robot,
    limits: tuple[JointLimits, ...],
    options: RobotOptions,
    search: _Search,
    repeats: int,
    best: tuple[float, FloatArray],
    start_value: float,
) -> RobotDesign:
    """Intervals of all parameters with the designed motion and with a growing sinusoid of each joint."""
    goal = search.goal
    spreads = []
    motion = search.motions(best[1])
    for q, v, a in (search.default(options.duration), (motion[0], motion[1], motion[2])):
        eigen, vectors = np.linalg.eigh(goal.information(q, v, a))
        spreads.append(np.sqrt(np.sum(vectors**2 / np.maximum(eigen, 1e-12), axis=1)))
    names = [goal.links.tree.parameters[i] for i in goal.base]
    units = list(goal.scale)
    for joint, effort, speed in zip(robot.joints, goal.effort, goal.speed, strict=True):
        names += [f"{joint}/viscous", f"{joint}/coulomb"]
        units += [0.05 * effort / speed, 0.05 * effort]
    rows = tuple(
        Expected(f"{name}, half 95 % interval", "SI", float("nan"), 1.96 * u * float(d), 1.96 * u * float(b))
        for name, u, d, b in zip(names, units, *spreads, strict=True)
    )
    ratio = float(np.median(spreads[1] / spreads[0]))
    text = (
        f"The 95 % intervals of {goal.base.size} base parameters and of all friction after the designed motion are "
        f"{ratio:.2g} times as wide as those after growing sinusoids of all joints within the same limits (median)."
    )
    return RobotDesign(
        robot.joints, limits, search.bases, best[1], repeats, rows, (text,), best[0], start_value,
        search.collision.pairs, options.distance,
    )  # fmt: skip
