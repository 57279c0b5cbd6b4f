"""The criterion of a robot's motion: information about its links' base parameters, joint friction and rotors."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.experiments.design.limits import JointLimits
from drake_tc.identification.base_parameters import independent_columns
from drake_tc.robot.link_parameters import LinkModel
from drake_tc.types import FloatArray, IntArray

NOISE_SHARE = 0.005
"""Noise of a joint's torque over its effort limit."""
LEFT_OF_ROTOR = 1e-5
"""Share of the column of a rotor that the links must leave."""
PER_SECOND = 20.0
"""Independent samples a second."""


@dataclass(frozen=True, eq=False)
class RobotGoal:
    """The criterion for a whole robot.

    Attributes:
        links: Kinematics and nominal parameters. base: (b,) indices of the base parameters.
        scale: (b,) their tolerances.
        effort, speed, acceleration: (n,) limits [N m], [rad/s], [rad/s^2].
        rotors: Indices of the joints whose rotor inertia is estimated along.
        duration: Of the experiment [s]. smallest: E- instead of D-optimality.
    """

    links: LinkModel
    base: IntArray
    scale: FloatArray
    effort: FloatArray
    speed: FloatArray
    duration: float
    smallest: bool
    acceleration: FloatArray
    rotors: tuple[int, ...] = ()

    @property
    def units(self) -> FloatArray:
        """(b + 2 n + r,) sizes of the parameters: tolerances, and 5 % of the effort limit for a joint's own."""
        part = 0.05 * self.effort
        friction = np.stack([part / self.speed, part], axis=-1).ravel()
        rotors = [part[i] / self.acceleration[i] for i in self.rotors]
        return np.concatenate([self.scale, friction, rotors])

    def names(self, joints: Sequence[str]) -> list[str]:
        """Of the same parameters."""
        friction = [f"{joint}/{name}" for joint in joints for name in ("viscous", "coulomb")]
        base = [self.links.tree.parameters[i] for i in self.base]
        return [*base, *friction, *(f"{joints[i]}/rotor_inertia" for i in self.rotors)]

    def information(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """M (b + 2 n + r, b + 2 n + r) of motions (T, n), in the units of the parameters."""
        count, n = q.shape
        y = self.links.columns(q, v, a)[:, :, self.base] * self.scale
        direction = np.tanh(v / (0.04 * self.speed))
        friction = self.base.size + 2 * n
        size = friction + len(self.rotors)
        out = np.zeros((size, size))
        rate = PER_SECOND * self.duration / count
        for i in range(n):
            z = np.zeros((count, size))
            z[:, : self.base.size] = y[:, i]
            z[:, self.base.size + 2 * i] = 0.05 * self.effort[i] * v[:, i] / self.speed[i]
            z[:, self.base.size + 2 * i + 1] = 0.05 * self.effort[i] * direction[:, i]
            if i in self.rotors:
                z[:, friction + self.rotors.index(i)] = 0.05 * self.effort[i] * a[:, i] / self.acceleration[i]
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


def robot_goal(
    links: LinkModel,
    limits: tuple[JointLimits, ...],
    duration: float,
    smallest: bool,
    rng: np.random.Generator,
    rotors: Sequence[int] = (),
) -> RobotGoal:
    """The criterion of a robot: base parameters from random states within the limits.

    Args:
        links: Kinematics and nominal parameters.
        limits: Of each joint.
        duration: Of the experiment [s].
        smallest: E- instead of D-optimality.
        rng: Of the states.
        rotors: Joints whose rotor inertia is fitted. One that the links imitate, as that of the first joint, is left
            out.
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
    return RobotGoal(links, base, scale, effort, speed, duration, smallest, acceleration, own)


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
