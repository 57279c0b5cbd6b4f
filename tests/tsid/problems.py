"""Real problems for the pieces that take any: the 30-joint robot in double support at states around its posture."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import drake_tc.models
from drake_tc.robot.fields import Mount, Pose
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.tsid.assembly import Reduced, reduce
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.limits import AccelerationLimit, TorqueLimit, WrenchCones
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import LeastSquares, LimitRows, Polytope, TaskRows, Terms
from drake_tc.tsid.tasks import ComTask, ForceTask, PostureTask
from drake_tc.types import FloatArray

FOLDER = Path(drake_tc.models.__file__).parent / "hrp2_like"


def _sole(side: str) -> Contact:
    place = Mount(f"{side}_sole", f"{side[0]}_foot", Pose((0.03, 0.0, -0.055)))
    return Contact(place.name, place, "surface", half_length=0.115, half_width=0.065, friction=0.3)


SOLES = (_sole("right"), _sole("left"))


@cache
def robot() -> Robot:
    """The 30-joint robot, floating."""
    return load_robot(FOLDER / "hrp2_like.yaml")


@cache
def model() -> TsidModel:
    """Its model with both soles."""
    return TsidModel(robot(), SOLES)


@dataclass(frozen=True)
class Setup:
    """The paper's tasks and limits (Del Prete and Mansard, 2015), with any of their numbers changed.

    Attributes:
        force_weight: w_f.
        velocity: Largest of a joint [rad/s]; None for the robot's own.
        torque_share: Of the robot's efforts.
        com_step: How far off the reference of the centre of mass is, at most [m]: larger saturates more.
        speed: Of joints and base, at most [rad/s, m/s].
        lean: How far joints are from the posture, at most [rad].
    """

    force_weight: float = 1e-4
    velocity: float | None = None
    torque_share: float = 1.0
    com_step: float = 0.02
    speed: float = 0.05
    lean: float = 0.05


@dataclass(frozen=True, eq=False)
class Problem:
    """One state, its rows and its reduced problem; `sigma` is the paper's 0.003 of the largest torque."""

    terms: Terms
    tasks: list[TaskRows]
    limits: list[LimitRows]
    reduced: Reduced
    sigma: FloatArray

    @property
    def cost(self) -> LeastSquares:
        return self.reduced.cost

    @property
    def polytope(self) -> Polytope:
        return self.reduced.polytope


def state(rng: np.random.Generator, setup: Setup) -> tuple[FloatArray, FloatArray]:
    """q, v near the posture; the base is turned and moved, and the feet do not slip (J v = 0)."""
    it, q = model(), model().start.copy()
    limits = joint_limits(robot())
    low, high = limits.lower + 0.02, limits.upper - 0.02
    q[it.positions] = np.clip(q[it.positions] + rng.uniform(-1, 1, it.n) * setup.lean, low, high)
    turn = np.concatenate([[1.0], rng.uniform(-1, 1, 3) * setup.lean / 2])
    q[:4] = turn / np.linalg.norm(turn)
    q[4:7] += rng.uniform(-1, 1, 3) * setup.lean
    v = rng.uniform(-1, 1, it.nv) * setup.speed
    jacobian = it.terms(it.create_scratch(), q, v).contact_jacobian
    return q, v - np.linalg.pinv(jacobian) @ (jacobian @ v)


def problem_at(q: FloatArray, v: FloatArray, com_error: FloatArray, setup: Setup = Setup()) -> Problem:
    """The problem at one state; com_error (3,) is added to the CoM for its reference, which rests there."""
    it, machine = model(), robot()
    terms = it.terms(it.create_scratch(), q, v)
    com = ComTask(100.0, 20.0)
    posture = PostureTask(it, 1.0, 1.0, weight=1e-3)
    tasks = [
        com.rows(terms, np.concatenate([terms.com + com_error, np.zeros(6)])),
        posture.rows(terms, np.concatenate([machine.posture, np.zeros(2 * it.n)])),
    ]
    if setup.force_weight:
        force = ForceTask(it, weight=setup.force_weight, components=[1, 1, 1e-3, 2, 2, 2])
        tasks.append(force.rows(terms, np.zeros(it.force_size)))
    torque = TorqueLimit.of(machine, setup.torque_share)
    acceleration = AccelerationLimit.of(it, period=5e-3, velocity=setup.velocity)
    limits = [torque.rows(terms), WrenchCones(SOLES, pyramid="outer").rows(terms), acceleration.rows(terms)]
    return Problem(terms, tasks, limits, reduce(terms, tasks, limits), 0.003 * joint_limits(machine).effort)


def problems(count: int, seed: int, setup: Setup = Setup()) -> Iterator[Problem]:
    """`count` problems at random states, each with an error of its centre of mass."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        q, v = state(rng, setup)
        yield problem_at(q, v, rng.uniform(-1, 1, 3) * setup.com_step, setup)
