"""Forces of joints by recursion: a pendulum by hand, and Drake's recursion on a robot whose base moves."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.tree import MultibodyForces

import drake_tc.models
from drake_tc.estimation.plant import build_plant
from drake_tc.kernels.calls import Kernel
from drake_tc.robot.plant import in_order, tree_of
from drake_tc.robot.robot import load_robot

JOINT_FORCES = Kernel("joint_torque", "joint_forces")
MODELS = Path(drake_tc.models.__file__).parent / "hrp2_like"


@pytest.mark.parametrize(("q", "v", "vdot"), [(0.0, 0.0, 2.0), (0.7, 3.0, -4.0), (-2.5, -1.0, 0.0)])
def test_a_pendulum_is_that_of_the_textbook(q, v, vdot):
    """tau = (I + m l^2) vdot + m g l sin q, for a turn about -y of a body that hangs along -z."""
    mass, length, inertia, gravity = 1.7, 0.6, 0.05, 9.81
    turning = [*np.eye(3).ravel(), 0.2, -0.1, 0.4, 0.0, -1.0, 0.0]
    body = [mass, 0.0, 0.0, -length, 0.3, inertia, 0.2, 0.0, 0.0, 0.0]
    base = np.zeros(19)
    base[0], base[4:7], base[18] = 1.0, (5.0, -3.0, 2.0), gravity
    out = np.empty(1)
    places, constants = np.zeros((1, 4), dtype=np.int64), np.array([[*turning, *body, 0.0]])
    JOINT_FORCES(tuple(np.array([[q], [v], [vdot]])), (places, constants, np.zeros(10)), base, out)
    expected = (inertia + mass * length**2) * vdot + mass * gravity * length * np.sin(q)
    assert_allclose(out, expected, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("name", ["hrp2_like.yaml", "hrp2_like_leg.yaml"])
def test_on_a_base_that_moves_they_are_drakes(name):
    robot = load_robot(MODELS / name)
    model = build_plant(robot, cuts=False)
    plant, n, rng = model.plant, len(robot.joints), np.random.default_rng(4)
    tree = tree_of(plant, model.base.body(), in_order(robot), {})
    context, nothing, out = plant.CreateDefaultContext(), MultibodyForces(plant), np.empty(n)
    for q, v, vdot in rng.normal(0.0, 2.0, (20, 3, n)):
        twist, acceleration = rng.normal(0.0, 2.0, (2, 6))
        state, rate = model.state.copy(), np.zeros(n + 6)
        state[model.position_index], rate[model.velocity_index], rate[:6] = q, v, twist
        state[plant.num_positions() :] = rate
        plant.SetPositionsAndVelocities(context, state)
        rate[model.velocity_index], rate[:6] = vdot, acceleration
        expected = plant.CalcInverseDynamics(context, rate, nothing)[model.velocity_index]
        base = np.concatenate(([1.0], np.zeros(6), twist, acceleration))
        JOINT_FORCES((q, v, vdot), (tree.places, tree.constants, tree.trunk), base, out)
        assert_allclose(out, expected, rtol=1e-11, atol=1e-11 * np.abs(expected).max())
