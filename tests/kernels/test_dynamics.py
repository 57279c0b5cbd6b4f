"""The compiled dynamics against Drake's to rounding, closed forms, and what no motion without torques may change."""

import math

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose
from pydrake.multibody.tree import JacobianWrtVariable
from tsid.machines import NAMES, machine, random_state

from drake_tc.control.rotation import rotation_matrix
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot
from drake_tc.tsid.model import TsidModel

EXACT = 1e-12
"""Of the largest entry: a few hundred roundings."""
CART = """<robot name="cart">
  <link name="rail"><inertial><mass value="9"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  </link>
  <link name="cart"><inertial><origin xyz="0.3 0 0.1"/><mass value="2"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.3"/></inertial></link>
  <link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="0.7"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.01"/></inertial></link>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="cart"/><origin xyz="0 0 1"/>
    <axis xyz="1 0 0"/><limit lower="-2" upper="2" velocity="3" effort="40"/></joint>
  <joint name="swing" type="revolute"><parent link="cart"/><child link="rod"/><origin xyz="0.1 0 -0.2"/>
    <axis xyz="0 -1 0"/><limit lower="-4" upper="4" velocity="9" effort="40"/></joint>
</robot>
"""


def near(found, expected):
    assert_allclose(found, expected, rtol=0, atol=EXACT * max(1.0, np.abs(expected).max(initial=0.0)))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", NAMES)
def test_all_terms_are_drakes_to_rounding(name, seed, tmp_path):
    model = machine(name, tmp_path)
    q, v = random_state(model, seed)
    terms = model.terms(model.create_scratch(), q, v)
    plant = make_plant(model.robot, 0.0)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    plant.SetVelocities(context, v)
    own, rotors = model.robot.rotor_inertia, np.zeros(model.nv)
    given = {joint: 0.01 * (1 + i % 5) for i, joint in enumerate(model.robot.joints)}
    rotors[model.actuated] = [(own or given).get(joint, 0.0) for joint in model.robot.joints]
    near(terms.mass_matrix, plant.CalcMassMatrix(context) + np.diag(rotors))
    near(terms.bias, plant.CalcBiasTerm(context) - plant.CalcGravityGeneralizedForces(context))
    world = plant.world_frame()
    for contact, rows in zip(terms.contacts.contacts, terms.contacts.rows, strict=True):
        frame, place = plant.GetFrameByName(contact.frame.link), contact.frame.pose.transform.translation()
        args = (context, JacobianWrtVariable.kV, frame, place, world, world)
        pose = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(contact.frame.link))
        turn = np.eye(3) if contact.upright else (pose @ contact.frame.pose.transform).rotation().matrix()
        jacobian, drift = (
            plant.CalcJacobianSpatialVelocity(*args),
            plant.CalcBiasSpatialAcceleration(*args).get_coeffs(),
        )
        near(
            terms.contact_jacobian[rows], np.concatenate([turn.T @ jacobian[3:], turn.T @ jacobian[:3]])[: contact.size]
        )
        near(terms.contact_bias[rows], np.concatenate([turn.T @ drift[3:], turn.T @ drift[:3]])[: contact.size])
        found = terms.frame(contact.frame.link)
        origin = (*args[:3], np.zeros(3), *args[4:])
        near(found.jacobian, plant.CalcJacobianSpatialVelocity(*origin))
        near(found.bias, plant.CalcBiasSpatialAcceleration(*origin).get_coeffs())
        near(found.rotation, pose.rotation().matrix())
        near(found.position, pose.translation())


@pytest.fixture
def cart(tmp_path):
    (tmp_path / "cart.urdf").write_text(CART, encoding="utf-8")
    document = {
        "name": "cart",
        "urdf": "cart.urdf",
        "base": "rail",
        "fixed_base": True,
        "joints": ["slide", "swing"],
        "rotor_inertia": {"slide": 0.4, "swing": 0.05},
    }
    (tmp_path / "cart.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
    return TsidModel(load_robot(tmp_path / "cart.yaml"))


@pytest.mark.parametrize("angle", [0.0, 0.4, -2.0, 3.0])
def test_a_pendulum_on_a_cart_is_its_closed_form(cart, angle):
    """(M + m) xdd + m l (cos a add - sin a ad^2) = F, m l cos a xdd + (I + m l^2) add + m g l sin a = tau."""
    m, length, inertia, rate = 0.7, 0.5, 0.03, 1.7
    terms = cart.terms(cart.create_scratch(), np.array([0.3, angle]), np.array([-0.9, rate]))
    mixed = m * length * math.cos(angle)
    expected = [[2.0 + m + 0.4, mixed], [mixed, inertia + m * length**2 + 0.05]]
    near(terms.mass_matrix, np.array(expected))
    near(terms.bias, np.array([-m * length * math.sin(angle) * rate**2, m * 9.81 * length * math.sin(angle)]))


def rates(model, q, v):
    """qdot and vdot without torques."""
    terms = model.terms(model.create_scratch(), q, v, (False,) * len(model.contacts))
    speed = np.zeros(model.nq)
    speed[model.positions] = v[model.actuated]
    if not model.robot.fixed_base:
        w, x, y, z = q[:4]
        spin = np.array([[-x, -y, -z], [w, z, -y], [-z, w, x], [y, -x, w]])
        speed[:4], speed[4:7] = 0.5 * spin @ v[:3], v[3:6]
    return speed, np.linalg.solve(terms.mass_matrix, -terms.bias)


def invariants(model, q, v):
    """Energy, linear momentum, angular momentum about the centre of mass."""
    terms = model.terms(model.create_scratch(), q, v)
    energy = 0.5 * v @ terms.mass_matrix @ v + 9.81 * terms.mass * terms.com[2]
    momentum = terms.momentum_matrix @ v
    return energy, momentum[3:], momentum[:3]


def moved_on(model, q, v, step, count):
    """Runge and Kutta's fourth order."""
    for _ in range(count):
        a = rates(model, q, v)
        b = rates(model, q + 0.5 * step * a[0], v + 0.5 * step * a[1])
        c = rates(model, q + 0.5 * step * b[0], v + 0.5 * step * b[1])
        d = rates(model, q + step * c[0], v + step * c[1])
        q = q + step / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0])
        v = v + step / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1])
    return q, v


@pytest.mark.parametrize("name", ["humanoid", "shuffled humanoid", "floating arm", "arm", "leg"])
def test_a_free_motion_keeps_energy_and_momentum(name, tmp_path):
    """Without rotors, whose inertia about their joints is no inertia of the links and keeps no momentum."""
    held = machine(name, tmp_path)
    model = TsidModel(held.robot, rotor_inertia={})
    q, v = random_state(model, 2, speed=0.5)
    time, count = 0.02, 40
    before, after = invariants(model, q, v), invariants(model, *moved_on(model, q, v, time / count, count))
    assert_allclose(after[0], before[0], rtol=1e-8)
    if not model.robot.fixed_base:
        fallen = before[1] - [0.0, 0.0, 9.81 * model.mass * time]
        assert_allclose(after[1], fallen, atol=1e-8 * np.abs(fallen).max())
        assert_allclose(after[2], before[2], atol=1e-7 * max(1.0, np.abs(before[2]).max()))


def test_the_world_far_away_costs_no_digits(tmp_path):
    """The base a kilometre off: nothing but its own place changes."""
    model = machine("humanoid", tmp_path)
    q, v = random_state(model, 3)
    far = q.copy()
    far[4:7] += [1000.0, -500.0, 20.0]
    one, other = (model.terms(model.create_scratch(), at, v) for at in (q, far))
    for name in ("mass_matrix", "bias", "contact_jacobian", "contact_bias", "momentum_matrix", "momentum_bias"):
        assert_allclose(getattr(other, name), getattr(one, name), atol=0)
    assert_allclose(rotation_matrix(q[:4]), one.frame(model.robot.base).rotation, atol=1e-14)
