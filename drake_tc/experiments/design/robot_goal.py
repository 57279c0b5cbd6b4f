"""Optimality criteria of a robot's motion: functions of the information M (P, P), with their slopes df/dM.

With C = M^-1 and the standard errors s_i = sqrt(C_ii), of which t_i are those after the growing sinusoids,

    intervals:  f = -P log sum_i w_i s_i^2,   w_i = 1/(G |g| t_i^2),                df/dM = P C W C/sum_i w_i s_i^2
    D:          f = log det M,                                                      df/dM = C
    E:          f = log lambda_min(M), with the unit eigenvector u,                 df/dM = u u'/lambda_min

W is diagonal. The G groups are base parameters, friction coefficients and rotor inertias, and |g| is the size of that
of parameter i. The first criterion is A-optimality in units of the default's variances, with the same weight for each
group. D-optimality accepts wider intervals of a few friction coefficients for narrower ones of many base parameters.

What a robot's motion tells: information about its links' base parameters, joint friction and rotors.

    M = sum_i Z_i' Z_i n_i/(T s_i^2)

Z_i (T, P): columns of joint i in units of the parameters, s_i [N m]: noise, n_i: independent samples of the experiment.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from drake_tc.experiments.design.joint import PER_SECOND, TURN_SPEED
from drake_tc.experiments.design.motions import JointLimits
from drake_tc.identification.regression import independent_columns
from drake_tc.robot.rigid_regressor import LinkModel
from drake_tc.types import FloatArray, IntArray

CriterionName = Literal["intervals", "D", "E"]
LEAST = 1e-9
"""Smallest eigenvalue that is counted."""
InformationCriterion: TypeAlias = Callable[[FloatArray], tuple[float, FloatArray]]
"""M (P, P) to (f, df/dM (P, P)); a larger f is better."""


def d_optimality(information: FloatArray) -> tuple[float, FloatArray]:
    """Log det M and its slope."""
    eigen, vectors = _eigen(information)
    return float(np.sum(np.log(eigen))), np.asarray((vectors / eigen) @ vectors.T)


def e_optimality(information: FloatArray) -> tuple[float, FloatArray]:
    """Log lambda_min(M) and its slope."""
    eigen, vectors = _eigen(information)
    return float(np.log(eigen[0])), np.outer(vectors[:, 0], vectors[:, 0]) / eigen[0]


def a_optimality(reference: FloatArray, groups: Sequence[IntArray]) -> InformationCriterion:
    """The criterion of the intervals: 0 for the default motion, and 2P log 2 where all are half as wide.

    Args:
        reference: (P,) standard errors t_i after the default motion.
        groups: Indices of the parameters of each group.
    """
    size, weights = reference.size, np.zeros(reference.size)
    for group in groups:
        weights[group] = 1.0 / (len(groups) * group.size * reference[group] ** 2)

    def criterion(information: FloatArray) -> tuple[float, FloatArray]:
        eigen, vectors = _eigen(information)
        covariance = (vectors / eigen) @ vectors.T
        mean = float(weights @ np.diag(covariance))
        return -size * float(np.log(mean)), np.asarray(size / mean * (covariance * weights) @ covariance)

    return criterion


def standard_errors(information: FloatArray) -> FloatArray:
    """(P,) square roots of the diagonal of M^-1 (Cramer and Rao)."""
    eigen, vectors = np.linalg.eigh(information)
    return np.asarray(np.sqrt(np.sum(vectors**2 / np.maximum(eigen, 1e-12), axis=1)))


def _eigen(information: FloatArray) -> tuple[FloatArray, FloatArray]:
    eigen, vectors = np.linalg.eigh(information)
    return np.maximum(eigen, LEAST), vectors


Motion = tuple[FloatArray, FloatArray, FloatArray]
NOISE_SHARE = 0.005
"""Noise of a joint's torque over its effort limit, where no log tells it."""
LEFT_OF_ROTOR = 1e-5
"""Share of the column of a rotor that the links must leave."""
FRICTION_SHARE = 0.05
"""Friction that a design assumes, over the effort limit."""
TORQUE_PENALTY = 1e3
"""Of the mean square of the torques' excess, in units of the limits."""
TORQUE_MARGIN = 0.03
"""Share by which the penalty narrows the limits of torque, so that its optimum hardly exceeds them."""
DIFFERENCE = 1e-6
"""Step of the forward differences in position and speed [rad, rad/s]; torques are linear in the acceleration."""


@dataclass(frozen=True, eq=False)
class RobotNoise:
    """What the next run's noise will be, by joint.

    Attributes:
        torque: (n,) RMS that noise leaves of each joint's torque [N m].
        per_second: (n,) independent samples in it [1/s].
    """

    torque: FloatArray
    per_second: FloatArray


@dataclass(frozen=True, eq=False)
class RobotGoal:
    """The information that a motion of a whole robot gives.

    Attributes:
        links: Kinematics and nominal parameters. base: (b,) indices of the base parameters.
        scale: (b,) their tolerances.
        effort, speed, acceleration: (n,) limits [N m], [rad/s], [rad/s^2].
        noise: Of the joints' torques.
        rotors: Indices of the joints whose rotor inertia is estimated along.
        duration: Of the experiment [s].
    """

    links: LinkModel
    base: IntArray
    scale: FloatArray
    effort: FloatArray
    speed: FloatArray
    duration: float
    acceleration: FloatArray
    noise: RobotNoise
    rotors: tuple[int, ...] = ()

    @property
    def units(self) -> FloatArray:
        """(b + 2 n + r,) sizes of the parameters: tolerances, and 5 % of the effort limit for a joint's own."""
        part = FRICTION_SHARE * self.effort
        friction = np.stack([part / self.speed, part], axis=-1).ravel()
        rotors = [part[i] / self.acceleration[i] for i in self.rotors]
        return np.concatenate([self.scale, friction, rotors])

    @property
    def groups(self) -> dict[str, IntArray]:
        """Name to indices: base parameters, friction coefficients and, where there are some, rotor inertias."""
        first, last = self.base.size, self.base.size + 2 * self.effort.size
        named = {"base parameters": np.arange(first), "friction coefficients": np.arange(first, last)}
        return named | ({"rotor inertias": last + np.arange(len(self.rotors))} if self.rotors else {})

    def names(self, joints: Sequence[str]) -> list[str]:
        """Of the same parameters."""
        friction = [f"{joint}/{name}" for joint in joints for name in ("viscous", "coulomb")]
        base = [self.links.tree.parameters[i] for i in self.base]
        return [*base, *friction, *(f"{joints[i]}/rotor_inertia" for i in self.rotors)]

    def information(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """M (b + 2 n + r, b + 2 n + r) of motions (T, n), in the units of the parameters."""
        z = self._columns(self.links.columns(q, v, a), v, a)
        return np.asarray(z.T @ z)

    def torque(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """(T, n) of the nominal links, with 5 % of the effort limit as friction [N m]."""
        rigid = self.links.columns(q, v, a) @ self.links.nominal
        return np.asarray(rigid + FRICTION_SHARE * self.effort * np.sign(v))

    def value(self, criterion: InformationCriterion, motion: Motion) -> float:
        """The criterion of q, v, a (T, n), less a penalty for torques beyond the limits."""
        q, v, a = motion
        rigid = self.links.columns(q, v, a)
        z = self._columns(rigid, v, a)
        excess, _ = self._excess(rigid, v)
        return criterion(z.T @ z)[0] - TORQUE_PENALTY * float(np.mean(excess**2))

    def value_and_slopes(self, criterion: InformationCriterion, motion: Motion) -> tuple[float, FloatArray]:
        """(f, (3, T, n) its slopes by q, v and a), the same.

        With G = df/dM and the whitened columns Z, df = 2 sum (Z G) dZ. Z is linear in the rigid columns Y, so that the
        slopes by a joint's motion need the scalar sum W Y with a constant W alone, at a motion changed at all samples
        at once.
        """
        q, v, a = motion
        rigid = self.links.columns(q, v, a)
        z = self._columns(rigid, v, a)
        value, by_information = criterion(z.T @ z)
        by_column = (2.0 * z @ by_information).reshape(*v.shape, -1) * self._weights(len(v))[:, None]
        excess, sign = self._excess(rigid, v)
        value -= TORQUE_PENALTY * float(np.mean(excess**2))
        by_torque = -2.0 * TORQUE_PENALTY / excess.size * excess * sign / self._allowed
        weight = by_torque[:, :, None] * self.links.nominal
        weight[:, :, self.base] += by_column[:, :, : self.base.size] * self.scale

        def weighed(at: Motion) -> FloatArray:
            return np.asarray(np.einsum("tip,tip->t", self.links.columns(*at), weight))

        here, slopes = np.einsum("tip,tip->t", rigid, weight), np.zeros((3, *v.shape))
        for order, step in enumerate((DIFFERENCE, DIFFERENCE, 1.0)):
            for i in range(v.shape[1]):
                moved = [q.copy(), v.copy(), a.copy()]
                moved[order][:, i] += step
                slopes[order, :, i] = (weighed((moved[0], moved[1], moved[2])) - here) / step
        self._add_own_slopes(slopes, by_column, by_torque, v)
        return value, slopes

    def _add_own_slopes(self, slopes: FloatArray, by_column: FloatArray, by_torque: FloatArray, v: FloatArray) -> None:
        """Add what a joint's own columns, friction and rotor, have of the slopes (3, T, n)."""
        part, first = FRICTION_SHARE * self.effort, self.base.size
        turning = (1.0 - self._direction(v) ** 2) / (TURN_SPEED * self.speed)
        for i in range(v.shape[1]):
            viscous, coulomb = by_column[:, i, first + 2 * i], by_column[:, i, first + 2 * i + 1]
            own = viscous / self.speed[i] + (coulomb + by_torque[:, i]) * turning[:, i]
            slopes[1, :, i] += part[i] * own
        for k, i in enumerate(self.rotors):
            place = first + 2 * v.shape[1] + k
            slopes[2, :, i] += part[i] * by_column[:, i, place] / self.acceleration[i]

    def _weights(self, count: int) -> FloatArray:
        """(n,) roots of the information per squared newton metre of each of so many rows."""
        return np.asarray(np.sqrt(self.noise.per_second * self.duration / count) / self.noise.torque)

    def _direction(self, v: FloatArray) -> FloatArray:
        return np.asarray(np.tanh(v / (TURN_SPEED * self.speed)))

    def _columns(self, rigid: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Z (T n, b + 2 n + r), divided by the noise, from Y (T, n, 10 n): M = Z' Z."""
        count, n = v.shape
        first = self.base.size
        z = np.zeros((count, n, first + 2 * n + len(self.rotors)))
        z[:, :, :first] = rigid[:, :, self.base] * self.scale
        direction, part = self._direction(v), FRICTION_SHARE * self.effort
        for i in range(n):
            z[:, i, first + 2 * i] = part[i] * v[:, i] / self.speed[i]
            z[:, i, first + 2 * i + 1] = part[i] * direction[:, i]
        for k, i in enumerate(self.rotors):
            z[:, i, first + 2 * n + k] = part[i] * a[:, i] / self.acceleration[i]
        return np.asarray((z * self._weights(count)[:, None]).reshape(count * n, -1))

    @property
    def _allowed(self) -> FloatArray:
        return (1.0 - TORQUE_MARGIN) * self.effort

    def _excess(self, rigid: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """((T, n) torque beyond the narrowed limits, over them, (T, n) sign of the torque)."""
        torque = rigid @ self.links.nominal + FRICTION_SHARE * self.effort * self._direction(v)
        return np.maximum(np.abs(torque) / self._allowed - 1.0, 0.0), np.sign(torque)


def robot_goal(
    links: LinkModel,
    limits: tuple[JointLimits, ...],
    duration: float,
    rng: np.random.Generator,
    rotors: Sequence[int] = (),
    noise: RobotNoise | None = None,
) -> RobotGoal:
    """The parameters of a robot: base parameters from random states within the limits.

    Args:
        links: Kinematics and nominal parameters.
        limits: Of each joint.
        duration: Of the experiment [s].
        rng: Of the states.
        rotors: Joints whose rotor inertia is fitted. One that the links imitate, as that of the first joint, is left
            out.
        noise: Of the joints' torques; None takes `NOISE_SHARE` and `PER_SECOND`.
    """
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
    acceleration = np.array([each.acceleration for each in limits])
    own = independent_rotors(columns[:, base], a, rotors)
    known = noise or RobotNoise(NOISE_SHARE * effort, np.full(n, PER_SECOND))
    return RobotGoal(links, base, scale, effort, speed, duration, acceleration, known, own)


def independent_rotors(base: FloatArray, acceleration: FloatArray, rotors: Sequence[int]) -> tuple[int, ...]:
    """Those of the rotors whose column, the acceleration (T, n) of their joint, no combination of others makes.

    Args:
        base: (T n, b) columns of the links, joint by joint for each sample.
        acceleration: (T, n) of the same samples.
        rotors: Indices of joints.
    """
    unit = base / np.linalg.norm(base, axis=0)
    kept: list[int] = []
    for i in rotors:
        column = np.zeros_like(acceleration)
        column[:, i] = acceleration[:, i] / np.linalg.norm(acceleration[:, i])
        flat = column.ravel()
        if np.linalg.norm(flat - unit @ np.linalg.lstsq(unit, flat, rcond=None)[0]) > LEFT_OF_ROTOR:
            kept.append(i)
            unit = np.column_stack([unit, flat])
    return tuple(kept)
