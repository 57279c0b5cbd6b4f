"""A motion of a whole robot that identifies its links and its joints' friction.

    tau_i = Y_i(q, qdot, qddot) pi + F_v,i qdot_i + F_c,i sign(qdot_i) + J_i qddot_i

J_i takes part where the rig file declares a rotor inertia of unknown value and no combination of links imitates it.
With the columns of the base parameters of pi, in units of their tolerances, the joints' own columns and the
noise s_i [N m] of its torque, M = sum_i Z_i' Z_i n/(T s_i^2); D: max log det M, E: max lambda_min(M).

Source: Swevers, Ganseman, Tukel, De Schutter and Van Brussel (1997) for Fourier series under limits; the friction
columns and the minimum distance between links are added here.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import BPoly

from drake_tc.config.joint_units import JointType, JointUnits
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.basis import BasisKind, MotionBasis, motion_basis, scaled
from drake_tc.experiments.design.collisions import Collisions
from drake_tc.experiments.design.lead import lead_in, quintic
from drake_tc.experiments.design.limits import JointLimits
from drake_tc.experiments.design.robot_goal import robot_goal
from drake_tc.experiments.design.robot_search import STEP, RobotSearch
from drake_tc.experiments.design.run import Expected
from drake_tc.robot.link_parameters import link_model
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.robot.urdf_tree import read_urdf
from drake_tc.types import FloatArray

Progress = Callable[[str, float], None]
PERIOD = 10.0
BANDWIDTH_HZ = 0.8
FREQUENCIES = 4
LEAD_RATE_HZ = 10.0
"""Rate at which the whole motion, from rest to rest, is held against the distance [Hz]."""
ACCELERATION_TIME = 0.4
"""Time in which a joint may reach its largest speed [s]: the acceleration limit where the robot file gives none."""
UNKNOWN_SPAN = np.pi
"""Travel of a joint that turns and has no position limits, to both sides of its posture [rad]."""
UNKNOWN_SPEED: Mapping[JointType, float] = {"revolute": 2.0, "prismatic": 0.2}
"""Largest speed of a joint without a limit of its speed [rad/s or m/s]."""


@dataclass(frozen=True, eq=False)
class RobotDesign:
    """The designed motion of a robot.

    Attributes:
        joints: Names. limits: By joint. bases: Functions of each joint's motion. x: (n, m) their parameters.
        repeats: Periods. expected, sentences: What it is expected to bring.
        value, start_value: Of the criterion, designed and of the best random motion.
        pairs: Pairs of shapes that could touch. distance: Least distance that was asked for [m].
        sinusoids: (3, T, n) q, qdot, qddot of the growing sinusoids that it is compared with, at a step of `STEP`.
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
    sinusoids: FloatArray

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
            spline, place = BPoly.from_derivatives(grid, closed[:3].T), np.mod(time - length, period)
            rows = np.stack([spline(place, order) for order in range(4)])
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
    """How a robot's motion is looked for: see `design.run.DesignOptions`.

    Attributes:
        duration, basis, smallest, starts, iterations, seed: As there.
        distance: Between links, and from the scene, at least [m].
        scene: File of what stands around the robot.
        rotors: Joints whose rotor inertia is fitted along with the links.
    """

    duration: float = 30.0
    basis: BasisKind = "fourier"
    smallest: bool = False
    starts: int = 2
    iterations: int = 15
    seed: int = 0
    distance: float = 0.01
    scene: Path | None = None
    rotors: tuple[str, ...] = ()


def robot_limits(robot: Robot, **given: float | None) -> tuple[JointLimits, ...]:
    """Of the robot file, narrowed by what is given (velocity, acceleration, jerk, bandwidth_hz).

    Raises:
        ParamsError: Limits that are not possible, or a joint that slides without position limits.
    """
    for name, value in given.items():
        if value is not None and not value > 0.0:
            raise ParamsError(f"{name}: expected a positive limit, got {value:g}")
    known, tags = joint_limits(robot), read_urdf(robot.urdf, robot.splits).joints
    out = []
    for i, name in enumerate(robot.joints):
        kind: JointType = "prismatic" if tags[name].kind == "prismatic" else "revolute"
        if kind == "prismatic" and not np.isfinite([known.lower[i], known.upper[i]]).all():
            raise ParamsError(
                f"joint {name} slides and has no position limits; state them in the URDF, or in the robot file as "
                f"limits: {{{name}: {{lower: ..., upper: ...}}}} [m]"
            )
        middle = float(robot.posture[i])
        low = float(known.lower[i]) if np.isfinite(known.lower[i]) else middle - UNKNOWN_SPAN
        high = float(known.upper[i]) if np.isfinite(known.upper[i]) else middle + UNKNOWN_SPAN
        speed = float(known.velocity[i]) if np.isfinite(known.velocity[i]) else UNKNOWN_SPEED[kind]
        speed = min(speed, given.get("velocity") or np.inf)
        effort = float(known.effort[i]) if np.isfinite(known.effort[i]) else np.inf
        limits = JointLimits(
            position=(low, high),
            velocity=speed,
            acceleration=given.get("acceleration") or speed / ACCELERATION_TIME,
            jerk=given.get("jerk") or np.inf,
            torque=min(effort, given.get("torque") or np.inf),
            bandwidth_hz=given.get("bandwidth_hz") or BANDWIDTH_HZ,
            units=JointUnits(kind),
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
    collision = Collisions(robot, options.distance, options.scene)
    if not collision.allows(robot.posture[None, :]):
        where = "" if options.scene is None else f" to each other or to {options.scene.name}"
        raise ParamsError(
            f"{robot.source}: in its posture the robot's links are closer than {options.distance:g} m{where}; give "
            "another posture in the robot file, or a smaller --distance"
        )
    links = link_model(robot)
    rng = np.random.default_rng(options.seed)
    repeats = max(1, round(options.duration / PERIOD))
    period = options.duration / repeats
    bases = tuple(
        scaled(motion_basis(options.basis, period, STEP, each.bandwidth_hz, FREQUENCIES), each) for each in limits
    )
    rotors = [i for i, name in enumerate(robot.joints) if name in options.rotors]
    goal = robot_goal(links, limits, options.duration, options.smallest, rng, rotors)
    search = RobotSearch(robot, bases, tuple(each.with_margin(0.02) for each in limits), goal, collision)
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


def _described(
    robot: Robot,
    limits: tuple[JointLimits, ...],
    options: RobotOptions,
    search: RobotSearch,
    repeats: int,
    best: tuple[float, FloatArray],
    start_value: float,
) -> RobotDesign:
    """Intervals of all parameters with the designed motion and with a growing sinusoid of each joint."""
    goal = search.goal
    spreads = []
    sinusoids = np.stack(search.default(options.duration))
    for q, v, a in (sinusoids, search.motions(best[1])[:3]):
        eigen, vectors = np.linalg.eigh(goal.information(q, v, a))
        spreads.append(np.sqrt(np.sum(vectors**2 / np.maximum(eigen, 1e-12), axis=1)))
    names, units = goal.names(robot.joints), goal.units
    rows = tuple(
        Expected(f"{name}, half 95 % interval", "SI", float("nan"), 1.96 * u * float(d), 1.96 * u * float(b))
        for name, u, d, b in zip(names, units.tolist(), *spreads, strict=True)
    )
    rotors = f" and {len(goal.rotors)} rotor inertias" if goal.rotors else ""
    ratio = float(np.median(spreads[1] / spreads[0]))
    text = (
        f"The 95 % intervals of {goal.base.size} base parameters and of all friction{rotors} after the designed motion "
        f"are {ratio:.2g} times as wide as those after growing sinusoids of all joints within the same limits (median)."
    )
    made = RobotDesign(
        robot.joints, limits, search.bases, best[1], repeats, rows, (text, *search.collision.sentences), best[0],
        start_value,
        search.collision.pairs, options.distance, sinusoids,
    )  # fmt: skip
    motions = made.motion(LEAD_RATE_HZ)[1]
    if search.collision.allows(np.stack([motions[name][0] for name in robot.joints], axis=-1)):
        return made
    warning = (
        f"On the way from rest into the motion or out of it, links come closer than {options.distance:g} m: raise "
        "--distance, or move the robot to the motion's first posture with a planner."
    )
    return replace(made, sentences=(*made.sentences, warning))
