"""Compensator: the log's feedforward joint by joint, the simulated drives read backwards, smooth where asked."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drake_tc.actuation.compensator import Compensator, Motion, feedforward_effort
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue, split_parts
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.effects.base import DriveEffect, SensorEffect
from drake_tc.effects.library import LIBRARY, UNCOMMON
from drake_tc.errors import ParamsError

EFFECTS = [e for e in (*LIBRARY, *UNCOMMON) if not isinstance(e, SensorEffect)]
SERVO = (
    EffectValue("rotor_inertia", {"rotor_inertia": 0.3}),
    EffectValue("viscous", {"viscous": 6.0}),
    EffectValue("coulomb", {"coulomb": 3.0}),
    EffectValue("deadzone", {"deadzone": 3e-4}),
    EffectValue("velocity_sign_switch", {"switch": 0.1}),
)


def drawn(effect, rng) -> EffectValue:
    """The effect with parameters from anywhere in their bounds."""
    lows = {p.name: max(p.lower, -3.0) for p in effect.parameters}
    highs = {p.name: max(lows[p.name], min(p.upper, 3.0)) for p in effect.parameters}
    return EffectValue(effect.key, {name: float(rng.uniform(low, highs[name])) for name, low in lows.items()})


def one_by_one(models, tau, velocity, direction, position, acceleration, temperature):
    rows = zip(models, tau, velocity, direction, position, acceleration, temperature, strict=True)
    return [
        feedforward_effort(
            model,
            np.array([t]),
            Motion(np.array([v]), np.array([q]), np.array([a]), np.array([d]), np.array([celsius])),
        )[0]
        for model, t, v, d, q, a, celsius in rows
    ]


def agree(models, rng):
    n = len(models)
    now = [
        rng.normal(0, 20, n),
        rng.normal(0, 3, n),
        rng.uniform(-1, 1, n),
        rng.normal(0, 2, n),
        rng.normal(0, 9, n),
        rng.uniform(0, 90, n),
    ]
    expected = one_by_one(models, *now)
    _, v, d, q, a, celsius = now
    motion = Motion(v, q, a, d, celsius)
    assert_allclose(
        Compensator(models).effort(now[0], motion), expected, rtol=1e-11, atol=1e-11
    )  # other order of the sum
    return expected


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.key)
@given(seed=st.integers(0, 10**6), kind=st.sampled_from(["position_servo", "current", "voltage"]))
@settings(max_examples=12, deadline=None)
def test_each_effect_alone_is_compensated_as_in_a_log(effect, seed, kind):
    rng = np.random.default_rng(seed)
    agree([ActuatorModel(f"j{k}", Drive(kind, rng.uniform(0.01, 2)), (drawn(effect, rng),)) for k in range(2)], rng)


@given(seed=st.integers(0, 10**6), count=st.integers(1, 8))
@settings(max_examples=60, deadline=None)
def test_any_robot_is_compensated_as_in_a_log(seed, count):
    rng = np.random.default_rng(seed)
    picks = [rng.choice(len(EFFECTS), rng.integers(0, 9), replace=False) for _ in range(count)]
    models = [
        ActuatorModel(
            f"j{k}", Drive("position_servo", rng.uniform(1e-4, 0.1)), tuple(drawn(EFFECTS[i], rng) for i in p)
        )
        for k, p in enumerate(picks)
    ]
    agree(models, rng)


@pytest.mark.parametrize("effect", [e for e in EFFECTS if isinstance(e, DriveEffect)], ids=lambda e: e.key)
def test_an_effect_that_is_said_to_have_an_inverse_changes_the_effort(effect):
    rng = np.random.default_rng(4)
    value = drawn(effect, rng)
    plain, with_effect = (ActuatorModel("j", Drive("current", 0.5), values) for values in ((), (value,)))
    now = np.array([7.0]), Motion(velocity=np.array([1.0]), direction=np.array([1.0]))
    same = Compensator([plain]).effort(*now) == Compensator([with_effect]).effort(*now)
    assert bool(same[0]) == (type(effect).inverse is DriveEffect.inverse)


def test_constant_parts_are_summed_beforehand():
    values = {"viscous": 6.0, "coulomb": 3.0, "rotor_inertia": 0.3}
    model = ActuatorModel("j", Drive("current", 1.0), tuple(EffectValue(k, {k: x}) for k, x in values.items()))
    parts, changing = split_parts(model)
    assert parts == (3.0, 6.0, 0.0)
    assert changing == ()
    peak = EffectValue("stribeck", {"stribeck": 1.0, "stribeck_velocity": 0.1, "stribeck_exponent": 2.0})
    parts, changing = split_parts(replace(model, effects=(*model.effects, peak)))
    assert parts == (3.0, 6.0, 0.0)
    assert [law.kernel(0.0, 0.1, 1.0, 0.0, 25.0, 0.0)[0] for law in changing] == [pytest.approx(np.exp(-1.0))]


@pytest.mark.parametrize("order", [(3, 4), (4, 3)])
@given(
    tau=st.floats(1.0, 80.0), up=st.sampled_from([-1.0, 1.0]), v=st.floats(0.05, 3), ahead=st.sampled_from([-1.0, 1.0])
)
@settings(max_examples=40, deadline=None)
def test_the_actuators_deliver_what_was_wanted_through_dead_zone_and_switch(order, tau, up, v, ahead):
    effects = (*SERVO[1:3], *(SERVO[i] for i in order))
    model = ActuatorModel("j", Drive("position_servo", 2e-4), effects)
    wanted, velocity, q = np.array([up * tau]), np.array([ahead * v]), np.array([0.3])
    motor = (wanted + 6.0 * velocity + 3.0 * np.sign(velocity))[0]
    assume(abs(motor) * 2e-4 > 0.1 * 3e-4)  # below s w the switched drive is still inside its dead zone
    effort = Compensator([model]).effort(wanted, Motion(velocity))
    system = ActuatorPlant([model], 1e-3)
    context = system.CreateDefaultContext()
    system.GetInputPort("command").FixValue(context, q + effort)
    system.GetInputPort("state").FixValue(context, np.concatenate([q, velocity]))
    system.GetInputPort("load_torque").FixValue(context, wanted)
    system.set_initial_velocity(context, velocity)
    assert_allclose(system.GetOutputPort("actuation").Eval(context), wanted, rtol=1e-9)  # (q + y) - q rounds


def test_smoothing_removes_the_jump_and_nothing_else():
    width, delta, gain = 3e-4, 1e-5, 2e-4
    effects = (EffectValue("deadzone", {"deadzone": width}), EffectValue("backlash", {"backlash": 2e-3}))
    model = ActuatorModel("j", Drive("position_servo", gain), effects)
    sharp, smooth = Compensator([model]), Compensator([model], smoothing=delta)
    still = np.zeros(1)

    def at(law, torques):
        return np.array([law.effort(np.array([tau]), Motion(still))[0] for tau in torques])

    far = np.array([-40.0, -1.0, -delta / gain * 1.001, delta / gain * 1.001, 3.0])
    assert_allclose(at(smooth, far), at(sharp, far), rtol=1e-14)
    near = np.linspace(-2 * delta / gain, 2 * delta / gain, 401)
    slope = np.diff(at(smooth, near)) / np.diff(near)
    most = gain * (1 + width / delta) + gain / delta * 1e-3 + 1 / 2.0e4  # effort, lead over the gap, stiff contact
    assert np.all(slope > 0.0)
    assert_allclose(np.max(slope), most, rtol=1e-6)
    assert np.max(np.diff(at(sharp, near))) > width  # the jump that was there
    assert_allclose(at(smooth, [0.0]), 0.0, atol=0)


def test_direction_is_smooth_over_the_given_speed():
    model = ActuatorModel("j", Drive("current", 1.0), (EffectValue("coulomb", {"coulomb": 2.0}),))
    law = Compensator([model], direction_speed=0.1)
    for v in (-1.0, -0.03, 0.0, 0.1):
        expected = 2.0 * (1.0 - 2.0 / (np.exp(2 * v / 0.1) + 1.0))
        assert_allclose(law.effort(np.zeros(1), Motion(np.array([v]))), expected, rtol=1e-12, atol=1e-15)
    against = Motion(velocity=np.ones(1), direction=-np.ones(1))
    assert_allclose(law.effort(np.zeros(1), against), -2.0, atol=0)  # a direction that is given wins


def test_a_lost_sensor_spoils_its_own_joint_only():
    models = [ActuatorModel(n, Drive("position_servo", 2e-4), SERVO) for n in "abc"]
    tau, v = np.array([3.0, 4.0, 5.0]), np.array([0.5, np.nan, -0.5])
    effort = Compensator(models).effort(tau, Motion(v))
    assert np.isfinite(effort).tolist() == [True, False, True]


def test_names_and_gains():
    models = [ActuatorModel(n, Drive("current", g)) for n, g in (("hip", 0.5), ("knee", 2.0))]
    law = Compensator(models)
    assert law.joints == ("hip", "knee")
    assert_allclose(law.k_tau, [0.5, 2.0], atol=0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([],), "models is empty; expected one actuator model per joint"),
        (([ActuatorModel("j", Drive("current", 1.0))], -1.0), r"direction_speed: expected a number >= 0 \[rad/s\]"),
        (([ActuatorModel("j", Drive("current", 1.0))], 0.0, [1.0, 2.0]), "smoothing: expected a number or 1 of them"),
        (([ActuatorModel("j", Drive("current", 1.0))], 0.0, np.nan), "smoothing"),
    ],
)
def test_refusals(arguments, words):
    with pytest.raises(ParamsError, match=words):
        Compensator(*arguments)
