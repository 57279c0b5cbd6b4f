"""`StandingState`: exact where soles stand still, blind to nothing the gyro sees, and it knows where a foot was put."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.math import RotationMatrix

from drake_tc.errors import ParamsError
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.standing import StandingState, fit_rotation, turned

from .problems import SOLES, model, robot

PERIOD = 1e-3


@pytest.fixture(scope="module")
def system():
    return StandingState(model(), PERIOD)


def standing(rng, lean=0.1, speed=0.3):
    """A state with both soles where the start has them, and still: joints that fit are found by Newton's method."""
    it = model()
    scratch, wanted = it.create_scratch(), it.terms(it.create_scratch(), it.start, np.zeros(it.nv))
    q, v = it.start.copy(), speed * rng.uniform(-1, 1, it.nv)
    q[it.positions[12:]] += lean * rng.uniform(-1, 1, it.n - 12)  # upper body at will
    legs, base = it.positions[:12], slice(4, 7)
    q[base] += 0.02 * rng.uniform(-1, 1, 3)
    for _ in range(50):
        terms = it.terms(scratch, q, v)
        error = []
        for sole in SOLES:
            (rotation, place), (rotation_0, place_0) = terms.pose(sole.name), wanted.pose(sole.name)
            turn = RotationMatrix(RotationMatrix(rotation.T @ rotation_0)).ToAngleAxis()
            error += [*(rotation.T @ (place_0 - place)), *(turn.angle() * turn.axis())]
        q[legs] += np.linalg.pinv(terms.contact_jacobian[:, it.actuated[:12]]) @ np.array(error)
        if np.abs(error).max() < 1e-13:
            break
    assert np.abs(error).max() < 1e-12
    jacobian = it.terms(scratch, q, v).contact_jacobian
    return q, v - np.linalg.pinv(jacobian) @ (jacobian @ v)


def gyro_of(q, v):
    """The truth that the first IMU of the robot sees, by Drake's own velocity of its link."""
    it = model()
    mount = robot().imu[0]
    frame = it.terms(it.create_scratch(), q, v).frame(mount.link)
    return (frame.rotation @ mount.pose.transform.rotation().matrix()).T @ frame.velocity[:3]


def fixed(system, q, v, active=None, context=None):
    it = model()
    context = context or system.CreateDefaultContext()
    system.GetInputPort("position").FixValue(context, q[it.positions])
    system.GetInputPort("velocity").FixValue(context, v[it.actuated])
    system.GetInputPort("imu").FixValue(context, np.concatenate([gyro_of(q, v), [0.0, 0.0, 9.81]]))
    if active is not None:
        system.GetInputPort("active_contacts").FixValue(context, active)
    return context


def test_velocity_and_place_are_exact_on_still_soles(system):
    rng = np.random.default_rng(0)
    for _ in range(5):
        q, v = standing(rng)
        context = fixed(system, q, v)
        found = system.GetOutputPort("estimated_state").Eval(context)
        assert_allclose(found[37:], v, atol=2e-4)  # the first attitude counts as a step old, by 0.3 rad/s x 1 ms
        assert_allclose(found[:7], q[:7], atol=1e-3)
        still = fixed(system, q, np.zeros(36))
        assert_allclose(system.GetOutputPort("estimated_state").Eval(still)[:37], q, atol=2e-12)


def test_the_gyro_leads_and_the_soles_pull_slowly(system):
    """The joints stand still, the base turns about the soles: attitude follows the gyro, less what the soles pull."""
    it, rate = model(), np.array([0.0, 0.2, 0.0])
    q, v = it.start.copy(), np.zeros(it.nv)
    context = fixed(system, q, v)
    mount = robot().imu[0]
    turn = it.terms(it.create_scratch(), q, v).frame(mount.link).rotation @ mount.pose.transform.rotation().matrix()
    system.GetInputPort("imu").FixValue(context, np.concatenate([turn.T @ rate, np.zeros(3)]))
    for _ in range(200):
        context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    found = system.GetOutputPort("estimated_state").Eval(context)
    angle = 2.0 * np.arctan2(found[2], found[0])
    assert_allclose(angle, 0.2 * 0.5 * (1.0 - np.exp(-0.201 / 0.5)), rtol=5e-3)  # a' = w - a/T from 0
    assert_allclose(found[37:40], rate, atol=1e-12)
    soles = it.terms(it.create_scratch(), q, v)
    middle = np.mean([soles.pose(sole.name)[1] for sole in SOLES], axis=0)
    assert_allclose(found[40:43], np.cross(rate, found[4:7] - middle), atol=1e-9)  # it stands still


def test_a_foot_stands_where_it_was_put_down(system):
    """The right leg lifted and moved, then loaded again: the estimate does not jump, and stays with both feet."""
    it = model()
    q, v = it.start.copy(), np.zeros(it.nv)
    context = fixed(system, q, v, np.array([0.0, 1.0]))
    moved = q.copy()
    moved[it.positions[:6]] += np.array([0.05, 0.02, -0.2, 0.3, -0.1, 0.02])
    fixed(system, moved, v, np.array([0.0, 1.0]), context)
    lifted = system.GetOutputPort("estimated_state").Eval(context).copy()
    assert_allclose(lifted[:37], moved, atol=2e-12)  # the left foot alone says where the base is
    context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    fixed(system, moved, v, np.array([1.0, 1.0]), context)
    landed = system.GetOutputPort("estimated_state").Eval(context)
    assert_allclose(landed[:37], moved, atol=2e-12)


def test_an_input_that_is_not_finite_is_passed_on_and_not_remembered(system):
    q, _ = standing(np.random.default_rng(1))
    context = fixed(system, q, np.zeros(36))
    good = system.GetOutputPort("estimated_state").Eval(context).copy()
    system.GetInputPort("imu").FixValue(context, np.full(6, np.nan))
    assert np.isnan(system.GetOutputPort("estimated_state").Eval(context)).all()
    context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    fixed(system, q, np.zeros(36), None, context)
    assert_allclose(system.GetOutputPort("estimated_state").Eval(context), good, atol=1e-12)


@pytest.mark.parametrize(
    ("port", "bad"),
    [
        ("velocity", 1e200),
        ("velocity", 1e306),
        ("position", 1e300),
        ("position", 1e20),
        ("imu", 1e200),
        ("active_contacts", np.nan),
        ("active_contacts", np.inf),
    ],
)
def test_finite_garbage_neither_raises_nor_is_remembered(system, port, bad):
    q, _ = standing(np.random.default_rng(3))
    context = fixed(system, q, np.zeros(36), np.ones(2))
    good = system.GetOutputPort("estimated_state").Eval(context).copy()
    value = system.GetInputPort(port).Eval(context).copy()
    value[1] = bad
    system.GetInputPort(port).FixValue(context, value)
    assert np.isnan(system.GetOutputPort("estimated_state").Eval(context)).all()
    context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    fixed(system, q, np.zeros(36), np.ones(2), context)
    assert_allclose(system.GetOutputPort("estimated_state").Eval(context), good, atol=1e-12)


def test_rotations_come_back_from_points():
    rng = np.random.default_rng(2)
    for _ in range(20):
        vector = rng.uniform(-2, 2, 3)
        rotation = turned(vector)
        assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
        assert_allclose(rotation @ vector, vector, atol=1e-14)
        flat = np.column_stack([rng.normal(size=(4, 2)), np.zeros(4)])  # as four corners of one sole
        assert_allclose(fit_rotation(flat, flat @ rotation.T + 3.0), rotation, atol=1e-12)


def test_what_it_cannot_do_without_is_asked_for():
    with pytest.raises(ParamsError, match="expected contacts; it has none"):
        StandingState(TsidModel(robot()), PERIOD)
    with pytest.raises(ParamsError, match="expected 0 < period <= trust"):
        StandingState(model(), 0.0)
