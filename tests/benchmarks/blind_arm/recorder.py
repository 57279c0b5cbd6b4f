"""One run of a simulated arm: a Fourier series of motion, the efforts that produce it, and what the sensors record.

The motion is given and Drake's inverse dynamics, with the true inertias, says which torques produce it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from pydrake.multibody.tree import MultibodyForces

from drake_tc.logs.rig import COMMAND_COLUMN
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray
from tests.benchmarks.blind_arm.physics import JointMotion, JointTruth, effort, lead

if TYPE_CHECKING:
    from tests.benchmarks.blind_arm.cases import ArmCase

STEP = 2e-3
"""Of the simulation [s]."""
EVERY = 5
"""Simulated steps a row of the log: 100 Hz."""
HARMONICS = np.arange(1, 13)
BASE_HZ = 0.05
TURN = 2.0 * np.pi
MOST_TRAVEL = 1.2
"""Amplitude about the middle [rad], at most."""
MOST_ACCELERATION = 6.0
"""[rad/s^2]"""


@dataclass(frozen=True)
class Noise:
    """What the sensors add, by joint.

    Attributes:
        encoder_step: [rad]. encoder: White noise before the rounding [rad]. effort: White noise [effort].
    """

    encoder_step: Mapping[str, float]
    encoder: Mapping[str, float]
    effort: Mapping[str, float]

    @staticmethod
    def draw(names: Sequence[str], joints: Mapping[str, JointTruth], rng: np.random.Generator) -> "Noise":
        """Encoders of 17 to 19 bits a turn, noise of the effort of 2 to 10 % of the Coulomb friction."""
        step = {j: 2.0 * np.pi / 2.0 ** float(rng.integers(17, 20)) for j in names}
        return Noise(
            step,
            {j: 0.5 * step[j] for j in names},
            {j: float(rng.uniform(0.02, 0.1)) * joints[j].coulomb * joints[j].gain for j in names},
        )


def fourier(
    time: FloatArray, lower: float, upper: float, speed: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """q, v, a (T,) of a Fourier series about the middle of a range, scaled to the limits of travel, speed and rate.

    Args:
        time: (T,) [s].
        lower: End of the joint's range [rad].
        upper: Other end [rad].
        speed: Largest speed [rad/s].
        rng: Draws amplitudes and phases.
    """
    omega = 2.0 * np.pi * BASE_HZ * HARMONICS
    weight = rng.uniform(0.3, 1.0, HARMONICS.size) / HARMONICS**0.7
    angle = time[:, None] * omega + rng.uniform(0.0, 2.0 * np.pi, HARMONICS.size)
    q, v, a = np.sin(angle) @ weight, np.cos(angle) @ (weight * omega), -np.sin(angle) @ (weight * omega**2)
    middle, room = 0.5 * (lower + upper), 0.45 * (upper - lower)
    room = min(room, MOST_TRAVEL)
    scale = min(room / np.abs(q).max(), speed / np.abs(v).max(), MOST_ACCELERATION / np.abs(a).max())
    return middle + scale * q, scale * v, scale * a


@dataclass(frozen=True, eq=False)
class SimulatedArm:
    """An arm whose runs can be recorded.

    Attributes:
        case: What is simulated. robot: Its file.
        plant: Of the robot. context: Of the plant, with the true inertias.
        noise: Of the sensors.
    """

    case: "ArmCase"
    robot: Robot
    plant: Any
    context: Any
    noise: Noise


def record_run(arm: SimulatedArm, number: int, rng: np.random.Generator, seconds: float) -> dict[str, FloatArray]:
    """Columns of the log of one run, whose motion is a Fourier series.

    Args:
        arm: What is simulated.
        number: Of the run.
        rng: Draws motion and noise.
        seconds: Length [s].
    """
    time = np.arange(round(seconds / STEP) + 1, dtype=np.float64) * STEP
    limits = joint_limits(arm.robot)
    motions = [
        fourier(time, max(low, -TURN), min(high, TURN), speed, rng)
        for low, high, speed in zip(limits.lower, limits.upper, arm.case.arm.speed, strict=True)
    ]
    q, v, a = (np.stack([m[i] for m in motions], axis=1) for i in range(3))
    return record_motion(arm, number, rng, time, (q, v, a))


def record_motion(
    arm: SimulatedArm,
    number: int,
    rng: np.random.Generator,
    time: FloatArray,
    motion: tuple[FloatArray, FloatArray, FloatArray],
) -> dict[str, FloatArray]:
    """Columns of the log of a run with a given motion.

    Args:
        arm: What is simulated.
        number: Of the run.
        rng: Draws temperature and noise.
        time: (T,) at a step of `STEP` [s].
        motion: q, qdot, qddot of all joints, each (T, n) [rad, rad/s, rad/s^2].
    """
    case, noise, (q, v, a) = arm.case, arm.noise, motion
    load = _inverse_dynamics(arm.plant, arm.context, arm.robot, (q, v, a))
    columns: dict[str, FloatArray] = {"time": time[::EVERY]}
    for i, joint in enumerate(case.arm.joints):
        warm = 24.0 + 6.0 * ((number + i) % 3) + rng.uniform(6.0, 12.0) * -np.expm1(-time / 12.0)
        y = effort(case.joints[joint], JointMotion(time, q[:, i], v[:, i], a[:, i], load[:, i], warm))
        seen = lead(q[:, i], time, -case.late[joint])[::EVERY]
        seen = seen + case.offsets.get(joint, 0.0) + noise.encoder[joint] * rng.standard_normal(seen.size)
        step = noise.encoder_step[joint]
        columns[f"{joint}/position"] = np.round(seen / step) * step
        read = y[::EVERY] + noise.effort[joint] * rng.standard_normal(seen.size)
        servo = case.drive == "position_servo"
        command = q[::EVERY, i] + case.offsets.get(joint, 0.0) + read if servo else read
        columns[f"{joint}/{COMMAND_COLUMN[case.drive]}"] = command
        columns[f"{joint}/temperature"] = np.round(warm[::EVERY] + 0.05 * rng.standard_normal(seen.size), 1)
    return columns


def _inverse_dynamics(plant: Any, context: Any, robot: Robot, motion: Sequence[FloatArray]) -> FloatArray:
    """(T, n) link-side torques [N m] in the robot's order."""
    places = [plant.GetJointByName(joint).velocity_start() for joint in robot.joints]
    torque, forces = np.empty_like(motion[0]), MultibodyForces(plant)
    state, rate = np.zeros(2 * plant.num_positions()), np.zeros(plant.num_velocities())
    for row, (q, v, a) in enumerate(zip(*motion, strict=True)):
        state[places], rate[places] = q, a
        state[plant.num_positions() + np.array(places)] = v
        plant.SetPositionsAndVelocities(context, state)
        plant.CalcForceElementsContribution(context, forces)
        torque[row] = plant.CalcInverseDynamics(context, rate, forces)[places]
    return torque
