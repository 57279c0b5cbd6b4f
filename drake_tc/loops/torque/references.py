"""What a scenario asks of the joints and the contacts, on the ticks of the controller."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.control.trajectories import knot_trajectory
from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios import ForceSpec, MotionSpec, SinusoidSpec
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class References:
    """One row a tick.

    Attributes:
        time: (T,) [s].
        motion: (T, 3n) [q_d; qdot_d; qddot_d].
        force: (T, 6k) f_d at the contacts [f; t], base axes.
    """

    time: FloatArray
    motion: FloatArray
    force: FloatArray


def references(scenario: Scenario, robot: Robot) -> References:
    """The scenario's references for a robot.

    Raises:
        ParamsError: a joint or a sensor that the robot does not have, knots that do not fit their times, or positions
            beyond a joint's range.
    """
    time = np.arange(round(scenario.duration / scenario.dt) + 2, dtype=np.float64) * scenario.dt
    motion = _motion(scenario.motion, robot, time)
    check_range(robot, time, motion[:, : len(robot.joints)], "motion")
    return References(time, motion, _force(scenario, robot, time))


BEYOND = 1e-6
"""A position this far beyond the end of a joint's range is at the end [rad]."""


def check_range(robot: Robot, time: FloatArray, position: FloatArray, what: str) -> None:
    """References are within the joints' ranges.

    Args:
        robot: Whose.
        time: (T,) [s].
        position: (T, n) [rad].
        what: Where they come from, for the message.

    Raises:
        ParamsError: one is not; names the joint that is farthest beyond its range, and when.
    """
    limits = joint_limits(robot)
    beyond = np.maximum(position - limits.upper, limits.lower - position)
    row, joint = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    if beyond[row, joint] > BEYOND:
        raise ParamsError(
            f"{what}: {robot.joints[joint]}: expected {limits.lower[joint]:g} to {limits.upper[joint]:g} rad, got"
            f" {position[row, joint]:.4g} at {time[row]:.4g} s"
        )


def table_source(time: FloatArray, values: FloatArray) -> TrajectorySource:
    """A source that holds row k of `values` (T, m) from half a tick before `time[k]` on."""
    tick = time[1] - time[0]
    hold: Any = PiecewisePolynomial.ZeroOrderHold  # the stubs ask for lists; the functions take arrays too
    return TrajectorySource(hold(time - 0.5 * tick, values.T.copy()))


def posture(motion: MotionSpec, robot: Robot) -> FloatArray:
    """(n,) [rad] where the motion rests: its own posture over the robot's.

    Raises:
        ParamsError: a joint that the robot does not have, or a position beyond its limits.
    """
    rest, limits = robot.posture.copy(), joint_limits(robot)
    for joint, position in motion.posture.items():
        i = _index(joint, robot, "motion.posture")
        if not limits.lower[i] <= position <= limits.upper[i]:
            raise ParamsError(
                f"motion.posture.{joint}: expected {limits.lower[i]:g} to {limits.upper[i]:g} rad, got {position:g}"
            )
        rest[i] = position
    return rest


def _index(joint: str, robot: Robot, where: str) -> int:
    if joint not in robot.joints:
        raise ParamsError(f"{where}: no joint {joint!r}; joints of {robot.name}: {', '.join(robot.joints)}")
    return robot.joints.index(joint)


def _motion(spec: MotionSpec, robot: Robot, time: FloatArray) -> FloatArray:
    n = len(robot.joints)
    table = np.zeros((time.size, 3, n))
    table[:, 0] = posture(spec, robot)
    for joint, positions in spec.knots.items():
        i = _index(joint, robot, "motion.knots")
        if len(positions) != len(spec.times):
            raise ParamsError(f"motion.knots.{joint}: expected {len(spec.times)} positions, got {len(positions)}")
        path = knot_trajectory(np.array(spec.times), np.array(positions)[:, None])
        inside = np.clip(time, path.start_time(), path.end_time())
        for order in range(3):
            derivative = path.MakeDerivative(order) if order else path
            table[:, order, i] = [derivative.value(t)[0, 0] for t in inside]
        moving = (time >= path.start_time()) & (time <= path.end_time())
        table[~moving, 1:, i] = 0.0
    for joint, sinusoid in spec.sinusoids.items():
        table[:, :, _index(joint, robot, "motion.sinusoids")] += _sinusoid(sinusoid, time)
    return table.reshape(time.size, 3 * n)


def _sinusoid(spec: SinusoidSpec, time: FloatArray) -> FloatArray:
    """(T, 3) of (start + growth t) sin(2 pi f t) and its derivatives (Del Prete et al., 2016, section 3)."""
    omega = 2.0 * np.pi * spec.frequency_hz
    size, sine, cosine = spec.start + spec.growth * time, np.sin(omega * time), np.cos(omega * time)
    return np.stack(
        [
            size * sine,
            spec.growth * sine + size * omega * cosine,
            2.0 * spec.growth * omega * cosine - size * omega**2 * sine,
        ],
        axis=1,
    )


def _force(scenario: Scenario, robot: Robot, time: FloatArray) -> FloatArray:
    names = [mount.name for mount in robot.force_torque]
    table = np.zeros((time.size, 6 * len(names)))
    for name, spec in scenario.force.items():
        if name not in names:
            raise ParamsError(f"force: no F/T sensor {name!r}; those of {robot.name}: {', '.join(names) or 'none'}")
        at = 6 * names.index(name)
        table[:, at : at + 6] = _wave(spec, time)
    return table


def _wave(spec: ForceSpec, time: FloatArray) -> FloatArray:
    """(T, 6): 0 before `begin`, risen over `ramp` by a smooth step, then offset and sine."""
    rise = risen((time - spec.begin) / spec.ramp)
    sine = np.sin(2.0 * np.pi * spec.frequency_hz * (time - spec.begin))
    return np.asarray(rise[:, None] * (np.array(spec.offset) + sine[:, None] * np.array(spec.amplitude)))


def risen(share: FloatArray) -> FloatArray:
    """A rise over its share x of the time: 0 before 0, 1 after 1, 10 x^3 - 15 x^4 + 6 x^5 between."""
    x = np.clip(share, 0.0, 1.0)
    return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * x**2))
