"""Joints of one kind side by side: a voltage or current drive, constant friction and a spring without play.

The step of `drake_tc.actuation.joint_program` for all joints at once on arrays, operation by operation, so that the
numbers are the same to the bit. What that program treats apart (a first tick, an input that is not finite) is left to
it. Memory: (n, 9), its fields in the order of `joint_program`.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drake_tc.actuation.constant_parts import split_parts
from drake_tc.actuation.friction import PRESLIDING_DISPLACEMENT
from drake_tc.actuation.gear import Gear, gear_of
from drake_tc.actuation.joint_program import (
    DEFLECTION,
    LOAD,
    MOTOR,
    MOTOR_VELOCITY,
    STARTED,
    TORQUE,
    VELOCITY,
)
from drake_tc.actuation.model import ActuatorModel
from drake_tc.effects.saturation import Saturation
from drake_tc.types import FloatArray, IntArray

LEAST_JOINTS = 9
"""With fewer joints, numbers one by one are faster than arrays."""


class _Joint(NamedTuple):
    """One joint's constants; the last one rounds as `friction_law` does."""

    gear: Gear
    inertia: float
    limit: float
    per_effort: float
    level: float
    damping: float
    rest: float


class _Constants(NamedTuple):
    """Of the joints that a sub-step moves, (k,) each: of their gears and of their friction."""

    compliance: FloatArray
    contact_time: FloatArray
    link: FloatArray
    step: FloatArray
    gain: FloatArray
    rate: FloatArray
    drag: FloatArray
    stiff: FloatArray
    bound: FloatArray
    level: FloatArray
    damping: FloatArray


def spring_joints(models: Sequence[ActuatorModel], inertias: Sequence[float], period: float) -> "SpringJoints | None":
    """All joints at once; None where they are few or one of them is of another kind.

    Args:
        models: One a joint.
        inertias: What the torque of each moves [kg m^2].
        period: Time between updates [s].
    """
    found = [_joint(model, inertia, period) for model, inertia in zip(models, inertias, strict=True)]
    joints = [joint for joint in found if joint is not None]
    return SpringJoints(joints, period) if len(joints) == len(found) >= LEAST_JOINTS else None


def _joint(model: ActuatorModel, inertia: float, period: float) -> _Joint | None:
    gear = gear_of(model, inertia, period)
    (level, damping, rest), kernels = split_parts(model)
    drives = model.drive_effects
    if any(type(effect) is not Saturation for effect, _ in drives) or len(drives) > 1 or kernels:
        return None
    if gear is None or gear.half_gap or model.drive.kind == "position_servo":
        return None
    limit = drives[0][1]["limit"] if drives else np.inf
    return _Joint(gear, inertia, limit, 1.0 / model.drive.gain, max(level, 0.0), max(damping, 0.0), rest)


class SpringJoints:
    """n joints, `LEAST_JOINTS` at least; holds no changing data."""

    def __init__(self, joints: Sequence[_Joint], period: float) -> None:
        """Compile.

        Args:
            joints: Their constants.
            period: Time between updates [s].
        """
        self._n, self._period = len(joints), period
        self._ends = np.ones(len(joints)), np.zeros(len(joints))
        self._compliance = np.array([joint.gear.compliance for joint in joints])
        self._contact_time = np.array([joint.gear.contact_time for joint in joints])
        self._inertia, self._limit, self._per_effort, self._rest = (
            np.array([getattr(joint, name) for joint in joints]) for name in ("inertia", "limit", "per_effort", "rest")
        )
        self._least = -self._limit
        counts = np.array([joint.gear.sub_steps for joint in joints])
        order: IntArray = np.argsort(-counts, kind="stable")
        still = np.array_equal(order, np.arange(order.size))
        self._order, self._back = None if still else order, np.argsort(order)
        self._counts = counts[order].astype(np.float64)
        sorted_joints = [joints[i] for i in order]
        moving = [int((counts > done).sum()) for done in range(int(counts.max()))]
        self._sub_steps = tuple((k, _constants(sorted_joints[:k])) for k in moving)

    def step(
        self, memory: FloatArray, command: FloatArray, q: FloatArray, v: FloatArray, *, at_tick: bool
    ) -> tuple[FloatArray, FloatArray] | None:
        """(n, 5) fields of JointOutput and the next memory (n, 9); None where a joint has to be treated on its own.

        Args:
            memory: (n, 9).
            command: (n,) [A | V].
            q: (n,) of the links [rad].
            v: (n,) of the links [rad/s].
            at_tick: Whether a period has passed since the last update.
        """
        if not (command.dot(command) + q.dot(q) + v.dot(v) < np.inf and self._all_started(memory)):
            return None
        rows = memory.T
        load = rows[LOAD]
        if at_tick:
            load = rows[TORQUE] - self._inertia * ((v - rows[VELOCITY]) / self._period)
        motor = np.maximum(self._least, np.minimum(self._limit, command))
        motor *= self._per_effort
        now = np.array((rows[MOTOR], rows[MOTOR_VELOCITY], rows[DEFLECTION], q, v, load, motor - self._rest))
        if self._order is None:
            passed, friction = self._moved(now)
        else:
            now = now[:, self._order]
            passed, friction = self._moved(now)[:, self._back]
            now = now[:, self._back]
        ones, zeros = self._ends
        after = np.array((ones, now[2], q, v, passed, load, command, now[0], now[1]))
        return np.array((passed, motor, friction, command, zeros)).T, after.T

    def _all_started(self, memory: FloatArray) -> bool:
        """Whether every flag is 1."""
        return bool(memory[:, STARTED].dot(self._ends[0]) == self._n)

    def _moved(self, now: FloatArray) -> FloatArray:
        """(2, n) mean torque through the gears and mean friction; `now` (7, n), sorted, goes to the step's end."""
        sums = np.zeros((2, now.shape[1]))
        for k, c in self._sub_steps:
            theta, omega, z, q, v, load, thrust = now if k == now.shape[1] else now[:, :k]
            tau = (theta - q + c.contact_time * (omega - v)) / c.compliance
            free = omega + c.gain * (thrust - tau)
            share = np.minimum(np.maximum((z + c.stiff * free) / c.bound, -1.0), 1.0)
            dry = c.level * share
            omega[:] = (free - c.gain * dry) / c.drag
            z[:] = np.minimum(np.maximum(z + c.rate * omega, -1.0), 1.0)
            theta += c.step * omega
            v += c.step * (tau - load) / c.link
            q += c.step * v
            sums[0, :k] += tau
            sums[1, :k] += dry + c.damping * omega
        if len(self._sub_steps) > 1:
            sums /= self._counts
        return sums

    def motor_state(self, memory: FloatArray) -> FloatArray | None:
        """(2n,) theta and theta' at a tick; None where a joint has not started.

        Args:
            memory: (n, 9).
        """
        return memory.T[MOTOR : MOTOR_VELOCITY + 1].ravel() if self._all_started(memory) else None

    def transmitted(self, memory: FloatArray, q: FloatArray, v: FloatArray) -> FloatArray | None:
        """(n,) torque through the gears at a tick [N m]; None where a joint has not started.

        Args:
            memory: (n, 9).
            q: (n,) of the links [rad].
            v: (n,) of the links [rad/s].
        """
        if not self._all_started(memory):
            return None
        theta, omega = memory[:, MOTOR], memory[:, MOTOR_VELOCITY]
        return np.asarray((theta - q + self._contact_time * (omega - v)) / self._compliance)


def _constants(joints: Sequence[_Joint]) -> _Constants:
    """As in `friction_law` and `Gear.step`."""
    gears = [joint.gear for joint in joints]
    compliance, contact_time, motor, link, step = (
        np.array([getattr(gear, name) for gear in gears])
        for name in ("compliance", "contact_time", "motor_inertia", "link_inertia", "sub_step")
    )
    level, damping = (np.array([getattr(joint, name) for joint in joints]) for name in ("level", "damping"))
    gain, rate = step / motor, step / PRESLIDING_DISPLACEMENT
    settling = 2.0 * np.sqrt(PRESLIDING_DISPLACEMENT * motor) / step
    drag = 1.0 + gain * damping
    stiff = rate / drag
    dry = level > 0.0
    stiff[dry] *= 1.0 + settling[dry] / np.sqrt(level[dry])
    return _Constants(
        compliance, contact_time, link, step, gain, rate, drag, stiff, 1.0 + stiff * gain * level, level, damping
    )
