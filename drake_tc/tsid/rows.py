"""Named rows over y = (vdot, f, tau): what tasks and limits hand to the program.

The reduced problem over the joint torques alone: a least-squares cost on a polytope.

The robot at one state, as everything in a tick shares it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple, Protocol

import numpy as np

from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.types import FloatArray, IntArray


@cache
def identity(n: int) -> FloatArray:
    """(n, n), read-only and the same object each time, so that rows which are bounds are known at no cost."""
    matrix = np.eye(n)
    matrix.setflags(write=False)
    return matrix


@dataclass(frozen=True, eq=False)
class Parts:
    """A matrix over y by its parts; a part that is None is zero.

    Attributes:
        vdot: (r, nv).
        force: (r, k), k over all contacts that are active.
        torque: (r, n), joints in the robot's order.
    """

    vdot: FloatArray | None = None
    force: FloatArray | None = None
    torque: FloatArray | None = None

    def flat(self) -> list[FloatArray]:
        """All numbers that there are, a vector for each part."""
        return [part.ravel() for part in (self.vdot, self.force, self.torque) if part is not None]


def selection(index: IntArray, velocities: int) -> Parts:
    """Rows of the identity over vdot: the accelerations at `index`, and nothing else."""
    matrix = np.zeros((index.size, velocities))
    matrix[np.arange(index.size), index] = 1.0
    matrix.setflags(write=False)
    return Parts(vdot=matrix)


@dataclass(frozen=True, eq=False)
class TaskRows:
    """sum over rows of (weight (A y - a))^2.

    Attributes:
        name: Of the task.
        matrix: A.
        target: (r,) a.
        weight: (r,) multiplies the rows, so it is squared in the cost (the paper's w_post, w_f).
    """

    name: str
    matrix: Parts
    target: FloatArray
    weight: FloatArray


@dataclass(frozen=True, eq=False)
class LimitRows:
    """lower <= B y <= upper; infinite where a side has no limit.

    Attributes:
        name: Of the limit; the binding of the program has it too.
        group: One of "force", "torque", "acceleration", "capture_point": probabilities are given by group.
        matrix: B.
        lower, upper: (r,).
        labels: (r,) of each row, for people: "r_knee", "left_foot friction +x".
        relaxed: For how many rows a limit had to give way, as limits contradict each other at this state.
    """

    name: str
    group: str
    matrix: Parts
    lower: FloatArray
    upper: FloatArray
    labels: tuple[str, ...]
    relaxed: int = 0


class LeastSquares(NamedTuple):
    """||D tau - d||^2 (Del Prete and Mansard, 2015, eq. 11), row weights multiplied in.

    Attributes:
        matrix: (r, n) D.
        target: (r,) d.
    """

    matrix: FloatArray
    target: FloatArray

    def __call__(self, x: FloatArray) -> float:
        """The cost at x (n,)."""
        error = self.matrix @ x - self.target
        return float(error @ error)


@dataclass(frozen=True, eq=False)
class Polytope:
    """lower <= G tau <= upper; infinite where a side has no limit. Both sides of a row share its sigma.

    Attributes:
        matrix: (m, n) G.
        lower, upper: (m,).
        groups: Rows of each group of limits ("force", "torque", "acceleration", "capture_point").
        labels: (m,) of each row, for people; may be empty.
        bounds: The first `bounds` rows are those of the identity (torque limits), which solvers take for less.
    """

    matrix: FloatArray
    lower: FloatArray
    upper: FloatArray
    groups: Mapping[str, slice] = field(default_factory=dict)
    labels: tuple[str, ...] = ()
    bounds: int = 0

    def violation(self, x: FloatArray) -> float:
        """By how much the worst row is missed at x (n,), in that row's unit; negative inside."""
        value = self.matrix @ x
        return float(np.maximum(self.lower - value, value - self.upper).max(initial=-np.inf))

    def group(self, name: str) -> "Polytope":
        """The rows of one group alone."""
        rows = self.groups[name]
        return Polytope(self.matrix[rows], self.lower[rows], self.upper[rows], {}, self.labels[rows])


Pose = tuple[FloatArray, FloatArray]
"""(3, 3) R_WF and (3,) p_WoFo_W [m]."""


@dataclass(frozen=True, eq=False)
class FrameTerms:
    """A frame F of the robot: where it is, how it moves, and how it would accelerate.

    Attributes:
        rotation: (3, 3) R_WF.
        position: (3,) p_WoFo_W [m].
        velocity: (6,) V_WF = [omega; v] in world axes.
        jacobian: (6, nv) V_WF = J v.
        bias: (6,) [alpha; a] at vdot = 0, so A_WF = J vdot + bias.
    """

    rotation: FloatArray
    position: FloatArray
    velocity: FloatArray
    jacobian: FloatArray
    bias: FloatArray


@dataclass(frozen=True, eq=False)
class Terms:
    """M vdot + h = S^T tau + J^T f at one state (Del Prete et al., 2016, eq. 1).

    There are n driven joints, nv velocities and k contact forces.

    Attributes:
        q, v: (nq,), (nv,) in the plant's order, a floating base first (quaternion, position; omega, velocity).
        mass_matrix: (nv, nv) M, with the reflected rotor inertia of the robot file.
        bias: (nv,) h: Coriolis, centrifugal and gravity.
        actuated: (n,) index in v of each joint, in the robot's order; S^T tau puts tau there.
        joint_position: (n,) in the robot's order [rad].
        contact_jacobian: (k, nv) J of the contacts that are active, one after the other; rows as its contact says.
        contact_bias: (k,) Jdot v.
        contact_velocity: (k,) J v: zero unless a contact slips.
        mass: Of the robot [kg].
        com, com_velocity: (3,) in the world [m, m/s].
        momentum_matrix: (6, nv) A_G: [angular; linear] momentum about the centre of mass, in world axes, = A_G v.
        momentum_bias: (6,) Adot_G v.
        frame: Terms of a frame by name (a link, a contact or an added frame); those that are never asked for cost
            nothing. Good until the scratch memory goes to another state, as is `pose`.
        pose: R_WF and p_WF of a frame by name, for less than `frame`.
        contacts: Which contacts are active, and where each stands in f.
    """

    q: FloatArray
    v: FloatArray
    mass_matrix: FloatArray
    bias: FloatArray
    actuated: IntArray
    joint_position: FloatArray
    contact_jacobian: FloatArray
    contact_bias: FloatArray
    contact_velocity: FloatArray
    mass: float
    com: FloatArray
    com_velocity: FloatArray
    momentum_matrix: FloatArray
    momentum_bias: FloatArray
    frame: Callable[[str], FrameTerms] = field(repr=False)
    pose: Callable[[str], Pose] = field(repr=False)
    contacts: ActiveContacts

    @property
    def com_jacobian(self) -> FloatArray:
        """(3, nv) of the centre of mass: the linear rows of A_G over the mass."""
        jacobian: FloatArray = self.momentum_matrix[3:] / self.mass
        return jacobian

    @property
    def com_bias(self) -> FloatArray:
        """(3,) Jdot_com v [m/s^2]."""
        bias: FloatArray = self.momentum_bias[3:] / self.mass
        return bias


class Task(Protocol):
    """sum over rows of (weight (A y - a))^2 at a state, y = (vdot, f, tau).

    Attributes:
        name: Of the binding in a program and of the reference's port.
        weight: (r,) of each row; it is squared in the cost.
        reference_size: Of the vector that `rows` follows.
    """

    @property
    def name(self) -> str:
        """Of the task."""
        ...

    @property
    def weight(self) -> FloatArray:
        """Of each row."""
        ...

    @property
    def reference_size(self) -> int:
        """Of the vector that `rows` follows."""
        ...

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing where `terms` are: to stay, to rest, no force."""
        ...

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state; never raises on numbers, a NaN stays one."""
        ...


class Limit(Protocol):
    """lower <= B y <= upper at a state, y = (vdot, f, tau).

    Attributes:
        name: Of the binding in a program, and of the rows where constraints conflict.
        group: One of "force", "torque", "acceleration", "capture_point".
    """

    @property
    def name(self) -> str:
        """Of the limit."""
        ...

    @property
    def group(self) -> str:
        """Of the limit."""
        ...

    def rows(self, terms: Terms) -> LimitRows:
        """The rows at this state; never raises, a NaN of the state stays one."""
        ...
