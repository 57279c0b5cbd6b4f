"""A motion of a whole robot that identifies its links and its joints' friction.

    tau_i = Y_i(q, qdot, qddot) pi + F_v,i qdot_i + F_c,i sign(qdot_i) + J_i qddot_i

J_i takes part where the rig file declares a rotor inertia of unknown value and no combination of links imitates it.
The information about these parameters is that of `robot_goal`, the criteria are those of `robot_goal` too.

Source: Swevers, Ganseman, Tukel, De Schutter and Van Brussel (1997) for Fourier series under limits; the friction
columns and the minimum distance between links are added here.

Noise of a robot's joint torques, as the logs so far show it.

The noise s_j [N m] of joint j is the RMS residual of the first fit of the diagnosis: declared models, and the links
where these are fitted, of all joints together. Of its rows in T_j seconds, n_j are independent:

    rate_j = n_j/T_j

The information of a second is rate_j/s_j^2. White noise of the effort leaves it the same whatever width the filters of
the next run have: a wider filter lowers s_j^2 and the rate alike.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from drake_tc.config.joint_units import JointType, JointUnits
from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.diagnose import joint_model
from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.intervals import CRITICAL
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.robot.whole import declared_robot
from drake_tc.diagnosis.search import Progress
from drake_tc.errors import ParamsError
from drake_tc.estimation.robot_loads import robot_logs, with_robot_loads
from drake_tc.experiments.design.criteria import Expected
from drake_tc.experiments.design.joint import PER_SECOND
from drake_tc.experiments.design.lead import Experiment
from drake_tc.experiments.design.motions import JointLimits, MotionBasis, motion_basis
from drake_tc.experiments.design.robot_goal import (
    NOISE_SHARE,
    CriterionName,
    RobotGoal,
    RobotNoise,
    a_optimality,
    d_optimality,
    e_optimality,
    robot_goal,
    standard_errors,
)
from drake_tc.experiments.design.robot_search import STEP, Collisions, RobotSearch
from drake_tc.experiments.design.run import DesignOptions
from drake_tc.experiments.fitted import moving_seconds
from drake_tc.logs.prepare import in_order
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.rigid_regressor import link_model
from drake_tc.robot.robot import Robot
from drake_tc.robot.urdf_tree import read_urdf
from drake_tc.types import FloatArray

PERIOD = 15.0
"""Period of the motion [s], about: the experiment holds a whole number of them."""
BANDWIDTH_HZ = 0.8
FREQUENCIES = 12
LEAD_RATE_HZ = 10.0
"""Rate at which the whole motion, from rest to rest, is held against the distance [Hz]."""
ACCELERATION_TIME = 0.4
"""Time in which a joint may reach its largest speed [s]: the acceleration limit where the robot file gives none."""
UNKNOWN_SPAN = np.pi
"""Travel of a joint that turns and has no position limits, to both sides of its posture [rad]."""
UNKNOWN_SPEED: Mapping[JointType, float] = {"revolute": 2.0, "prismatic": 0.2}
"""Largest speed of a joint without a limit of its speed [rad/s or m/s]."""


BETTER_SINUSOIDS = (
    "No designed motion was better than the growing sinusoids, which are therefore the motion of this design."
)


@dataclass(frozen=True, eq=False)
class RobotDesign:
    """The designed motion of a robot.

    Attributes:
        joints: Names. limits: By joint. bases: Functions of each joint's motion. x: (n, m) their parameters.
        repeats: Periods. expected, sentences: What it is expected to bring.
        value, start_value: Of the criterion, designed and of the best random motion.
        pairs: Pairs of shapes that could touch. distance: Least distance that was asked for [m].
        sinusoids: (4, T, n) the growing sinusoids that it is compared with, at a step of `STEP`.
        by_sinusoids: Whether these are the design, because no other motion is better by the criterion.
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
    by_sinusoids: bool = False

    @property
    def best(self) -> FloatArray:
        """(4, T, n) one period of the motion, or the sinusoids where these are the design."""
        if self.by_sinusoids:
            return self.sinusoids
        return np.stack([basis.motion(x) for basis, x in zip(self.bases, self.x, strict=True)], axis=-1)

    def motion(self, rate_hz: float) -> tuple[FloatArray, dict[str, FloatArray]]:
        """(time (T,), joint to motion (4, T)): all joints lead in together and begin and end at rest."""
        periods = 0 if self.by_sinusoids else self.repeats
        return Experiment(self.joints, self.limits, self.best, self.bases[0].step, periods).sampled(rate_hz)


@dataclass(frozen=True)
class RobotOptions(DesignOptions):
    """How a robot's motion is looked for; the criterion is one of `robot_goal`.

    Attributes:
        distance: Between links, and from the scene, at least [m].
        scene: File of what stands around the robot.
        rotors: Joints whose rotor inertia is fitted along with the links.
        noise: Of the joints' torques in the logs so far; None where there are none.
    """

    criterion: CriterionName = "intervals"
    starts: int = 4
    iterations: int = 60
    distance: float = 0.01
    scene: Path | None = None
    rotors: tuple[str, ...] = ()
    noise: RobotNoise | None = None


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
                f"joint {name} is prismatic and has no position limits; state them in the URDF, or in the robot file "
                f"as limits: {{{name}: {{lower: ..., upper: ...}}}} [m]"
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
    rng = np.random.default_rng(options.seed)
    repeats = max(1, round(options.duration / PERIOD))
    period = options.duration / repeats
    bases = tuple(motion_basis(options.basis, period, STEP, each, FREQUENCIES) for each in limits)
    rotors = [i for i, name in enumerate(robot.joints) if name in options.rotors]
    goal = robot_goal(link_model(robot), limits, options.duration, rng, rotors, options.noise)
    tight = tuple(each.with_margin(0.02) for each in limits)
    search = RobotSearch(robot, bases, tight, goal, d_optimality, collision)
    sinusoids = search.default(options.duration)
    default = standard_errors(goal.information(*sinusoids[:3]))
    if options.criterion != "D":
        relative = a_optimality(default, tuple(goal.groups.values()))
        search = replace(search, criterion=relative if options.criterion == "intervals" else e_optimality)
    (value, x), start_value = search.best(rng, options.starts, options.iterations, progress)
    of_sinusoids = search.criterion(goal.information(*sinusoids[:3]))[0]
    worse = of_sinusoids > value and collision.allows(sinusoids[0, :: max(1, round(0.1 / STEP))])
    spread = default if worse else standard_errors(goal.information(*search.motions(x)[:3]))
    expected = tuple(
        Expected(f"{name}, half 95 % interval", "SI", float("nan"), CRITICAL * u * float(d), CRITICAL * u * float(b))
        for name, u, d, b in zip(goal.names(robot.joints), goal.units.tolist(), default, spread, strict=True)
    )
    text = (*_sentences(goal, spread / default, options.noise), *([BETTER_SINUSOIDS] if worse else []))
    made = RobotDesign(
        robot.joints,
        limits,
        bases,
        x,
        repeats,
        expected,
        (*text, *collision.sentences),
        value,
        start_value,
        collision.pairs,
        options.distance,
        sinusoids,
        worse,
    )
    motions = made.motion(LEAD_RATE_HZ)[1]
    if collision.allows(np.stack([motions[name][0] for name in robot.joints], axis=-1)):
        return made
    warning = (
        f"On the way from rest into the motion or out of it, links come closer than {options.distance:g} m: raise "
        "--distance, or move the robot to the motion's first posture with a planner."
    )
    return replace(made, sentences=(*made.sentences, warning))


def _sentences(goal: RobotGoal, ratios: FloatArray, noise: RobotNoise | None) -> tuple[str, ...]:
    """What the motion gains over the sinusoids, by group, and which noise the intervals assume."""
    medians = {name: float(np.median(ratios[group])) for name, group in goal.groups.items()}
    listed = [f"{medians[name]:.2g} for the {name} ({group.size})" for name, group in goal.groups.items()]
    gain = (
        f"The 95 % intervals after the designed motion are {float(np.median(ratios)):.2g} times as wide as those after "
        f"growing sinusoids of all joints within the same limits (median): {', '.join(listed)}."
    )
    worse = [f"Growing sinusoids identify the {name} better." for name, median in medians.items() if median > 1.0]
    unknown = (
        f"The intervals assume a noise of {100.0 * NOISE_SHARE:g} % of each effort limit and {PER_SECOND:g} "
        "independent samples per second, because no log was given; only their ratio is a prediction."
    )
    return (gain, *worse, unknown if noise is None else "The intervals assume the noise of the given logs.")


def robot_noise(rig: Rig, robot: Robot, runs: Sequence[Run]) -> RobotNoise:
    """Noise and independent samples per second of each joint, in the order of the robot's joints.

    Args:
        rig: Of the logs, with a robot.
        robot: The same robot.
        runs: The logs so far, as read.

    Raises:
        ParamsError: The rig file does not list all joints of the robot.
        LogError: A column that the robot's model needs is missing.
        IdentificationError: Logs that do not identify the declared models.
    """
    missing = [name for name in robot.joints if name not in rig.joints]
    if missing:
        raise ParamsError(
            f"{rig.source or 'rig'}: joints: {', '.join(missing)} missing; the noise of all joints of the robot is "
            "needed: list all of them, or design without logs"
        )
    logs, train = robot_logs(rig, runs), in_order(runs, rig)
    fits: dict[str, tuple[Evidence, Scored]] = {}
    if logs is None:
        for name in robot.joints:
            model = joint_model(prepare_joint(train, [], rig, name))
            evidence = Evidence(model).heard(model.declared)
            fits[name] = evidence, evidence.refined(evidence.score(model.declared))
    else:
        fit = declared_robot(logs, with_robot_loads(logs, train, rig.joints), [], rig, DiagnosisOptions())
        fits = {name: (fit.joints[name].evidence, fit.joints[name].best) for name in robot.joints}
    values = np.array([_noise(*fits[name]) for name in robot.joints])
    return RobotNoise(values[:, 0], values[:, 1])


def _noise(evidence: Evidence, scored: Scored) -> tuple[float, float]:
    """(noise [N m], independent samples per second)."""
    split = evidence.model.train
    independent = evidence.noise.share * split.rows.index.size
    seconds = max(moving_seconds(split.samples), 1e-9)
    return rms(evidence.residual(split, scored)) / float(scored.b[0]), independent / seconds
