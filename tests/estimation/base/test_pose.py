"""Stage 2: the closed form against brute force, and exact where the truth is known."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RollPitchYaw, RotationMatrix
from scipy.optimize import minimize_scalar

from drake_tc.kernels.base.attitude import filtered_up, up_of
from drake_tc.kernels.base.pose import solve_position, solve_yaw
from drake_tc.kernels.linear_algebra import levelled, turned, wxyz_into


@pytest.mark.parametrize("k", [2, 3, 4])
def test_a_rigid_turn_is_found_exactly(k):
    rng = np.random.default_rng(k)
    arm, shift, turn = rng.normal(size=(k, 3)), rng.normal(size=3), 0.7
    held = arm @ turned(turn).T + shift
    weight = rng.uniform(10.0, 200.0, k)
    found, apart = solve_yaw(arm, held, weight, 0.2, 1e-12)
    assert_allclose(found, turn, atol=1e-9)
    assert_allclose(apart, turn - 0.2, atol=1e-12)
    position, gap = solve_position(arm @ turned(found).T, held, weight / weight.sum(), np.zeros(3), 1e-12)
    assert_allclose(position, shift, atol=1e-9)
    assert_allclose(gap, 0.0, atol=1e-9)


def test_position_is_the_minimum_of_its_cost():
    rng = np.random.default_rng(9)
    arm, held, predicted, trust = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), rng.normal(size=3), 0.7
    weight = rng.uniform(0.1, 1.0, 3)
    weight /= weight.sum()
    position, gap = solve_position(arm, held, weight, predicted, trust)
    slope = weight @ (position + arm - held) + trust * (position - predicted)
    assert_allclose(slope, 0.0, atol=1e-12)
    assert_allclose(gap, held - arm - position, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_the_closed_form_is_the_minimum_of_the_cost(seed):
    rng = np.random.default_rng(seed)
    arm, held = rng.normal(size=(3, 3)) * 0.3, rng.normal(size=(3, 3)) * 0.3
    weight, gyro, share = rng.uniform(0.1, 2.0, 3), 0.05, 0.3
    middle = (weight @ arm) / weight.sum()
    trust = share * (weight @ ((arm - middle)[:, :2] ** 2).sum(axis=1))

    def cost(turn):
        moved = arm @ turned(turn).T
        best = (weight @ (held - moved)) / weight.sum()
        left = held - moved - best
        return weight @ (left[:, :2] ** 2).sum(axis=1) - 2.0 * trust * np.cos(turn - gyro)

    grid = np.linspace(-np.pi, np.pi, 721)
    near = grid[np.argmin([cost(turn) for turn in grid])]
    best = minimize_scalar(cost, bounds=(near - 0.02, near + 0.02), method="bounded", options={"xatol": 1e-10})
    found, _ = solve_yaw(arm, held, weight, gyro, share)
    assert_allclose(np.angle(np.exp(1j * (found - best.x))), 0.0, atol=1e-6)


def test_a_single_contact_leaves_the_yaw_to_the_gyro():
    assert solve_yaw(np.ones((1, 3)), np.zeros((1, 3)), np.ones(1), 0.123, 2.0) == (0.123, 0.0)
    assert solve_yaw(np.ones((2, 3)), np.zeros((2, 3)), np.array([1.0, 0.0]), 0.123, 2.0) == (0.123, 0.0)
    assert solve_yaw(np.eye(3), np.eye(3), np.ones(3), 0.123, np.inf) == (0.123, 0.0)


@pytest.mark.parametrize(("roll", "pitch"), [(0.3, -0.2), (-2.2, 0.01), (3.0, 1.2), (0.0, 0.0)])
def test_the_vertical_gives_roll_and_pitch_back(roll, pitch):
    R = RollPitchYaw(roll, pitch, 0.0).ToRotationMatrix().matrix()
    assert_allclose(up_of(roll, pitch), R[2], atol=1e-14)
    assert_allclose(levelled(R[2]), R, atol=1e-12)


@pytest.mark.parametrize("angle", [0.3, 1.5, 3.0])
@pytest.mark.parametrize("axis", [[1.0, 0.1, 0.2], [0.1, -1.0, 0.2], [0.1, 0.2, 1.0], [-1.0, -1.0, -1.0]])
def test_a_rotation_and_its_quaternion(angle, axis):
    R = AngleAxis(angle, np.array(axis) / np.linalg.norm(axis)).rotation()
    found = np.empty(4)
    wxyz_into(found, R)
    assert_allclose(found, RotationMatrix(R).ToQuaternion().wxyz(), atol=1e-15)


def test_gyro_and_accelerometer_find_the_vertical_again():
    """Wrong by 0.2 rad at the start, right after a few time constants; and it follows the gyro at once."""
    true, up = up_of(0.1, 0.05), up_of(0.3, 0.05)
    for _ in range(4000):
        up = filtered_up(up, np.zeros(3), 9.81 * true, 2e-3, 1.0)
    assert_allclose(up, true, atol=2e-4)  # 0.2 e^-8
    rate = np.array([0.0, 0.5, 0.0])
    for _ in range(1000):
        up = filtered_up(up, rate, np.zeros(3), 1e-3, 1.0)  # free fall: the gyro alone
    R = (
        RollPitchYaw(0.1, 0.05, 0.0).ToRotationMatrix().matrix()
        @ RollPitchYaw(0.0, 0.5, 0.0).ToRotationMatrix().matrix()
    )
    assert_allclose(up, R[2], atol=1e-3)  # first order in 1 ms
