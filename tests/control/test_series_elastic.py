"""Series-elastic torque laws: observers against closed forms, laws against an independent motor, the system's ports."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.plant import VoltageMotor
from drake_tc.control.series_elastic import (
    MEMORY_ROWS,
    MemoryRow,
    Readings,
    SeriesElasticControl,
    SeriesElasticLaw,
    SeriesElasticSpec,
    cubic_weights,
    motor_arrays,
    observer_weights,
)
from drake_tc.errors import ParamsError
from drake_tc.kernels.series_elastic import Observer, momentum

DT = 1e-3
MOTOR = VoltageMotor(0.04, 0.04, 0.6, 1.2e-5, 100.0, 3.0, 1.5, 200.0, 24.0)
OTHER = VoltageMotor(0.05, 0.05, 1.0, 1.0e-5, 100.0, 1.0, 0.5, 120.0, 24.0)
INPUTS = ("motor_angle", "torque", "reference_torque", "reference_acceleration")


def models(*motors):
    return [motor.actuator_model(f"joint_{i}") for i, motor in enumerate(motors)]


def test_the_cubic_is_exact_for_cubics_also_ahead_of_the_samples():
    time = DT * np.arange(-10, 1)
    polynomial = np.polynomial.Polynomial([0.3, -20.0, 4e3, -5e5])
    for ahead in (0.0, 0.5, 8.0):
        for derivative in (0, 1, 2):
            desired = polynomial.deriv(derivative)(ahead * DT) if derivative else polynomial(ahead * DT)
            found = cubic_weights(11, ahead, derivative, DT) @ polynomial(time)
            assert_allclose(found, desired, rtol=1e-7, err_msg=f"{ahead}, {derivative}")


@pytest.mark.parametrize("delay", [0, 1, 15])
def test_the_observer_finds_the_friction_of_a_motion_computed_by_hand(delay):
    """theta = A sin wt, tau = B cos wt + C t, friction 2.7 N m: v of the motor equation, sent `delay` ticks before."""
    arrays, step, length = motor_arrays(models(MOTOR)), 5, 40
    time = DT * np.arange(length)
    w, size = 12.0, 0.05
    angle, torque = size * np.sin(w * time), 3.0 * np.cos(w * time) + 20.0 * time

    def volts(t):
        speed, acceleration = size * w * np.cos(w * t), -size * w**2 * np.sin(w * t)
        motor = MOTOR.viscous * speed + 2.7 + MOTOR.inertia * acceleration + 3.0 * np.cos(w * t) + 20.0 * t
        return MOTOR.back_emf * 100.0 * speed + MOTOR.resistance / (MOTOR.torque_constant * 100.0) * motor

    kept = np.zeros((length, MEMORY_ROWS, 1))
    kept[:, MemoryRow.ANGLE, 0], kept[:, MemoryRow.TORQUE, 0] = angle, torque
    kept[:, MemoryRow.VOLTAGE, 0] = volts(time + (delay + 0.5) * DT)  # held over the tick in whose middle it is right
    kept[-1, MemoryRow.VOLTAGE, 0] = 1e6  # of this tick: not known yet
    found = np.einsum("lkn,lkn->n", observer_weights(arrays, delay, step, DT, length), kept[:, :3])
    assert_allclose(found, [2.7], atol=2e-3)  # second-order errors of the means over a tick


def test_the_momentum_observer_lags_by_its_gain():
    """f -> F (1 - exp(-K t)) for a friction F that sets in, whatever the motion."""
    gain, dry, rng = 40.0, 2.0, np.random.default_rng(0)
    total = friction = speed = 0.0
    observer = Observer(MOTOR.inertia, gain, DT)
    for tick in range(1, 61):
        volts, torque = rng.uniform(-2.0, 2.0), rng.uniform(-3.0, 3.0)
        thrust = volts / MOTOR.volts_per_torque - torque
        speed = (speed + DT * (thrust - dry) / MOTOR.inertia) / (1.0 + DT * MOTOR.damping / MOTOR.inertia)
        friction, total = momentum(observer, thrust - MOTOR.damping * speed, total, friction, speed)
        if tick in (10, 25, 60):
            assert_allclose(friction, dry * (1.0 - np.exp(-gain * tick * DT)), rtol=0.03)


def clamped(spec, desired, motor=MOTOR, believed=None, dry=0.0, ticks=600):
    """(T,) torque of a clamped joint in 20 fine steps a tick of its own equation, `delay` ticks after the law."""
    law = SeriesElasticLaw(spec, models(believed or motor), DT)
    delay, fine = round(spec.delay / DT), 20
    h, sent, angle, speed, out = DT / fine, [0.0] * delay, 0.0, 0.0, []
    state = np.zeros(law.state_size)
    for k in range(ticks):
        torque = motor.stiffness * angle
        out.append(torque)
        now = Readings(*(np.array([x]) for x in (angle, torque, desired(k * DT), 0.0)))
        after, rows = np.empty_like(state), np.empty((4, 1))
        law.step(state, now, after, rows)
        state = after
        sent.append(float(rows[0, 0]))
        for _ in range(fine):
            push = sent[k] / motor.volts_per_torque - motor.stiffness * angle - motor.damping * speed
            if speed == 0.0 and abs(push) <= dry:
                continue
            new = speed + h / motor.inertia * (push - dry * (np.sign(speed) or np.sign(push)))
            speed = 0.0 if speed * new < 0.0 and dry else new
            angle += h * speed
    return np.array(out)


def sine(amplitude, frequency_hz):
    def desired(t):
        rise = min(t / 0.1, 1.0)
        return amplitude * rise**3 * (10.0 - 15.0 * rise + 6.0 * rise**2) * np.sin(2.0 * np.pi * frequency_hz * t)

    return desired


@pytest.mark.parametrize("mode", ["observer", "last_step_friction", "feedforward", "feedforward_p"])
@pytest.mark.parametrize("frequency_hz", [3.0, 9.0])
def test_with_the_right_model_the_torque_is_the_desired_one_a_delay_later(mode, frequency_hz):
    motor = VoltageMotor(0.04, 0.04, 0.6, 1.2e-5, 100.0, 0.0, 1.5, 200.0, 24.0)
    desired = sine(2.0, frequency_hz)
    found = clamped(SeriesElasticSpec(mode=mode, kp=1.0, leak=1.0), desired, motor)
    late = np.array([desired(max(k * DT - 0.015, 0.0)) for k in range(found.size)])
    assert np.abs(found - late)[150:].max() < 0.02 * 2.0


def test_without_delay_too():
    motor = VoltageMotor(0.04, 0.04, 0.6, 1.2e-5, 100.0, 0.0, 1.5, 200.0, 24.0)
    desired = sine(2.0, 9.0)
    found = clamped(SeriesElasticSpec(delay=0.0, kp=0.5), desired, motor)
    now = np.array([desired(k * DT) for k in range(found.size)])
    assert np.abs(found - now)[150:].max() < 0.04


def test_the_horizon_takes_as_much_off_the_delay():
    motor = VoltageMotor(0.04, 0.04, 0.6, 1.2e-5, 100.0, 0.0, 1.5, 200.0, 24.0)
    desired = sine(2.0, 3.0)
    found = clamped(SeriesElasticSpec(horizon=0.008), desired, motor)
    late = np.array([desired(max(k * DT - 0.007, 0.0)) for k in range(found.size)])
    assert np.abs(found - late)[150:].max() < 0.05


def test_observers_undo_friction_that_the_model_does_not_have():
    """Of 3 N m of dry friction and a believed 0: what remains of each law's error, late by the delay."""
    desired, believed = sine(4.0, 1.0), VoltageMotor(0.04, 0.04, 0.6, 1.2e-5, 100.0, 0.0, 1.5, 200.0, 24.0)
    error = {}
    for mode in ("feedforward", "observer", "momentum_observer"):
        spec = SeriesElasticSpec(mode=mode, kp=0.0, momentum_gain=40.0)
        found = clamped(spec, desired, MOTOR, believed, dry=3.0, ticks=1500)
        late = np.array([desired(max(k * DT - 0.015, 0.0)) for k in range(found.size)])
        error[mode] = np.sqrt(np.mean((found - late)[500:] ** 2))
    assert error["feedforward"] > 1.5
    assert error["observer"] < 0.25 * error["feedforward"]
    assert error["momentum_observer"] < 0.35 * error["feedforward"]


def test_a_reversal_that_is_known_in_advance_is_not_waited_for():
    desired = sine(4.0, 1.0)
    error = []
    for mode in ("observer", "last_step_friction"):
        found = clamped(SeriesElasticSpec(mode=mode, kp=0.0), desired, MOTOR, dry=3.0, ticks=1500)
        late = np.array([desired(max(k * DT - 0.015, 0.0)) for k in range(found.size)])
        error.append(np.sqrt(np.mean((found - late)[500:] ** 2)))
    assert error[0] < 0.4 * error[1]


def test_the_integral_of_pi_takes_the_error_away_and_does_not_wind_up():
    found = clamped(SeriesElasticSpec(mode="pi", kp=2.0, ki=20.0), lambda t: 3.0, MOTOR, ticks=1500)
    assert_allclose(found[-50:], 3.0, atol=1e-3)
    weak = VoltageMotor(0.04, 0.04, 0.6, 1.2e-5, 100.0, 1.0, 1.5, 200.0, 0.3)
    law = SeriesElasticLaw(SeriesElasticSpec(mode="pi", kp=2.0, ki=20.0), models(weak), DT)
    now = Readings(*(np.array([x]) for x in (0.0, 0.0, 50.0, 0.0)))
    state, rows = np.zeros(law.state_size), np.empty((4, 1))
    for _ in range(100):
        after = np.empty_like(state)
        law.step(state, now, after, rows)
        state = after
    assert rows[0, 0] == 0.3
    assert state[-4] == 0.0  # the integral


def fixed(system, **values):
    context = system.CreateDefaultContext()
    n = system.law.size
    for name in INPUTS:
        system.GetInputPort(name).FixValue(context, np.full(n, values.get(name, 0.1)))
    return context


def outputs(system, context):
    names = ("voltage", "friction", "shaped_reference", "fault")
    return {name: system.GetOutputPort(name).Eval(context).copy() for name in names}


def stepped(system, context, ticks=1):
    for _ in range(ticks):
        update = system.EvalUniquePeriodicDiscreteUpdate(context)
        context.SetDiscreteState(update)


@pytest.mark.parametrize("mode", ["observer", "momentum_observer", "pi", "feedforward_p"])
def test_every_input_and_the_state_move_the_voltage(mode):
    strong = [VoltageMotor(**{**vars(motor), "voltage_limit": np.inf}) for motor in (MOTOR, OTHER)]
    system = SeriesElasticControl(SeriesElasticSpec(mode=mode, kp=1.0, ki=5.0), models(*strong), DT)
    context = fixed(system, reference_torque=0.2)
    stepped(system, context, 3)
    for name in INPUTS:
        if mode == "pi" and name in ("motor_angle", "reference_acceleration"):
            continue
        before = outputs(system, context)["voltage"]
        port = system.GetInputPort(name)
        port.FixValue(context, port.Eval(context) + np.array([0.03, 0.0]))
        after = outputs(system, context)["voltage"]
        assert after[0] != before[0], name
        assert after[1] == before[1], name
    before = outputs(system, context)["voltage"]
    stepped(system, context)
    assert np.all(outputs(system, context)["voltage"] != before)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
@pytest.mark.parametrize("name", INPUTS)
def test_nothing_that_is_not_finite_gets_out_or_stays(name, bad):
    system = SeriesElasticControl(SeriesElasticSpec(), models(MOTOR, OTHER), DT)
    context = fixed(system)
    stepped(system, context, 2)
    system.GetInputPort(name).FixValue(context, np.array([bad, 0.1]))
    found = outputs(system, context)
    assert all(np.isfinite(values).all() for values in found.values())
    assert found["fault"].tolist() == [1.0, 0.0]
    stepped(system, context, 3)
    system.GetInputPort(name).FixValue(context, np.array([0.1, 0.1]))
    found = outputs(system, context)
    assert found["fault"].tolist() == [0.0, 0.0]
    assert np.isfinite(context.get_discrete_state(0).value()).all()
    assert (np.abs(found["voltage"]) <= 24.0).all()


def test_two_contexts_share_nothing():
    system = SeriesElasticControl(SeriesElasticSpec(), models(MOTOR), DT)
    one, two = fixed(system), fixed(system)
    before = outputs(system, two)["voltage"]
    system.GetInputPort("torque").FixValue(one, [0.5])
    stepped(system, one, 5)
    assert_allclose(outputs(system, two)["voltage"], before, rtol=0.0)
    assert outputs(system, one)["voltage"] != before


def test_joints_do_not_touch_each_other():
    """Each as if it were alone, in its own place."""
    both = SeriesElasticControl(SeriesElasticSpec(), models(MOTOR, OTHER), DT)
    context = fixed(both)
    stepped(both, context, 4)
    for place, motor in enumerate((MOTOR, OTHER)):
        alone = SeriesElasticControl(SeriesElasticSpec(), models(motor), DT)
        own = fixed(alone)
        stepped(alone, own, 4)
        assert_allclose(outputs(both, context)["voltage"][place], outputs(alone, own)["voltage"][0], rtol=1e-9)


def test_a_joint_at_rest_asks_for_nothing_from_the_first_tick_on():
    system = SeriesElasticControl(SeriesElasticSpec(), models(MOTOR), DT)
    context = fixed(system, motor_angle=0.7, torque=0.0, reference_torque=0.0, reference_acceleration=0.0)
    for _ in range(30):
        assert_allclose(outputs(system, context)["voltage"], 0.0, atol=1e-9)
        stepped(system, context)


def test_an_acceleration_that_is_not_connected_is_nil():
    system = SeriesElasticControl(SeriesElasticSpec(), models(MOTOR), DT)
    wired, bare = fixed(system, reference_acceleration=0.0), system.CreateDefaultContext()
    for name in INPUTS[:3]:
        system.GetInputPort(name).FixValue(bare, [0.1])
    assert_allclose(outputs(system, wired)["voltage"], outputs(system, bare)["voltage"], rtol=0.0)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"mode": "magic"}, "mode: expected one of observer"),
        ({"kp": -1.0}, "kp"),
        ({"leak": 1.2}, "leak"),
        ({"step": 0.0}, "step"),
        ({"momentum_gain": np.nan}, "momentum_gain"),
        ({"horizon": 0.005, "reference_window": 0.0}, "control.horizon: expected a reference_window > 0"),
    ],
)
def test_a_spec_that_is_not_possible_is_refused(changes, says):
    with pytest.raises(ParamsError, match=says):
        SeriesElasticSpec(**changes)


def test_times_are_whole_ticks_and_drives_take_volts():
    with pytest.raises(ParamsError, match=r"control\.delay: expected a multiple of the period 0\.001 s, got 0\.0153 s"):
        SeriesElasticLaw(SeriesElasticSpec(delay=0.0153), models(MOTOR), DT)
    with pytest.raises(ParamsError, match="models is empty; expected one actuator model per joint"):
        SeriesElasticLaw(SeriesElasticSpec(), [], DT)
    servo = MOTOR.actuator_model("knee")
    object.__setattr__(servo, "drive", type(servo.drive)("current", 0.1))
    with pytest.raises(ParamsError, match="'knee': expected a voltage drive, got current"):
        SeriesElasticLaw(SeriesElasticSpec(), [servo], DT)
