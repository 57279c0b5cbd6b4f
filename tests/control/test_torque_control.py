"""TorqueControl: components that sum to the effort, equivalent gains, limits, anti-windup, compensation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drake_tc.actuation.compensator import Motion, feedforward_effort
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.control.gains import TorqueGains
from drake_tc.control.torque_control import COMPONENTS, TorqueControl
from drake_tc.control.torque_law import CompensationSpec
from drake_tc.effects.backlash import CONTACT_STIFFNESS
from drake_tc.errors import ParamsError
from tests.joint_program import JointInput, JointProgram

K_TAU = np.array([2e-4, 5e-3])
EFFECTS = (
    EffectValue("viscous", {"viscous": 6.0}),
    EffectValue("coulomb", {"coulomb": 3.0}),
    EffectValue("rotor_inertia", {"rotor_inertia": 0.4}),
    EffectValue("velocity_sign_switch", {"switch": 0.1}),
    EffectValue("deadzone", {"deadzone": 3e-4}),
)
SERVOS = tuple(ActuatorModel(n, Drive("position_servo", k), EFFECTS) for n, k in zip("ab", K_TAU, strict=True))
BARE = tuple(ActuatorModel(n, Drive("position_servo", k)) for n, k in zip("ab", K_TAU, strict=True))
GAINS = TorqueGains(np.array([2.0, 1.5]), np.array([4.0, 6.0]), np.array([90.0, 70.0]), np.array([3.0, 2.0]), np.eye(6))
NO_LIMIT = np.full(2, np.inf)
RNG = np.random.default_rng(5)
INPUTS = {
    "desired_torque": np.array([5.0, -3.0]),
    "torque_terms": 3.0 * RNG.normal(size=12),
    "estimated_torque": np.array([4.0, -1.0]),
    "joint_estimate": RNG.normal(size=6),
    "position": RNG.normal(size=2),
    "reference": RNG.normal(size=6),
}


def context_of(system, s=(0.0, 0.0), **changed):
    context = system.CreateDefaultContext()
    for i in range(system.num_input_ports()):
        name = system.get_input_port(i).get_name()
        value = changed[name] if name in changed else INPUTS[name]
        system.get_input_port(i).FixValue(context, np.asarray(value, float))
    context.SetDiscreteState(0, np.asarray(s, float))
    return context


def read(system, context, name):
    return np.array(system.GetOutputPort(name).Eval(context))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), limited=st.booleans())
def test_the_seven_parts_sum_to_the_effort(seed, limited):
    rng = np.random.default_rng(seed)
    system = TorqueControl(SERVOS, GAINS, np.full(2, 6.0) if limited else NO_LIMIT)
    inputs = {name: 5.0 * rng.normal(size=value.size) for name, value in INPUTS.items()}
    context = context_of(system, rng.normal(size=2), **inputs)
    total = read(system, context, "components").reshape(6, 2).sum(axis=0) + read(system, context, "integral")
    effort = read(system, context, "command") - inputs["position"]
    assert_allclose(total, effort, rtol=1e-11, atol=1e-13 * 100)  # round-off of a sum of torques of some 100 N m
    torque = read(system, context, "commanded_torque")
    assert np.all(np.abs(torque) <= (6.0 if limited else np.inf))


@pytest.mark.parametrize("velocity", ["estimate", "reference"])
@pytest.mark.parametrize("more", [(), (EffectValue("stribeck", {"stribeck": 2.0, "stribeck_velocity": 0.1}),)])
def test_the_command_is_the_feedforward_of_a_log_whether_its_effects_are_compiled_or_not(more, velocity):
    """One joint has an effect without compiled equation, the other has none; the log's form knows nothing of this."""
    models = (ActuatorModel("a", SERVOS[0].drive, (*EFFECTS, *more)), SERVOS[1])
    system = TorqueControl(models, GAINS, NO_LIMIT, compensation=CompensationSpec(velocity=velocity))
    context = context_of(system)
    asked, q = read(system, context, "commanded_torque"), INPUTS["position"]
    of = {
        name: INPUTS[port].reshape(3, 2) for name, port in (("estimate", "joint_estimate"), ("reference", "reference"))
    }
    v, turning, a = of[velocity][1], of["reference"][1], of["reference"][2]
    expected = [
        feedforward_effort(model, asked[[j]], Motion(v[[j]], q[[j]], a[[j]], np.tanh(turning[[j]] / 0.01)))[0]
        for j, model in enumerate(models)
    ]
    assert_allclose(read(system, context, "command"), q + expected, rtol=1e-13)


def test_components_are_the_equivalent_gains_times_the_errors():
    """K6 .. K9 of Del Prete et al. (2016), eq. 13 and 14."""
    rng = np.random.default_rng(1)
    root = rng.normal(size=(2, 2))
    mass, j = root @ root.T + np.eye(2), rng.normal(size=(6, 2))
    kf = rng.normal(size=(6, 6))
    gains = TorqueGains(GAINS.kp, np.zeros(2), GAINS.ks, GAINS.kd, kf)
    e, edot, eddot, qddot_d, h = rng.normal(size=(5, 2))
    f_d, f = rng.normal(size=(2, 6))
    forward = mass @ qddot_d + h - j.T @ f_d
    rows = [forward, gains.ks * e, gains.kd * edot, -j.T @ kf @ (f_d - f), mass @ eddot, -j.T @ (f_d - f)]
    estimated = mass @ (qddot_d - eddot) + h - j.T @ f  # the same model
    system = TorqueControl(BARE, gains, NO_LIMIT)
    context = context_of(
        system, desired_torque=sum(rows[:4]), torque_terms=np.concatenate(rows), estimated_torque=estimated
    )
    position = K_TAU * (1.0 + gains.kp)
    kp = np.diag(gains.kp)
    k8, k9 = np.diag(K_TAU) @ kp @ mass, -np.diag(K_TAU) @ (kp @ j.T @ (np.eye(6) + kf) + j.T @ kf)
    expected = {
        "feedforward_torque": K_TAU * forward,
        "feedforward_friction": np.zeros(2),
        "feedback_position": position * gains.ks * e,
        "feedback_velocity": position * gains.kd * edot,
        "feedback_acceleration": k8 @ eddot,
        "feedback_force": k9 @ (f_d - f),
    }
    got = dict(zip(COMPONENTS, read(system, context, "components").reshape(6, 2), strict=True))
    for name, value in expected.items():
        assert_allclose(got[name], value, rtol=1e-9, atol=1e-14, err_msg=name)


@pytest.mark.parametrize("velocity", [-0.8, 0.6])
def test_the_actuator_then_delivers_the_commanded_torque(velocity):
    """The simulated actuator, given the command, moves the link with tau* (rotor's share taken by its inertia)."""
    acceleration = 1.5
    reference = np.array([0.0, 0.0, velocity, velocity, acceleration, acceleration])
    spec = CompensationSpec(velocity="reference", direction="reference", acceleration="reference", direction_speed=1e-3)
    system = TorqueControl(SERVOS, GAINS, NO_LIMIT, compensation=spec)
    context = context_of(system, reference=reference)
    command, torque = read(system, context, "command"), read(system, context, "commanded_torque")
    for i, model in enumerate(SERVOS):
        program = JointProgram(model, 1e-3, 0.0)
        q = float(INPUTS["position"][i])
        out = program.step(
            program.initial(velocity), JointInput(float(command[i]), q, velocity, 0.0, 25.0), at_tick=True
        )
        assert_allclose(out.actuation - 0.4 * acceleration, torque[i], rtol=1e-9, atol=1e-9)


def test_a_motor_leads_its_link_by_the_wound_spring_or_by_half_the_gap():
    """theta - q = c tau of a spring, b/2 sign(tau) + tau/k of a gap that closes on k: so far a command is ahead."""
    gears = EffectValue("elasticity", {"compliance": 2e-3}), EffectValue("backlash", {"backlash": 0.03})
    geared = [ActuatorModel(bare.joint, bare.drive, (gear,)) for bare, gear in zip(BARE, gears, strict=True)]
    for sign in (1.0, -1.0):
        systems = [TorqueControl(models, GAINS, NO_LIMIT) for models in (geared, BARE)]
        contexts = [context_of(system, desired_torque=sign * np.array([40.0, 30.0])) for system in systems]
        torque = read(systems[0], contexts[0], "commanded_torque")
        assert np.all(sign * torque > 0.0)
        commands = [read(*each, "command") for each in zip(systems, contexts, strict=True)]
        assert_allclose(
            commands[0] - commands[1], [2e-3 * torque[0], sign * 0.015 + torque[1] / CONTACT_STIFFNESS], rtol=1e-9
        )


def test_other_drives_get_the_effort_alone():
    mixed = (SERVOS[0], ActuatorModel("b", Drive("current", 0.05)))
    system = TorqueControl(mixed, GAINS, NO_LIMIT)
    near, far = (read(system, context_of(system, position=q), "command") for q in ([0.0, 0.0], [1.0, 1.0]))
    assert_allclose(far - near, [1.0, 0.0], atol=1e-12)
    assert_allclose(near[1], 0.05 * read(system, context_of(system), "commanded_torque")[1], rtol=1e-12)


def run(system, context, ticks):
    sums = []
    for _ in range(ticks):
        context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
        sums.append(np.array(context.get_discrete_state(0).value()))
    return np.array(sums)


def test_the_integral_integrates():
    system = TorqueControl(SERVOS, GAINS, NO_LIMIT, dt=2e-3)
    context = context_of(system)
    sums = run(system, context, 100)
    assert_allclose(sums[-1], 100 * 2e-3 * np.array([1.0, -2.0]), rtol=1e-12)  # tau_d - tau_hat
    assert_allclose(read(system, context, "integral"), K_TAU * GAINS.ki * sums[-1], rtol=1e-12)


def test_the_integral_does_not_wind_up():
    system = TorqueControl(SERVOS, GAINS, np.full(2, 10.0), dt=1e-2)
    push = context_of(system, desired_torque=[30.0, -30.0], estimated_torque=[0.0, 0.0])
    assert_allclose(run(system, push, 50), 0.0)  # already out of the limit
    slow = context_of(system, desired_torque=[6.0, -6.0], estimated_torque=[5.0, -5.0])
    sums = run(system, slow, 2000)
    assert np.all(np.abs(GAINS.ki * sums) <= 10.0)
    asked = 6.0 + GAINS.kp + GAINS.ki * np.abs(sums[-1])
    assert np.all(asked <= 10.0 + GAINS.ki * 1e-2 + 1e-9)  # at most one step past the limit
    system.GetInputPort("estimated_torque").FixValue(slow, np.array([7.0, -7.0]))
    back = run(system, slow, 1)
    assert np.all(np.abs(back[0]) < np.abs(sums[-1]))  # leaves the limit at once


@pytest.mark.parametrize("name", [name for name in INPUTS if name != "torque_terms"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e300])
def test_a_broken_input_raises_nothing_and_leaves_the_integral(name, bad):
    system = TorqueControl(SERVOS, GAINS, NO_LIMIT)
    broken = INPUTS[name].copy()
    broken[-1 if name == "reference" else broken.size // 2] = bad
    context = context_of(system, (0.1, 0.2), **{name: broken})
    assert_allclose(run(system, context, 3)[-1], [0.1, 0.2])
    assert np.isnan(read(system, context, "command")).any()
    assert read(system, context, "components").shape == (12,)


def test_a_disturbance_is_added_behind_the_limit_and_counts_as_friction():
    limit, lost = np.array([6.0, 2.0]), np.array([1.5, -4.0])
    with_it = TorqueControl(SERVOS, GAINS, limit, disturbance=True)
    without = TorqueControl(SERVOS, GAINS, limit)
    one, two = context_of(with_it, (0.3, -0.2), disturbance=lost), context_of(without, (0.3, -0.2))
    asked = read(without, two, "commanded_torque")
    assert np.abs(asked[1]) == 2.0  # clipped, and the compensation goes beyond
    assert_allclose(read(with_it, one, "commanded_torque"), asked + lost)
    parts = [read(s, c, "components").reshape(6, 2) for s, c in ((with_it, one), (without, two))]
    assert_allclose(np.delete(parts[0], 1, axis=0), np.delete(parts[1], 1, axis=0))
    effort = read(with_it, one, "command") - INPUTS["position"]
    assert_allclose(parts[0].sum(axis=0) + read(with_it, one, "integral"), effort, rtol=1e-11, atol=1e-11)
    nothing = context_of(with_it, (0.3, -0.2), disturbance=np.zeros(2))
    assert_allclose(read(with_it, nothing, "command"), read(without, two, "command"))
    missing = context_of(with_it, disturbance=np.array([np.nan, 0.0]))
    assert np.isnan(read(with_it, missing, "command")).any()


MOVES = {  # input: outputs it moves
    "desired_torque": {"command", "components", "commanded_torque"},
    "torque_terms": {"components"},
    "estimated_torque": {"command", "components", "commanded_torque"},
    "joint_estimate": {"command", "components"},
    "position": {"command"},
    "reference": {"command", "components"},
}


@pytest.mark.parametrize("name", MOVES)
def test_poking_an_input_moves_what_depends_on_it(name):
    system = TorqueControl(SERVOS, GAINS, NO_LIMIT)
    context = context_of(system)
    outputs = ("command", "components", "commanded_torque", "integral")
    before = {out: read(system, context, out) for out in outputs}
    system.GetInputPort(name).FixValue(context, INPUTS[name] + 0.1 * np.arange(1, INPUTS[name].size + 1))
    assert {out for out in outputs if not np.array_equal(read(system, context, out), before[out])} == MOVES[name]


def test_state_and_gains_move_the_outputs():
    system = TorqueControl(SERVOS, GAINS, NO_LIMIT)
    context = context_of(system)
    before = {out: read(system, context, out) for out in ("command", "components", "commanded_torque", "integral")}
    context.SetDiscreteState(0, np.ones(2))
    moved = {out for out in before if not np.array_equal(read(system, context, out), before[out])}
    assert {"command", "commanded_torque", "integral"} <= moved
    context.SetDiscreteState(0, np.zeros(2))
    system.set_gains(context, TorqueGains(np.zeros(2), GAINS.ki, GAINS.ks, GAINS.kd, GAINS.kf))
    assert_allclose(read(system, context, "commanded_torque"), INPUTS["desired_torque"])
    assert not np.array_equal(read(system, context, "components"), before["components"])


def test_where_the_friction_looks():
    """The estimate's velocity moves the command only where the specification takes it from there."""
    for velocity, direction, wanted in (
        ("reference", "reference", False),
        ("estimate", "reference", True),
        ("reference", "estimate", True),
    ):
        spec = CompensationSpec(velocity=velocity, direction=direction)
        system = TorqueControl(SERVOS, GAINS, NO_LIMIT, compensation=spec)
        one = read(system, context_of(system), "command")
        other = read(system, context_of(system, joint_estimate=-INPUTS["joint_estimate"]), "command")
        assert np.array_equal(one, other) != wanted
    alone = TorqueControl(SERVOS, GAINS, NO_LIMIT, compensation=CompensationSpec("estimate", "estimate", "none"))
    assert not alone.HasInputPort("reference")


def test_refusals():
    with pytest.raises(ParamsError, match="torque_limit: expected 2 positive"):
        TorqueControl(SERVOS, GAINS, np.zeros(2))
    with pytest.raises(ParamsError, match="dt: expected a positive period"):
        TorqueControl(SERVOS, GAINS, NO_LIMIT, dt=0.0)
    with pytest.raises(ParamsError, match=r"compensation\.velocity: expected one of"):
        CompensationSpec(velocity="none")
    with pytest.raises(ParamsError, match="direction_speed"):
        CompensationSpec(direction_speed=0.0)
    still = TorqueGains(GAINS.kp, np.zeros(2), GAINS.ks, GAINS.kd, GAINS.kf)
    system = TorqueControl(SERVOS, still, NO_LIMIT)
    with pytest.raises(ParamsError, match=r"gains\.ki: expected 0"):
        system.set_gains(system.CreateDefaultContext(), GAINS)
    with pytest.raises(ParamsError, match="gains: expected 2 joints, got 3"):
        TorqueControl(SERVOS, TorqueGains(*np.ones((4, 3)), np.eye(6)), NO_LIMIT)


def test_models_and_limits_by_joint_in_a_list_or_as_one_number_are_the_same():
    listed = TorqueControl(SERVOS, GAINS, np.full(2, 6.0))
    expected = read(listed, context_of(listed), "command")
    by_joint = {model.joint: model for model in SERVOS}
    backwards = dict(reversed(by_joint.items()))
    for models, limit, joints in (
        (by_joint, 6.0, None),
        (backwards, {"b": 6.0, "a": 6.0}, ("a", "b")),
        (list(SERVOS), [6.0, 6.0], None),
    ):
        system = TorqueControl(models, GAINS, limit, joints=joints)
        assert_allclose(read(system, context_of(system), "command"), expected, rtol=0.0)


@pytest.mark.parametrize(
    ("models", "limit", "joints", "message"),
    [
        ({}, 6.0, None, "models is empty; expected one actuator model per joint"),
        (["a", "b"], 6.0, None, "models: expected actuator models, by joint or in a list, got 'a'"),
        ({"a": SERVOS[0]}, 6.0, ("a", "b"), "models: no model of joint 'b'; joints there: a"),
        (SERVOS, {"a": 6.0, "knee": 6.0}, None, "torque_limit: no joint 'knee'; joints: a, b"),
        (SERVOS, {"a": 6.0}, None, "torque_limit: no value of joint 'b'; joints: a, b"),
        (SERVOS, [6.0], None, r"torque_limit: expected a number or 2 of them, got shape \(1,\)"),
    ],
)
def test_arguments_that_do_not_fit_are_named(models, limit, joints, message):
    with pytest.raises(ParamsError, match=message):
        TorqueControl(models, GAINS, limit, joints=joints)
