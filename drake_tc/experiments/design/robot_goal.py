"""The criterion of a robot's motion: information about its links' base parameters and its joints' friction."""

from dataclasses import dataclass

import numpy as np

from drake_tc.experiments.design.limits import JointLimits
from drake_tc.identification.base_parameters import independent_columns
from drake_tc.robot.link_parameters import LinkModel
from drake_tc.types import FloatArray, IntArray

NOISE_SHARE = 0.005
"""Noise of a joint's torque over its effort limit."""
PER_SECOND = 20.0
"""Independent samples a second."""


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


def robot_goal(
    links: LinkModel,
    limits: tuple[JointLimits, ...],
    duration: float,
    smallest: bool,
    rng: np.random.Generator,
) -> RobotGoal:
    """The criterion of a robot: base parameters from random states within the limits."""
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
    return RobotGoal(links, base, scale, effort, speed, duration, smallest)
