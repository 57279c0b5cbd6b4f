"""InverseDynamics against a double pendulum by hand, and each port against what it should move."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

from drake_tc.control.dynamics_terms import DynamicsTerms
from drake_tc.control.gains import TorqueGains
from drake_tc.control.inverse_dynamics import TERMS, InverseDynamics, MotionSources
from drake_tc.errors import ParamsError
from drake_tc.robot.plant import add_robot

from .robots import dynamics, pendulum

KF = np.diag(np.arange(1.0, 7.0)) + 0.1
GAINS = TorqueGains(np.full(2, 2.0), np.zeros(2), np.array([30.0, 20.0]), np.array([3.0, 2.0]), KF)
RNG = np.random.default_rng(3)
INPUTS = {
    "joint_estimate": RNG.normal(size=6),
    "reference": RNG.normal(size=6),
    "force_reference": RNG.normal(size=6),
    "contact_wrench": RNG.normal(size=6),
    "position": RNG.normal(size=2),
}


def evaluated(system, **changed):
    context = system.CreateDefaultContext()
    for i in range(system.num_input_ports()):
        name = system.get_input_port(i).get_name()
        system.get_input_port(i).FixValue(context, changed[name] if name in changed else INPUTS[name])
    terms = system.GetOutputPort("torque_terms").Eval(context).reshape(6, -1)
    return system.GetOutputPort("desired_torque").Eval(context), dict(zip(TERMS, terms, strict=True))


@pytest.mark.parametrize("order", ["[shoulder, elbow]", "[elbow, shoulder]"])
def test_dynamics_by_hand_in_any_order_of_the_joints(tmp_path, order):
    model = DynamicsTerms(pendulum(tmp_path, joints=order))
    pick = [0, 1] if order.startswith("[shoulder") else [1, 0]
    scratch = model.create_scratch()
    for q, v, vdot in RNG.normal(size=(5, 3, 2)):
        mass, h, jacobian = dynamics(q, v)
        model.place(scratch, q[pick], v[pick])
        # links have an inertia of 1e-9
        assert_allclose(model.forces(scratch, np.zeros(2)), h[pick], rtol=1e-6, atol=1e-6)
        assert_allclose(model.forces(scratch, vdot[pick]), (mass @ vdot + h)[pick], rtol=1e-6, atol=1e-6)
        assert_allclose(model.jacobian(scratch), jacobian[:, pick], atol=1e-12)


def test_the_rotor_is_not_counted(tmp_path):
    model = DynamicsTerms(pendulum(tmp_path, more="rotor_inertia: {elbow: 5.0}\n"))
    q, vdot, scratch = np.array([0.3, -0.4]), np.array([2.0, -5.0]), model.create_scratch()
    model.place(scratch, q, q)
    mass, h, _ = dynamics(q, q)
    assert_allclose(model.forces(scratch, vdot), mass @ vdot + h, rtol=1e-6)


@pytest.mark.parametrize("configuration", ["estimate", "reference"])
@pytest.mark.parametrize("position_error", ["estimate", "encoder"])
def test_terms_are_those_of_the_equation(tmp_path, configuration, position_error):
    system = InverseDynamics(pendulum(tmp_path), GAINS, MotionSources(configuration, position_error))
    tau_d, terms = evaluated(system)
    q, v, a = INPUTS["joint_estimate"].reshape(3, 2)
    q_d, v_d, a_d = INPUTS["reference"].reshape(3, 2)
    f_d, f = INPUTS["force_reference"], INPUTS["contact_wrench"]
    mass, h, j = dynamics(q, v) if configuration == "estimate" else dynamics(q_d, v_d)
    seen = q if position_error == "estimate" else INPUTS["position"]
    expected = {
        "feedforward": mass @ a_d + h - j.T @ f_d,
        "position": GAINS.ks * (q_d - seen),
        "velocity": GAINS.kd * (v_d - v),
        "force": -j.T @ KF @ (f_d - f),
        "acceleration_error": mass @ (a_d - a),
        "force_error": -j.T @ (f_d - f),
    }
    for name, value in expected.items():
        assert_allclose(terms[name], value, rtol=1e-6, atol=1e-6, err_msg=name)  # links have an inertia of 1e-9
    assert_allclose(tau_d, sum(expected[name] for name in TERMS[:4]), rtol=1e-6, atol=1e-6)


MOVES = {  # input: (index, the terms it moves; M, h and J at the estimate)
    "position": (1, {"position"}),
    "joint_estimate": (5, {"acceleration_error"}),
    "reference": (5, {"feedforward", "acceleration_error"}),
    "force_reference": (0, {"feedforward", "force", "force_error"}),
    "contact_wrench": (0, {"force", "force_error"}),
}


@pytest.mark.parametrize("name", MOVES)
def test_poking_an_input_moves_its_terms_alone(tmp_path, name):
    system = InverseDynamics(pendulum(tmp_path), GAINS, MotionSources(position_error="encoder"))
    context = system.CreateDefaultContext()
    for port, value in INPUTS.items():
        system.GetInputPort(port).FixValue(context, value)
    port = system.GetOutputPort("torque_terms")
    before = port.Eval(context).reshape(6, 2).copy()
    index, moved = MOVES[name]
    poked = INPUTS[name].copy()
    poked[index] += 1.0
    system.GetInputPort(name).FixValue(context, poked)
    changed = np.any(np.abs(port.Eval(context).reshape(6, 2) - before) > 1e-9, axis=1)
    assert {TERMS[i] for i in np.flatnonzero(changed)} == moved


def test_gains_are_parameters_of_a_context(tmp_path):
    system = InverseDynamics(pendulum(tmp_path), GAINS)
    one, two = system.CreateDefaultContext(), system.CreateDefaultContext()
    for context in (one, two):
        for i in range(system.num_input_ports()):
            system.get_input_port(i).FixValue(context, INPUTS[system.get_input_port(i).get_name()])
    port = system.GetOutputPort("desired_torque")
    before = port.Eval(one).copy()
    system.set_gains(one, TorqueGains(np.zeros(2), np.zeros(2), GAINS.ks + 1.0, GAINS.kd, KF))
    error = INPUTS["reference"][:2] - INPUTS["joint_estimate"][:2]
    assert_allclose(port.Eval(one) - before, error, rtol=1e-9)
    assert_allclose(port.Eval(two), before)
    clone = one.Clone()
    assert_allclose(system.GetOutputPort("desired_torque").Eval(clone), port.Eval(one))


@pytest.mark.parametrize("name", ["joint_estimate", "reference", "force_reference", "contact_wrench"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_broken_input_raises_nothing_and_heals(tmp_path, name, bad):
    system = InverseDynamics(pendulum(tmp_path), GAINS)
    context = system.CreateDefaultContext()
    for i in range(system.num_input_ports()):
        system.get_input_port(i).FixValue(context, INPUTS[system.get_input_port(i).get_name()])
    port = system.GetOutputPort("desired_torque")
    before = port.Eval(context).copy()
    system.GetInputPort(name).FixValue(context, np.full(INPUTS[name].size, bad))
    assert not np.isfinite(port.Eval(context)).all()
    system.GetInputPort(name).FixValue(context, INPUTS[name])
    assert_allclose(port.Eval(context), before)


@pytest.mark.parametrize("order", ["[shoulder, elbow]", "[elbow, shoulder]"])
def test_the_torques_are_those_of_drakes_recursion(tmp_path, order):
    robot, plant, rng = pendulum(tmp_path, joints=order), MultibodyPlant(0.0), np.random.default_rng(2)
    terms = DynamicsTerms(robot)
    add_robot(plant, robot, rotors=False)
    plant.Finalize()
    scratch, context, forces = terms.create_scratch(), plant.CreateDefaultContext(), MultibodyForces(plant)
    pick = [0, 1] if order.startswith("[shoulder") else [1, 0]
    for q, v, vdot in rng.normal(0.0, 3.0, (20, 3, 2)):
        plant.SetPositionsAndVelocities(context, np.concatenate((q[pick], v[pick])))
        plant.CalcForceElementsContribution(context, forces)
        expected = plant.CalcInverseDynamics(context, vdot[pick], forces)[pick]
        terms.place(scratch, q, v)
        assert_allclose(terms.forces(scratch, vdot), expected, rtol=1e-12, atol=1e-12)


def test_without_force_task_nothing_pushes(tmp_path):
    robot, gains = pendulum(tmp_path), TorqueGains(GAINS.kp, GAINS.ki, GAINS.ks, GAINS.kd, np.zeros((6, 6)))
    with_task, none = InverseDynamics(robot, gains), InverseDynamics(robot, gains, force_task=False)
    assert not none.HasInputPort("force_reference") and not none.HasInputPort("contact_wrench")
    nothing = {"force_reference": np.zeros(6), "contact_wrench": np.zeros(6)}
    for one, other in zip(evaluated(with_task, **nothing), evaluated(none), strict=True):
        for a, b in zip(*(x.values() if isinstance(x, dict) else x for x in (one, other)), strict=True):
            assert_allclose(a, b, rtol=1e-14)
    with pytest.raises(ParamsError, match="without force task"):
        none.set_gains(none.CreateDefaultContext(), GAINS)


def test_refusals(tmp_path):
    robot = pendulum(tmp_path)
    with pytest.raises(ParamsError, match=r"gains\.kf: expected shape \(6, 6\)"):
        InverseDynamics(robot, TorqueGains(*np.ones((4, 2)), np.eye(3)))
    with pytest.raises(ParamsError, match="gains: expected 2 joints, got 3"):
        InverseDynamics(robot, TorqueGains(*np.ones((4, 3)), np.eye(6)))
    with pytest.raises(ParamsError, match="configuration: expected one of estimate, reference"):
        MotionSources(configuration="here")
    with pytest.raises(ParamsError, match="position_error: expected one of estimate, encoder"):
        MotionSources(position_error="here")
    with pytest.raises(ParamsError, match="expected a welded base"):
        DynamicsTerms(pendulum(tmp_path, fixed=False))
