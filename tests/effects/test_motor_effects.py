"""Uncommon effects of the motor against closed forms, and a model that goes through a position loop."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.recorded_run import PositionLoop, through_loop
from drake_tc.effects.base import plain_signals
from drake_tc.effects.drive_compression import DriveCompression
from drake_tc.effects.library import LIBRARY, UNCOMMON, effect
from drake_tc.effects.load_stribeck import LoadStribeck
from drake_tc.effects.load_tilt import LoadTilt
from drake_tc.effects.winding_heat import WindingHeat
from drake_tc.errors import ParamsError
from tests.joint_program import JointInput, JointProgram


def test_uncommon_effects_are_known_to_models_and_not_among_the_common_ones():
    assert not {e.id for e in UNCOMMON} & {e.id for e in LIBRARY}
    for member in UNCOMMON:
        assert effect(member.id) is member


def test_compression_halves_at_its_effort_and_inverts():
    y = np.linspace(-5.0, 5.0, 41)
    shape = {"half_effort": 4.0}
    out = DriveCompression().transform(y, plain_signals(y.size, {}), shape)
    assert_allclose(np.interp(4.0, y, out), 2.0, rtol=1e-12)
    back = DriveCompression().inverse(out, 0.0 * y, np.sign(y), shape)
    assert_allclose(back, y, atol=1e-12)  # algebra only


def test_winding_warms_to_the_closed_form_of_a_held_effort():
    h, size = 1e-3, 3000
    signals = plain_signals(size, {})
    object.__setattr__(signals, "period", h)
    shape = {"warm_effort": 2.0, "warm_time": 0.8}
    out = WindingHeat().transform(np.full(size, 3.0), signals, shape)
    t = np.arange(size) * h
    expected = 3.0 / (1.0 + (3.0 / 2.0) ** 2 * (1.0 - np.exp(-t / 0.8)))
    assert_allclose(out, expected, rtol=1e-9)  # the recursion is exact for a held effort


@pytest.mark.parametrize(
    ("member", "shape"),
    [(DriveCompression(), {"half_effort": 3.0}), (WindingHeat(), {"warm_effort": 2.0, "warm_time": 0.3})],
)
def test_kernels_repeat_the_transform_one_sample_at_a_time(member, shape):
    h, size = 2e-3, 800
    y = 4.0 * np.sin(np.arange(size) * h * 7.0)
    signals = plain_signals(size, {})
    object.__setattr__(signals, "period", h)
    kernel = member.kernel(shape, h)
    memory = kernel.start(y[0], y[0])
    stepped = [kernel.step(value, value, 0.0, memory, 0) for value in y.tolist()]
    assert_allclose(stepped, member.transform(y, signals, shape), rtol=1e-9, atol=1e-12)


def test_load_stribeck_is_friction_and_decays_with_speed():
    v = np.array([-0.6, -1e-9, 1e-9, 0.3, 0.6])
    known = {"velocity": v, "direction": np.sign(v), "load_torque": np.full(5, -2.0)}
    phi = LoadStribeck().columns(plain_signals(5, known), {"load_stribeck_velocity": 0.3})[:, 0]
    assert np.all(phi * v >= 0.0)
    assert_allclose(phi[[2, 3, 4]], 2.0 * np.exp([0.0, -1.0, -2.0]), rtol=1e-8)


def test_tilt_is_the_first_order_of_a_turned_load():
    q, z, moment = np.linspace(-1.5, 1.5, 31), 1e-4, 0.48
    known = plain_signals(q.size, {"position": q})
    tilted = LoadTilt().torque(known, {"tilt_moment": -moment * np.sin(z)})
    assert_allclose(tilted, moment * (np.sin(q - z) - np.sin(q)), atol=moment * z**2)  # second order in z


def test_model_through_a_loop_gives_the_torque_of_the_clipped_voltage():
    loop = PositionLoop(gain=17.0, limit=7.3)
    effects = (
        EffectValue("rotor_inertia", {"rotor_inertia": 0.002}),
        EffectValue("deadzone", {"deadzone": 0.4}),
        EffectValue("drive_compression", {"half_effort": 9.0}),
    )
    motor = ActuatorModel("servo", Drive("voltage", 10.0), effects)
    servo = through_loop(motor, loop)
    for error in (-2.0, -0.3, -0.01, 0.0, 0.05, 0.3, 0.6):
        outs = []
        for model, command in ((motor, float(np.clip(17.0 * error, -7.3, 7.3))), (servo, 0.2 + error)):
            program = JointProgram(model, 1e-3, 0.007)
            now = JointInput(command, 0.2, 0.0, None, 25.0)
            outs.append(program.step(program.initial(), now, at_tick=True).motor_torque)
        assert_allclose(outs[1], outs[0], rtol=1e-12, atol=1e-15)


def test_a_servo_goes_in_no_loop_and_a_loop_needs_a_gain():
    with pytest.raises(ParamsError, match="expected a current or voltage drive"):
        through_loop(ActuatorModel("servo", Drive("position_servo", 1.0)), PositionLoop(1.0))
    with pytest.raises(ParamsError, match="positive gain"):
        PositionLoop(0.0)
