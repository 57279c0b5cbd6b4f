"""A step of the positions against Drake's kinematics, and turns known in closed form."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.robot.plant import make_plant
from drake_tc.tsid.model import moved

from .machines import machine, random_state


@pytest.mark.parametrize("name", ["humanoid", "shuffled humanoid", "leg", "arm", "floating arm"])
def test_a_step_is_drakes_to_first_order_and_keeps_the_quaternion(name, tmp_path):
    """The step's error against q + dt N(q) v of Drake falls with dt^2."""
    it = machine(name, tmp_path)
    plant = make_plant(it.robot, 0.0)
    context = plant.CreateDefaultContext()
    (q, v), errors = random_state(it, 4), []
    plant.SetPositions(context, q)
    for dt in (1e-2, 1e-3):
        there = moved(it, q, v, dt)
        errors.append(np.abs(there - q - dt * plant.MapVelocityToQDot(context, v)).max())
    if it.robot.fixed_base:
        assert max(errors) < 1e-15
    else:
        assert_allclose(np.linalg.norm(there[:4]), 1.0, rtol=1e-14)
        assert errors[1] < 0.011 * errors[0]


def test_a_turn_about_one_axis_is_exact(tmp_path):
    """A base that spins with 2 rad/s about z for 0.5 s, in 5 steps, is turned by 1 rad."""
    it = machine("humanoid", tmp_path)
    q, v = it.start.copy(), np.zeros(it.nv)
    v[2] = 2.0
    for _ in range(5):
        q = moved(it, q, v, 0.1)
    assert_allclose(q[:4], [np.cos(0.5), 0.0, 0.0, np.sin(0.5)], atol=1e-14)
    assert_allclose(q[4:], it.start[4:], rtol=0)
