"""The terms against Drake's own quantities by another route: recursions, centre-of-mass calls, differences in time."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.math import RigidTransform
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

from drake_tc.actuation.model_file import load_models
from drake_tc.errors import ParamsError
from drake_tc.robot.fields import Mount
from drake_tc.robot.plant import make_plant
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.model import TsidModel

from .machines import MODELS, NAMES, arm, machine, random_state, robot_or_skip

STEP = 1e-5
KV = JacobianWrtVariable.kV


class Other:
    """The robot in a plant as everyone builds it, at the same state."""

    def __init__(self, model, q, v):
        self.plant = make_plant(model.robot, 0.0)
        self.context = self.plant.CreateDefaultContext()
        self.model, self.q, self.v = model, q, v
        self.plant.SetPositions(self.context, q)
        self.plant.SetVelocities(self.context, v)
        self.world = self.plant.world_frame()

    def later(self, seconds):
        """After moving on with the same v."""
        rate = self.plant.MapVelocityToQDot(self.context, self.v)
        q = self.q + seconds * rate
        if not self.model.robot.fixed_base:
            q[:4] /= np.linalg.norm(q[:4])
        return Other(self.model, q, self.v)

    def frame(self, contact):
        return self.plant.GetFrameByName(contact.frame.link)

    def pose(self, contact):
        body = self.plant.GetBodyByName(contact.frame.link)
        return self.plant.EvalBodyPoseInWorld(self.context, body) @ contact.frame.pose.transform


@pytest.fixture(params=NAMES)
def case(request, tmp_path):
    model = machine(request.param, tmp_path)
    q, v = random_state(model, 1)
    return model, model.terms(model.create_scratch(), q, v), Other(model, q, v)


def rotors(model):
    """Reflected inertia of each velocity that the plain plant does not have."""
    diagonal, own = np.zeros(model.nv), model.robot.rotor_inertia
    given = [0.01 * (1 + i % 5) for i in range(model.n)]
    diagonal[model.actuated] = [own.get(joint, 0.0) for joint in model.robot.joints] if own else given
    return np.diag(diagonal)


def test_the_start_is_the_robots_posture(case):
    model, _, other = case
    assert_allclose(model.start, other.plant.GetPositions(other.plant.CreateDefaultContext()), atol=0)
    assert_allclose(model.start[model.positions], model.robot.posture, atol=0)


def test_the_equation_of_motion_is_that_of_inverse_dynamics(case):
    model, terms, other = case
    assert_allclose(terms.joint_position, other.q[model.positions], atol=0)
    plant, context = other.plant, other.context
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    vdot = np.random.default_rng(0).normal(size=model.nv) * 5
    needed = plant.CalcInverseDynamics(context, vdot, forces) + rotors(model) @ vdot
    assert_allclose(terms.mass_matrix @ vdot + terms.bias, needed, rtol=1e-9, atol=1e-9 * np.abs(needed).max())
    matrix = plant.CalcMassMatrixViaInverseDynamics(context) + rotors(model)
    assert_allclose(terms.mass_matrix, matrix, rtol=1e-9, atol=1e-9 * np.abs(matrix).max())


def test_the_centre_of_mass_is_drakes(case):
    _, terms, other = case
    plant, context, world = other.plant, other.context, other.world
    assert_allclose(terms.mass, plant.CalcTotalMass(context), rtol=1e-12)
    assert_allclose(terms.com, plant.CalcCenterOfMassPositionInWorld(context), atol=1e-12)
    assert_allclose(terms.com_velocity, plant.CalcCenterOfMassTranslationalVelocityInWorld(context), atol=1e-11)
    jacobian = plant.CalcJacobianCenterOfMassTranslationalVelocity(context, KV, world, world)
    assert_allclose(terms.com_jacobian, jacobian, atol=1e-11)
    bias = plant.CalcBiasCenterOfMassTranslationalAcceleration(context, KV, world, world)
    assert_allclose(terms.com_bias, bias, atol=1e-9)


def momentum(other, v):
    other.plant.SetVelocities(other.context, v)
    com = other.plant.CalcCenterOfMassPositionInWorld(other.context)
    return other.plant.CalcSpatialMomentumInWorldAboutPoint(other.context, com).get_coeffs()


def test_the_momentum_is_drakes_and_changes_as_said(case):
    model, terms, other = case
    columns = np.stack([momentum(other, unit) for unit in np.eye(model.nv)], axis=1)
    assert_allclose(terms.momentum_matrix, columns, atol=1e-10)
    ahead, behind = (momentum(other.later(sign * STEP), other.v) for sign in (1, -1))
    assert_allclose(terms.momentum_bias, (ahead - behind) / (2 * STEP), atol=1e-5)


def test_contacts_move_as_their_frames_do(case):
    _, terms, other = case
    plant, context, world = other.plant, other.context, other.world
    velocity, bias = terms.contact_velocity, terms.contact_bias
    for contact, rows in zip(terms.contacts.contacts, terms.contacts.rows, strict=True):
        turn = np.eye(3) if contact.upright else other.pose(contact).rotation().matrix()
        place = contact.frame.pose.transform.translation()
        whole = plant.CalcJacobianSpatialVelocity(context, KV, other.frame(contact), place, world, world)
        both = np.concatenate([turn.T @ whole[3:], turn.T @ whole[:3]])[: contact.size]
        assert_allclose(terms.contact_jacobian[rows], both, atol=1e-12)
        ahead, behind = other.later(STEP), other.later(-STEP)
        gone = (ahead.pose(contact).translation() - behind.pose(contact).translation()) / (2 * STEP)
        assert_allclose(velocity[rows][:3], turn.T @ gone, atol=1e-7)
        speeds = [
            at.plant.CalcJacobianSpatialVelocity(at.context, KV, at.frame(contact), place, at.world, at.world) @ at.v
            for at in (ahead, behind)
        ]
        rate = (speeds[0] - speeds[1]) / (2 * STEP)
        both = np.concatenate([turn.T @ rate[3:], turn.T @ rate[:3]])[: contact.size]
        assert_allclose(bias[rows], both, atol=1e-5)
    assert_allclose(velocity, terms.contact_jacobian @ terms.v, atol=1e-12)


@pytest.mark.parametrize("which", ["sole", "link"])
def test_frames_are_where_drake_has_them(case, which):
    model, terms, other = case
    contact = model.contacts[0]
    name = contact.name if which == "sole" else contact.frame.link
    mount = contact.frame.pose.transform if which == "sole" else RigidTransform()
    found, frame = terms.frame(name), other.frame(contact)
    place = mount.translation()
    pose = other.plant.GetBodyByName(contact.frame.link).EvalPoseInWorld(other.context) @ mount
    assert_allclose(found.position, pose.translation(), atol=1e-12)
    assert_allclose(found.rotation, pose.rotation().matrix(), atol=1e-12)
    cheap = terms.pose(name)
    assert_allclose(cheap[0], found.rotation, atol=0)
    assert_allclose(cheap[1], found.position, atol=0)
    args = (other.context, KV, frame, place, other.world, other.world)
    assert_allclose(found.jacobian, other.plant.CalcJacobianSpatialVelocity(*args), atol=1e-12)
    assert_allclose(found.velocity, found.jacobian @ other.v, atol=1e-11)
    assert_allclose(found.bias, other.plant.CalcBiasSpatialAcceleration(*args).get_coeffs(), atol=1e-9)
    assert terms.frame(name) is found


def test_contacts_come_and_go_without_a_new_plant(tmp_path):
    model = machine("floating arm", tmp_path)
    scratch = model.create_scratch()
    q, v = random_state(model, 4)
    both = model.terms(scratch, q, v)
    assert [contact.name for contact in both.contacts.contacts] == ["sole", "tip"]
    for mask, rows in (((True, False), slice(0, 6)), ((False, True), slice(6, 9)), ((False, False), slice(0, 0))):
        some = model.terms(scratch, q, v, mask)
        assert_allclose(some.contact_jacobian, both.contact_jacobian[rows], atol=0)
        assert_allclose(some.contact_bias, both.contact_bias[rows], atol=0)
        assert_allclose(some.contacts.entries, np.arange(9)[rows], atol=0)
    with pytest.raises(ParamsError, match=r"active: expected one value a contact \(2\), got 3"):
        model.terms(scratch, q, v, (True, False, True))


def test_two_scratch_memories_do_not_disturb_each_other(tmp_path):
    model = machine("floating arm", tmp_path)
    one, two = model.create_scratch(), model.create_scratch()
    first = model.terms(one, *random_state(model, 1))
    alone = first.frame("hand").position.copy()
    later = model.terms(two, *random_state(model, 2))
    assert_allclose(first.pose("hand")[1], alone, atol=0)
    assert np.abs(later.pose("hand")[1] - alone).max() > 1e-3


@pytest.mark.parametrize("place", [0, 5, 8, "quaternion", "infinite"])
def test_a_state_that_is_not_a_number_is_not_an_error(tmp_path, place):
    model = machine("floating arm", tmp_path)
    scratch = model.create_scratch()
    q, v = random_state(model, 1)
    if place == "quaternion":
        q[:4] = 0.0
    elif place == "infinite":
        v[3] = np.inf
    else:
        (q if place < 8 else v)[place % 8] = np.nan
    terms = model.terms(scratch, q, v, (True, False))
    for value in (terms.mass_matrix, terms.bias, terms.com, terms.contact_jacobian, terms.momentum_bias):
        assert np.isnan(value).all()
    assert terms.contact_jacobian.shape == (6, model.nv)
    assert np.isnan(terms.frame("hand").jacobian).all()
    assert np.isnan(terms.pose("sole")[1]).all()
    again = model.terms(scratch, *random_state(model, 1))
    assert np.isfinite(again.mass_matrix).all()


def test_the_length_of_the_quaternion_does_not_matter(tmp_path):
    model = machine("floating arm", tmp_path)
    q, v = random_state(model, 1)
    longer = q.copy()
    longer[:4] *= 1.01
    one, two = (model.terms(model.create_scratch(), x, v) for x in (q, longer))
    for name in ("mass_matrix", "bias", "contact_jacobian", "contact_bias", "com", "momentum_bias"):
        assert_allclose(getattr(two, name), getattr(one, name), atol=1e-12)


def test_a_robot_without_contacts(tmp_path):
    model = TsidModel(arm(tmp_path, fixed_base=False))
    terms = model.terms(model.create_scratch(), *random_state(model, 1))
    assert terms.contact_jacobian.shape == (0, model.nv)
    assert terms.contact_bias.shape == terms.contact_velocity.shape == (0,)


def test_rotors_are_the_robot_files_unless_given(tmp_path):
    robot = arm(tmp_path)
    found = []
    for inertia in (None, {}, {"wrist": 0.5}):
        model = TsidModel(robot, rotor_inertia=inertia)
        terms = model.terms(model.create_scratch(), *random_state(model, 1))
        found.append(terms.mass_matrix[np.ix_(terms.actuated, terms.actuated)])
    assert_allclose(found[0] - found[1], np.diag([0.02, 0.0, 1.5]), atol=1e-12)
    assert_allclose(found[2] - found[1], np.diag([0.5, 0.0, 0.0]), atol=1e-12)


def test_rotors_of_an_actuator_file():
    robot = robot_or_skip(MODELS / "hrp2_like" / "hrp2_like.yaml")
    models = load_models(robot.actuators)
    found = [TsidModel(robot, rotor_inertia=inertia) for inertia in (None, {})]
    q, v = random_state(found[0], 1)
    with_rotors, without = (it.terms(it.create_scratch(), q, v).mass_matrix for it in found)
    expected = np.zeros(36)
    expected[found[0].actuated] = [models[joint].inertia for joint in robot.joints]
    assert_allclose(with_rotors - without, np.diag(expected), atol=1e-12)
    assert expected.max() > 0.1
    lacking = MODELS / "hrp2_like" / "hrp2_like_leg_actuators.yaml"
    with pytest.raises(ParamsError, match=r"hrp2_like_leg_actuators.yaml: no model of joint 'l_hip_yaw'"):
        TsidModel(replace(robot, actuators=lacking))


def test_a_joint_that_moves_nothing_is_refused(tmp_path):
    robot = arm(tmp_path, fixed_base=False)
    text = robot.urdf.read_text()
    start, stop = text.index('<link name="hand">') + len('<link name="hand">'), text.index("<joint")
    robot.urdf.write_text(text[:start] + "</link>" + text[stop:])
    with pytest.raises(ParamsError, match=r"robot 'arm': expected a mass matrix .* joint 'wrist' moves 0 kg m\^2"):
        TsidModel(robot, rotor_inertia={})
    model = TsidModel(robot, rotor_inertia={"wrist": 0.01})
    assert np.isfinite(model.terms(model.create_scratch(), *random_state(model, 1)).mass_matrix).all()


@pytest.mark.parametrize(
    ("contacts", "more", "message"),
    [
        ([Contact("a", Mount("a", "elbow"), "point")], {}, r"contact 'a': no link 'elbow'; links: base, upper"),
        ([Contact("a", Mount("a", "hand"), "point")] * 2, {}, r"contact 'a': expected a name that no link"),
        ([Contact("hand", Mount("hand", "hand"), "point")], {}, r"contact 'hand': expected a name that no link"),
        ([], {"frames": [Mount("eye", "head")]}, r"frame 'eye': no link 'head'"),
        ([], {"rotor_inertia": {"knee": 1.0}}, r"rotor_inertia: no joint 'knee'; joints: wrist, shoulder"),
        ([], {"rotor_inertia": {"wrist": -1.0}}, r"rotor_inertia: wrist: expected a number >= 0"),
        ([], {"rotor_inertia": {"wrist": np.nan}}, r"rotor_inertia: wrist: expected a number >= 0"),
    ],
)
def test_what_is_refused(tmp_path, contacts, more, message):
    with pytest.raises(ParamsError, match=message):
        TsidModel(arm(tmp_path), contacts, **more)
