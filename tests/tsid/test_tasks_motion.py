"""Motion tasks: where A vdot = a, the error obeys edd + kd ed + kp e = 0, by differences along a motion."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from drake_tc.control.rotation import rotation_matrix, rotation_vector
from drake_tc.errors import ParamsError
from drake_tc.robot.plant import make_plant
from drake_tc.tsid.tasks import (
    AngularMomentumTask,
    ComTask,
    CopTask,
    ForceTask,
    FrameTask,
    OrientationTask,
    PostureTask,
)

from .machines import machine, random_state

STEP = 2e-4
KP, KD = np.array([30.0, 40.0, 50.0]), np.array([7.0, 8.0, 9.0])


class Motion:
    """A model on a path of constant vdot through a random state."""

    def __init__(self, name, folder, seed=1):
        self.model = machine(name, folder)
        self.q, self.v = random_state(self.model, seed)
        self.vdot = np.random.default_rng(seed).normal(size=self.model.nv) * 3
        self.plant = make_plant(self.model.robot, 0.0)
        self.context = self.plant.CreateDefaultContext()

    def rate(self, q, v):
        self.plant.SetPositions(self.context, q)
        return self.plant.MapVelocityToQDot(self.context, v)

    def at(self, t):
        """Terms at time t, by one Runge-Kutta step from 0."""
        q, v, a = self.q, self.v, self.vdot
        one = self.rate(q, v)
        two = self.rate(q + t / 2 * one, v + t / 2 * a)
        three = self.rate(q + t / 2 * two, v + t / 2 * a)
        four = self.rate(q + t * three, v + t * a)
        q = q + t / 6 * (one + 2 * two + 2 * three + four)
        return self.model.terms(self.model.create_scratch(), q, v + t * a)

    def missed(self, task, reference):
        """a - A vdot at time 0."""
        rows = task.rows(self.at(0.0), reference)
        return rows.target - rows.matrix.vdot @ self.vdot


def derivatives(error):
    """e, ed, edd of error(t) at 0."""
    behind, now, ahead = error(-STEP), error(0.0), error(STEP)
    return now, (ahead - behind) / (2 * STEP), (ahead - 2 * now + behind) / STEP**2


def path(seed, size):
    """Position, velocity and acceleration of a smooth reference at time t."""
    a, b, c = np.random.default_rng(seed).normal(size=(3, size))
    return lambda t: np.concatenate([a + b * t + c * t**2 / 2, b + c * t, c])


@pytest.fixture(params=["humanoid", "shuffled humanoid", "leg", "arm held by its slider", "floating arm"])
def motion(request, tmp_path):
    return Motion(request.param, tmp_path)


def test_com(motion):
    wanted = path(2, 3)
    e, ed, edd = derivatives(lambda t: wanted(t)[:3] - motion.at(t).com)
    assert_allclose(motion.missed(ComTask(KP, KD), wanted(0.0)), edd + KD * ed + KP * e, rtol=1e-5, atol=1e-4)
    some = ComTask(KP, KD, mask=[True, False, True], weight=[1, 2, 3])
    assert_allclose(motion.missed(some, wanted(0.0)), (edd + KD * ed + KP * e)[[0, 2]], rtol=1e-5, atol=1e-4)
    assert_allclose(some.weight, [1, 3], atol=0)


def test_posture(motion):
    model, n = motion.model, motion.model.n
    wanted = path(3, n)
    kp, kd = np.linspace(1, 50, n), np.linspace(2, 9, n)
    e, ed, edd = derivatives(lambda t: wanted(t)[:n] - motion.at(t).joint_position)
    law = edd + kd * ed + kp * e
    assert_allclose(motion.missed(PostureTask(model, kp, kd), wanted(0.0)), law, rtol=1e-5, atol=1e-4)
    some = PostureTask(model, kp[[2, 0]], kd[[2, 0]], joints=[model.robot.joints[i] for i in (2, 0)])
    assert_allclose(motion.missed(some, wanted(0.0)), law[[2, 0]], rtol=1e-5, atol=1e-4)


def test_angular_momentum(motion):
    wanted = path(4, 3)
    e, ed, _ = derivatives(lambda t: wanted(t)[:3] - motion.at(t).momentum_matrix[:3] @ motion.at(t).v)
    missed = motion.missed(AngularMomentumTask(KP), wanted(0.0)[:6])
    assert_allclose(missed, ed + KP * e, rtol=1e-5, atol=1e-4)


def pose_path(motion, frame, offset):
    """A reference pose that moves along with the frame at time 0, `offset` [rad, m] off, and then on its own."""
    start = motion.at(0.0).frame(frame)
    spin, alpha, a = np.random.default_rng(6).normal(size=(3, 3))
    spin, v = (start.velocity[:3], start.velocity[3:]) if not offset.any() else (spin, spin[::-1])
    base = Rotation.from_rotvec(offset[:3]) * Rotation.from_matrix(start.rotation)

    def wanted(t):
        # R(t) = exp(spin t + alpha t^2 / 2) R(0) has omega = spin and omegadot = alpha at t = 0
        turn = Rotation.from_rotvec(spin * t + alpha * t**2 / 2) * base
        return turn, start.position + offset[3:] + v * t + a * t**2 / 2

    turn, place = wanted(0.0)
    quaternion = turn.as_quat()[[3, 0, 1, 2]] * 1.7
    return wanted, np.concatenate([quaternion, place, spin, v, alpha, a])


@pytest.mark.parametrize("axes_of", ["world", "frame"])
def test_a_frame_on_its_reference(motion, axes_of):
    wanted, reference = pose_path(motion, "tip", np.zeros(6))

    def error(t):
        frame, (turn, place) = motion.at(t).frame("tip"), wanted(t)
        return np.concatenate([(turn * Rotation.from_matrix(frame.rotation).inv()).as_rotvec(), place - frame.position])

    _, _, edd = derivatives(error)
    turn = motion.at(0.0).frame("tip").rotation.T if axes_of == "frame" else np.eye(3)
    task = FrameTask(motion.model, "tip", 50.0, 8.0, axes_of=axes_of)
    expected = np.concatenate([turn @ edd[:3], turn @ edd[3:]])
    assert_allclose(motion.missed(task, reference), expected, rtol=1e-5, atol=2e-4)


def test_a_frame_seen_from_its_reference(motion):
    """wdot + kd w + kp theta = 0 by differences of R_d(t)^T R(t) alone; places as ever."""
    wanted, reference = pose_path(motion, "tip", np.array([0.5, -1.2, 0.8, 0.1, 0.2, -0.3]))

    def seen(t):
        return wanted(t)[0].inv() * Rotation.from_matrix(motion.at(t).frame("tip").rotation)

    def rate(t):
        return (seen(t + STEP) * seen(t - STEP).inv()).as_rotvec() / (2 * STEP)

    kp, kd = np.arange(1.0, 7.0) * 10, np.arange(2.0, 8.0)
    law = (rate(STEP) - rate(-STEP)) / (2 * STEP) + kd[:3] * rate(0.0) + kp[:3] * seen(0.0).as_rotvec()
    task = FrameTask(motion.model, "tip", kp, kd, axes_of="reference")
    assert_allclose(motion.missed(task, reference)[:3], -law, rtol=1e-5, atol=2e-3)
    world = motion.missed(FrameTask(motion.model, "tip", kp, kd), reference)
    assert_allclose(motion.missed(task, reference)[3:], world[3:], rtol=1e-12)
    assert np.abs(motion.missed(task, reference)[:3] - wanted(0.0)[0].inv().apply(world[:3])).max() > 0.1
    turned = reference[[0, 1, 2, 3, 7, 8, 9, 13, 14, 15]]
    some = OrientationTask(motion.model, "tip", kp[:3], kd[:3], axes_of="reference", mask=[False, True, True])
    assert_allclose(motion.missed(some, turned), -law[1:], rtol=1e-5, atol=2e-3)


@pytest.mark.parametrize("axes_of", ["world", "frame"])
def test_a_frame_off_its_reference(motion, axes_of):
    _, reference = pose_path(motion, "tip", np.array([0.5, -1.2, 0.8, 0.1, 0.2, -0.3]))
    ends = [motion.at(t).frame("tip") for t in (-STEP, STEP)]
    acceleration = (ends[1].velocity - ends[0].velocity) / (2 * STEP)
    now = motion.at(0.0).frame("tip")
    turn = now.rotation.T if axes_of == "frame" else np.eye(3)
    both = np.kron(np.eye(2), turn)
    kp, kd = np.arange(1.0, 7.0) * 10, np.arange(2.0, 8.0)
    error = both @ np.array([0.5, -1.2, 0.8, 0.1, 0.2, -0.3])
    lag, wanted = both @ (reference[7:13] - now.velocity), both @ (reference[13:] - acceleration)
    law = wanted + kd * lag + kp * error
    task = FrameTask(motion.model, "tip", kp, kd, axes_of=axes_of)
    assert_allclose(motion.missed(task, reference), law, rtol=1e-6, atol=1e-4)
    mask = [True, False, False, False, True, True]
    some = FrameTask(motion.model, "tip", kp, kd, axes_of=axes_of, mask=mask)
    assert_allclose(motion.missed(some, reference), law[[0, 4, 5]], rtol=1e-6, atol=1e-4)
    turned = reference[[0, 1, 2, 3, 7, 8, 9, 13, 14, 15]]
    orientation = OrientationTask(motion.model, "tip", kp[:3], kd[:3], axes_of=axes_of, mask=[True, False, True])
    assert_allclose(motion.missed(orientation, turned), law[[0, 2]], rtol=1e-6, atol=1e-4)


@pytest.mark.parametrize("name", ["shuffled humanoid", "arm", "floating arm"])
def test_rest_asks_for_nothing(tmp_path, name):
    """Where the robot is, at rest, each task is content with no acceleration and no force."""
    model = machine(name, tmp_path)
    terms = model.terms(model.create_scratch(), random_state(model, 5)[0], np.zeros(model.nv))
    tasks = [
        ComTask(9, 3),
        AngularMomentumTask(4),
        PostureTask(model, 9, 3),
        FrameTask(model, "tip", 9, 3),
        OrientationTask(model, "sole", 9, 3),
        ForceTask(model),
        CopTask(model, "sole"),
    ]
    for task in tasks:
        reference = task.rest(terms)
        assert reference.shape == (task.reference_size,)
        assert_allclose(task.rows(terms, reference).target, 0.0, atol=1e-13)


@pytest.mark.parametrize("angle", [1e-9, 0.5, 2.0, 3.1, np.pi - 1e-9, np.pi])
def test_rotation_vectors(angle):
    rng = np.random.default_rng(0)
    for axis in [*np.eye(3), *-np.eye(3), *rng.normal(size=(20, 3))]:
        axis = axis / np.linalg.norm(axis)
        matrix = Rotation.from_rotvec(angle * axis).as_matrix()
        found = rotation_vector(matrix)
        assert_allclose(np.linalg.norm(found), angle, rtol=1e-12 if angle > 1e-3 else 1e-7)
        assert_allclose(Rotation.from_rotvec(found).as_matrix(), matrix, atol=1e-14)
        if angle < np.pi - 1e-6:
            assert_allclose(found, angle * axis, atol=1e-12)
    quaternion = rng.normal(size=4)
    expected = Rotation.from_quat(quaternion[[1, 2, 3, 0]]).as_matrix()
    assert_allclose(rotation_matrix(quaternion), expected, atol=1e-14)
    assert_allclose(rotation_vector(np.eye(3)), np.zeros(3), atol=0)


def test_orientation_comes_home_from_far_away():
    """omegadot = kp log(R_d R^T) - kd omega: from almost half a turn, without leaving the shortest way."""
    turn, omega, dt = Rotation.from_rotvec([3.0, 0.0, 0.0]), np.zeros(3), 1e-3
    for _ in range(3000):
        omega = omega + dt * (25.0 * rotation_vector(turn.inv().as_matrix()) - 10.0 * omega)
        turn = Rotation.from_rotvec(dt * omega) * turn
    assert turn.magnitude() < 1e-3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda m: ComTask(-1, 1), r"task 'com': kp: expected finite numbers >= 0, got -1"),
        (lambda m: ComTask(1, np.nan), r"task 'com': kd: expected finite numbers >= 0"),
        (lambda m: ComTask([1, 2], 1), r"task 'com': kp: expected a number or 3 of them, got shape \(2,\)"),
        (lambda m: ComTask("soft", 1), r"task 'com': kp: expected a number or 3 of them, got 'soft'"),
        (lambda m: ComTask(1, 1, weight=np.inf), r"task 'com': weight: expected finite numbers"),
        (lambda m: ComTask(1, 1, mask=[False] * 3), r"task 'com': mask: expected at least one axis"),
        (lambda m: ComTask(1, 1, mask=[True, True]), r"task 'com': mask: expected 3 of true or false"),
        (lambda m: AngularMomentumTask(-1), r"task 'angular momentum': kp: expected"),
        (lambda m: PostureTask(m, 1, 1, joints=["knee"]), r"task 'posture': no joint 'knee'; joints: wrist"),
        (lambda m: PostureTask(m, 1, 1, joints=["wrist"] * 2), r"task 'posture': joint 'wrist' is named twice"),
        (lambda m: PostureTask(m, 1, 1, joints=[]), r"task 'posture': expected at least one joint"),
        (lambda m: PostureTask(m, [1, 2], 1), r"task 'posture': kp: expected a number or 3 of them"),
        (lambda m: FrameTask(m, "head", 1, 1), r"task 'head': no frame 'head'; frames: base, upper"),
        (lambda m: FrameTask(m, "hand", 1, -1), r"task 'hand': kd: expected finite numbers >= 0"),
        (lambda m: FrameTask(m, "hand", 1, 1, axes_of="hand"), r"expected one of world, frame, reference, got 'hand'"),
        (lambda m: OrientationTask(m, "head", 1, 1), r"task 'head': no frame 'head'"),
        (lambda m: OrientationTask(m, "hand", 1, 1, mask=[1, 0, 0]), r"mask: expected 3 of true or false"),
    ],
)
def test_what_is_refused(tmp_path, make, message):
    model = machine("arm", tmp_path)
    with pytest.raises(ParamsError, match=message):
        make(model)
