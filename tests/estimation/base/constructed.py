"""A motion whose truth is known by construction, and what the sensors read along it.

The base moves as prescribed. A foot turns as prescribed about its centre of pressure, whose point of the foot is at
rest: p_C is integrated by exact small rotations about that point. Legs follow by inverse kinematics. Loads are those
of a point mass, shared between the feet; readings come from Drake's frames and centres of mass, not from the code
under test.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.multibody.tree import JacobianWrtVariable
from scipy.spatial.transform import Rotation

from drake_tc.estimation.base_log import BaseTrack, SensorLog
from drake_tc.estimation.base_rig import BaseEstimatorSpec, ContactSpec
from drake_tc.robot.fields import Mount, Pose
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import Robot, load_robot

ROOT = Path(__file__).resolve().parents[3]
SIDES = ("left", "right")
HALF = np.array([0.1, 0.05])
"""Half length and width of the soles that the motions use [m]; inside the real ones."""
SOLE = ((-0.1, -0.05), (0.1, -0.05), (0.1, 0.05), (-0.1, 0.05))
G = 9.81


@lru_cache(maxsize=1)
def walker() -> Robot:
    return load_robot(ROOT / "models" / "hrp2_like" / "hrp2_like.yaml")


def spec(period: float, **changes: Any) -> BaseEstimatorSpec:
    contacts = tuple(
        ContactSpec(Mount(side, f"{side[0]}_foot", Pose((0.0, 0.0, -0.055))), SOLE, f"{side}_ankle", 30.0, 20.0)
        for side in SIDES
    )
    return BaseEstimatorSpec(contacts, period, **changes)


@dataclass(frozen=True)
class Noise:
    """Standard deviations; gyro bias."""

    encoder: float = 0.0
    velocity: float = 0.0
    gyro: float = 0.0
    accel: float = 0.0
    tilt: float = 0.0
    force: float = 0.0
    moment: float = 0.0
    gyro_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)


REAL = Noise(1e-4, 5e-3, 3e-3, 0.05, 1e-3, 1.0, 0.05, (0.003, -0.002, 0.004))


@dataclass(frozen=True)
class Motion:
    """How the robot moves; times in seconds, angles in rad.

    tilt, pivot: amplitude of each foot's tilt about its outer edge and turn about its centre of pressure.
    creep: rate at which both feet turn about their centres of pressure all the time, one way [rad/s].
    slip: (foot, begin, end, velocity (3,)) of a foot that slides.
    lift: (foot, begin, end): a foot in the air, following a small hop.
    """

    duration: float = 6.0
    period: float = 2e-3
    rest: float = 0.5
    frequency: float = 0.5
    yaw: float = 0.25
    sway: float = 0.03
    roll: float = 0.04
    tilt: float = 0.06
    pivot: float = 0.04
    creep: float = 0.0
    cop: float = 0.02
    slip: tuple[int, float, float, tuple[float, float, float]] | None = None
    lift: tuple[int, float, float] | None = None


@dataclass(frozen=True)
class Constructed:
    log: SensorLog
    truth: BaseTrack
    body_velocity: np.ndarray
    cop: np.ndarray  # (T, 2, 2) in the feet
    feet: list = field(default_factory=list)


def _ramp(t, rest):
    """0 while at rest, smoothly to 1 within one second after."""
    s = np.clip(t - rest, 0.0, 1.0)
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)


def base_pose(motion: Motion, t):
    """(position (T, 3), Rotation) of the base; the start is the robot file's pose."""
    a, w = _ramp(t, motion.rest), 2.0 * np.pi * motion.frequency * (t - motion.rest)
    start = np.array(walker().base_pose.xyz)
    step = np.stack(
        [0.5 * motion.sway * np.sin(w), motion.sway * np.sin(w), 0.3 * motion.sway * (np.cos(2 * w) - 1.0)], axis=-1
    )
    rpy = np.stack([motion.roll * np.sin(w), 0.5 * motion.roll * np.sin(2 * w), motion.yaw * np.sin(w)], axis=-1)
    down = np.array([0.0, 0.0, -0.04])  # knees bend a little more, so that no leg gets straight
    return start + a[..., None] * (step + down), Rotation.from_euler("xyz", a[..., None] * rpy)


def foot_motion(motion: Motion, side: int, t, start):
    """(p_C (T, 3), R (T, 3, 3), cop (T, 2)) of a foot: turns about its centre of pressure, which is at rest."""
    a, w = _ramp(t, motion.rest), 2.0 * np.pi * motion.frequency * (t - motion.rest)
    outward = 1.0 if side == 0 else -1.0
    lean = np.maximum(0.0, outward * np.sin(w)) ** 2
    x = motion.cop * a * np.sin(1.3 * w)
    edge = np.clip(6.0 * a * np.maximum(0.0, outward * np.sin(w) + 0.2), 0.0, 1.0) if motion.tilt else 0.0 * t
    cop = np.stack([x, outward * HALF[1] * edge * edge * (3.0 - 2.0 * edge)], axis=1)
    roll = -outward * motion.tilt * a * lean
    yaw = motion.pivot * a * np.sin(w) + motion.creep * np.maximum(0.0, t - motion.rest) * a
    turn = Rotation.from_euler("xyz", np.stack([roll, 0.0 * t, yaw], axis=1))
    R = turn.as_matrix()
    p = np.empty((len(t), 3))
    p[0] = start
    slide = np.zeros_like(p)
    if motion.slip is not None and motion.slip[0] == side:
        _, begin, end, velocity = motion.slip
        slide[(t > begin) & (t <= end)] = np.array(velocity) * motion.period
    full = np.column_stack([cop, 0.0 * t])
    for i in range(1, len(t)):
        x = 0.5 * (full[i - 1] + full[i])
        still = p[i - 1] + R[i - 1] @ x  # a point of the foot, at rest while the foot turns about it
        p[i] = still - R[i] @ x + slide[i]
    if motion.lift is not None and motion.lift[0] == side:
        _, begin, end = motion.lift
        s = np.clip((t - begin) / (end - begin), 0.0, 1.0)
        p[:, 2] += 0.03 * np.sin(np.pi * s) ** 2
        p[:, 0] += 0.05 * s * s * (3.0 - 2.0 * s)
    return p, R, cop


def shares(motion: Motion, t):
    """(T, 2) of the load on the feet."""
    a, w = _ramp(t, motion.rest), 2.0 * np.pi * motion.frequency * (t - motion.rest)
    left = 0.5 + 0.3 * a * np.sin(w)
    if motion.lift is not None:
        foot, begin, end = motion.lift
        off = np.clip((t - begin + 0.2) / 0.2, 0.0, 1.0) * np.clip((end + 0.2 - t) / 0.2, 0.0, 1.0)
        goal = 0.0 if foot == 0 else 1.0
        left = left + (goal - left) * off
    return np.column_stack([left, 1.0 - left])


@lru_cache(maxsize=4)
def construct(motion: Motion, noise: Noise = Noise(), seed: int = 0) -> Constructed:
    """Sensors and truth along a motion; the same object for the same motion."""
    robot = walker()
    plant: Any = make_plant(robot, 0.0)
    context = plant.CreateDefaultContext()
    t = np.arange(0.0, motion.duration, motion.period)
    position, rotation = base_pose(motion, t)
    h = 1e-4

    def derivative(f):
        return (f(t + h) - f(t - h)) / (2.0 * h)

    velocity = derivative(lambda u: base_pose(motion, u)[0])
    rate = (base_pose(motion, t - h)[1].inv() * base_pose(motion, t + h)[1]).as_rotvec() / (2.0 * h)  # in B
    frames = [plant.GetFrameByName(f"{side[0]}_foot") for side in SIDES]
    sole = np.array([0.0, 0.0, -0.055])
    legs = [
        [i for i, name in enumerate(robot.joints) if name.startswith(side[0] + "_") and _leg(name)] for side in SIDES
    ]
    joints = [plant.GetJointByName(name) for name in robot.joints]
    at = np.array([joint.position_start() for joint in joints])
    vat = np.array([joint.velocity_start() for joint in joints])
    q = plant.GetPositions(context).copy()
    starts = [plant.CalcPointsPositions(context, frame, sole, plant.world_frame()).ravel() for frame in frames]
    feet = [foot_motion(motion, i, t, np.array([*starts[i][:2], 0.0])) for i in range(2)]
    speeds = [_speeds(*foot[:2], motion.period) for foot in feet]
    Q, QD = np.empty((len(t), len(joints))), np.zeros((len(t), len(joints)))
    wrench = np.empty((len(t), 2, 6))
    mass = plant.CalcTotalMass(context)
    above = [_sensor(plant, context, robot, side) for side in SIDES]
    share = shares(motion, t)
    acceleration = (base_pose(motion, t + h)[0] - 2.0 * position + base_pose(motion, t - h)[0]) / h**2
    for k in range(len(t)):
        q[:4], q[4:7] = rotation[k].as_quat()[[3, 0, 1, 2]], position[k]
        for foot, frame, leg in zip(feet, frames, legs, strict=True):
            _reach(plant, context, q, frame, sole, foot[0][k], foot[1][k], at[leg], vat[leg])
        plant.SetPositions(context, q)
        spatial = np.concatenate([rotation[k].apply(rate[k]), velocity[k]])
        for i, (frame, leg) in enumerate(zip(frames, legs, strict=True)):
            J = _jacobian(plant, context, frame, sole)
            wanted = np.concatenate([speeds[i][1][k], speeds[i][0][k]]) - J[:, :6] @ spatial
            QD[k, leg] = np.linalg.solve(J[:, vat[leg]], wanted)
            force = share[k, i] * mass * (acceleration[k] + [0.0, 0.0, G])
            point = feet[i][0][k] + feet[i][1][k] @ np.array([*feet[i][2][k], 0.0])
            wrench[k, i] = above[i](context, force, point)
        Q[k] = q[at]
    gyro, accel, tilt = _imu(plant, context, robot, motion, t, rate, h)
    rng = np.random.default_rng(seed)
    log = SensorLog(
        time=t,
        q=Q + noise.encoder * rng.normal(size=Q.shape),
        qd=QD + noise.velocity * rng.normal(size=Q.shape),
        gyro=gyro + noise.gyro_bias + noise.gyro * rng.normal(size=gyro.shape),
        accel=accel + noise.accel * rng.normal(size=accel.shape),
        tilt=tilt + noise.tilt * rng.normal(size=tilt.shape),
        wrench=wrench + np.repeat([noise.force, noise.moment], 3) * rng.normal(size=wrench.shape),
        switch=np.zeros((len(t), 2)),
    )
    rpy = np.unwrap(rotation.as_euler("xyz"), axis=0)
    truth = BaseTrack(t, position, rpy, velocity, np.zeros((len(t), 0)), np.zeros((len(t), 0)), np.zeros((len(t), 0)))
    return Constructed(log, truth, rotation.inv().apply(velocity), np.stack([foot[2] for foot in feet], axis=1), feet)


def _leg(name: str) -> bool:
    return any(part in name for part in ("hip", "knee", "ankle"))


def _speeds(p, R, dt):
    """Central differences: (v (T, 3), omega (T, 3)) in the world."""
    v = np.gradient(p, dt, axis=0)
    step = Rotation.from_matrix(R[2:] @ R[:-2].transpose(0, 2, 1)).as_rotvec() / (2.0 * dt)
    return v, np.concatenate([step[:1], step, step[-1:]])


def _jacobian(plant, context, frame, point):
    world = plant.world_frame()
    return plant.CalcJacobianSpatialVelocity(context, JacobianWrtVariable.kV, frame, point, world, world)


def _reach(plant, context, q, frame, point, p, R, at, vat):
    """Newton on one leg, in place."""
    for _ in range(20):
        plant.SetPositions(context, q)
        X = frame.CalcPoseInWorld(context)
        error = np.concatenate([Rotation.from_matrix(R @ X.rotation().matrix().T).as_rotvec(), p - X.multiply(point)])
        if np.abs(error).max() < 1e-11:
            return
        q[at] += np.linalg.solve(_jacobian(plant, context, frame, point)[:, vat], error)
    raise AssertionError("a leg cannot reach its foot")


def _sensor(plant, context, robot, side):
    """What the ankle sensor reads of a force at a point, and of the foot's weight."""
    mount = next(item for item in robot.force_torque if item.name == f"{side}_ankle")
    foot = plant.GetBodyByName(f"{side[0]}_foot")
    assert mount.pose == Pose()
    m, centre = foot.get_mass(context), foot.CalcCenterOfMassInBodyFrame(context)

    def read(context, force, point):
        X = foot.EvalPoseInWorld(context)
        weight = np.array([0.0, 0.0, -m * G])
        moment = np.cross(point - X.translation(), force) + np.cross(X.multiply(centre) - X.translation(), weight)
        R = X.rotation().matrix()
        return np.concatenate([R.T @ (force + weight), R.T @ moment])

    return read


def _imu(plant, context, robot, motion, t, rate, h):
    """Gyro, accelerometer, roll and pitch of an IMU that the waist's resting joints hold against the base."""
    imu = robot.imu[0]
    body = plant.GetBodyByName(robot.base)
    X = (
        body.EvalPoseInWorld(context)
        .inverse()
        .multiply(plant.GetBodyByName(imu.link).EvalPoseInWorld(context).multiply(imu.pose.transform))
    )
    R, p = np.array(X.rotation().matrix()), np.array(X.translation())

    def place(u):
        position, rotation = base_pose(motion, u)
        return position + rotation.apply(p)

    h = 10.0 * h
    acceleration = (place(t + h) - 2.0 * place(t) + place(t - h)) / h**2 + np.array([0.0, 0.0, G])
    rotation = base_pose(motion, t)[1]
    tilt = (rotation * Rotation.from_matrix(R)).as_euler("xyz")[:, :2]
    return rate @ R, rotation.inv().apply(acceleration) @ R, tilt
