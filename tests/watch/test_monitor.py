"""`ModelMonitor` on joints by closed-form motions, its ports, and its kernel against NumPy."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, PassThrough
from scipy.signal import lfilter

import drake_tc
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.diagnosis.result.torque_uncertainty import spread
from drake_tc.errors import ParamsError
from drake_tc.joint_simulator.measurement import clean_log
from drake_tc.joint_simulator.physics import simulate
from drake_tc.joint_simulator.spec import RigSpec, Sensors
from drake_tc.loops.fused import fuse
from drake_tc.watch.health import healthy_error
from drake_tc.watch.monitor import CAUSES, READ, ModelMonitor, ModelMonitorSpec
from tests.benchmarks.blind.joints import draw_joint
from tests.benchmarks.monitor_hours import ROOM, Joints, calibrated, coloured, readings, watched

COUNT = 6


@pytest.fixture(scope="module")
def joints() -> Joints:
    return Joints.drawn(np.random.default_rng(3), COUNT)


@pytest.fixture(scope="module")
def monitor(joints) -> ModelMonitor:
    return calibrated(joints, 3, seconds=30.0)


def columns(joints, seen, needed):
    """(T, n, C) by how much a change of each cause changes the residual, of readings (T, 6, n) and needed torques."""
    q, v, a, load = seen[:, :4].transpose(1, 0, 2)
    friction, stiffness = needed - load - joints.inertia * a, joints.servo / joints.gain
    keep = np.exp(-1e-3 / 0.03)  # s/(1 + 0.03 s)^2
    rate = lfilter([(1.0 - keep) / 0.03, -(1.0 - keep) / 0.03], [1.0, -2.0 * keep, keep**2], needed - needed[0], axis=0)
    late, gap = rate + stiffness * v, 0.5 * stiffness * np.sign(load)
    return np.stack([friction, needed, np.sin(q), np.cos(q), late, gap, np.ones_like(q)], axis=2)


def shown_after(joints, monitor, change, seconds=15.0):
    """(n, 4 + C) outputs, and the whitened residuals of the rows (R, n)."""
    memory, shown = monitor.start()
    table, rows = shown.reshape(COUNT, -1), []
    for _, chunk in readings(joints, seconds, np.random.default_rng(4), change, 0.0):
        for seen in chunk:
            needed = monitor.needed(seen, np.full(COUNT, ROOM))
            monitor.tick(seen, needed, memory, shown)
            rows.append(table[:, 0].copy())
    return table, np.array(rows)


def test_the_residual_of_a_sound_model_is_white_with_variance_1_and_nothing_is_named(joints, monitor):
    table, rows = shown_after(joints, monitor, {})
    assert np.all(table[:, 1] == 0.0) and np.all(table[:, 3] < 0.7)
    changes = rows[np.any(np.diff(rows, axis=0, prepend=np.nan) != 0.0, axis=1)]
    assert 0.6 < np.sqrt(np.mean(changes**2)) < 1.4


@pytest.mark.parametrize("channel", range(5))
def test_readings_that_are_no_numbers_are_left_out(joints, monitor, channel):
    memory, shown = monitor.start()
    for _, chunk in readings(joints, 0.5, np.random.default_rng(4), {}, 0.0):
        for number, seen in enumerate(chunk):
            if 100 <= number < 160:
                seen = seen.copy()
                seen[channel] = np.nan
            needed = monitor.needed(seen, np.full(COUNT, ROOM))
            monitor.tick(seen, needed, memory, shown)
    assert np.isfinite(memory).all() and np.isfinite(shown).all()


def test_more_friction_is_named_and_tracked(joints, monitor):
    table, _ = shown_after(joints, monitor, {"friction": 0.3})
    assert [CAUSES[int(c) - 1] for c in table[:, 1]] == ["friction"] * COUNT
    assert np.all(np.abs(table[:, 2] - 0.3) < 0.08)
    (_, seen), *_ = readings(joints, 5.0, np.random.default_rng(7), {}, 0.0)
    phi = columns(joints, seen, np.array([monitor.needed(each, np.full(COUNT, ROOM)) for each in seen]))
    # causes that act alike in these strokes share the change, and together they are what more friction costs
    told, true = np.sum(phi * table[:, 4:], axis=2), 0.3 * phi[:, :, 0]
    assert np.all(np.sqrt(np.mean((told - true) ** 2, axis=0)) < 0.35 * np.sqrt(np.mean(true**2, axis=0)))


@pytest.mark.parametrize("half_gap", [0.0, 5e-4])
def test_a_gap_of_a_simulated_gear_is_named_with_its_size_and_a_tight_gear_is_not(half_gap):
    """By `drake_tc.joint_simulator`: motor and link are two masses, and friction is that of the motor."""
    joint = draw_joint(np.random.default_rng(0), "position_servo", pendulum=None)
    effects = {"rotor_inertia": joint.rotor_inertia, "viscous": joint.damping, "coulomb": joint.coulomb}
    drive = Drive("position_servo", joint.gain)
    model = ActuatorModel("joint", drive, tuple(EffectValue(name, {name: x}) for name, x in effects.items()))
    causes = {"backlash": {"half_gap": half_gap}} if half_gap else {}
    sensors = Sensors(rate_hz=500)
    spec = RigSpec("servo", "null", "none", "", joint, 1, causes=causes, sensors=sensors, duration=12.0)
    (record,) = simulate([spec], ["multisine"], 2e-4)
    log = clean_log(record)
    one = ModelMonitor([model], 0.3, 0.02)
    memory, shown = one.start()
    signals = (log.position, log.velocity, log.acceleration, log.torque, log.effort, np.full_like(log.time, np.nan))
    named = []
    for seen in np.stack(signals, axis=1)[:, :, None]:
        one.tick(seen, one.needed(seen, one.room), memory, shown)
        named.append(shown[1])
    expected = {CAUSES.index("backlash") + 1.0} if half_gap else set()
    assert {cause for cause in named if cause > 0.0} == expected
    assert shown[2] == pytest.approx(2.0 * half_gap, rel=0.1)


def test_a_collision_is_a_push_and_no_change(joints, monitor):
    found = watched(joints, monitor, "collision", 25.0, 3)
    assert found.pushed.all() and not np.isfinite(found.any_cause).any() and not found.early.any()


def test_the_tracked_changes_are_those_of_regularised_least_squares(joints):
    spec = ModelMonitorSpec(memory=1e12, rest=0.0, reversal=0.0)
    one = ModelMonitor(joints.models(), 0.4, 1e-6, spec)  # no correlation: every tick is a row of its own
    memory, shown = one.start()
    rng, rows = np.random.default_rng(5), []
    for _ in range(40):
        seen = np.concatenate([rng.standard_normal((5, COUNT)), np.zeros((1, COUNT))])
        needed = one.needed(seen, np.full(COUNT, ROOM))
        one.tick(seen, needed, memory, shown)
        rows.append((seen, needed))
    seen, needed = (np.array(each) for each in zip(*rows, strict=True))
    phi, residual = columns(joints, seen, needed), seen[:, 4] / joints.gain - needed
    for i in range(COUNT):
        prior = np.array([spec.friction, spec.torque_constant, spec.payload, spec.payload, spec.delay, 0.0, spec.bias])
        prior[5] = spec.backlash if joints.servo[i] else 1e-150
        x, y = phi[:, i] / 0.4, residual[:, i] / 0.4
        expected = np.linalg.solve(x.T @ x * np.outer(prior, prior) + np.eye(7), prior * (x.T @ y)) * prior
        assert shown.reshape(COUNT, -1)[i, 4:] == pytest.approx(expected, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("late", [0.0, 3e-3])
def test_noise_of_the_load_and_friction_that_is_smoothed_are_no_delay(late):
    model = ActuatorModel("elbow", Drive("current", 0.1), (EffectValue("coulomb", {"coulomb": 2.0}),))
    one = ModelMonitor([model], 0.05, 5e-3, ModelMonitorSpec(memory=1e12))
    time, half, size, w = 1e-3 * np.arange(60_000), 20, np.array([0.4, 0.15]), np.array([1.9, 5.1])

    def moved(t):
        angle = w * t[:, None]
        return np.sin(angle) @ size, np.cos(angle) @ (w * size), -np.sin(angle) @ (w**2 * size)

    def torque(t):
        q, v, a = moved(t)
        return 10.0 * np.sin(q) + a + 2.0 * np.sign(v)

    q, v, a = moved(time)
    noise = coloured(np.random.default_rng(8), (time.size, 1), 0.05, 5e-3, np.zeros(1))[:, 0]
    smoothed = np.mean([torque(time + late + 1e-3 * k) for k in range(-half, half + 1)], axis=0)
    readings_of = np.stack([q, v, a, 10.0 * np.sin(q) + a + noise, 0.1 * smoothed, np.full_like(q, np.nan)], axis=1)
    memory, shown = one.start()
    for seen in readings_of[:, :, None]:
        one.tick(seen, one.needed(seen, one.room), memory, shown)
    assert shown[4 + CAUSES.index("delay")] == pytest.approx(late, abs=3e-4)


@pytest.mark.parametrize("fused", [False, True])
def test_the_system_shows_what_its_tick_computes(joints, fused):
    one = ModelMonitor(joints.models(), 0.4, 0.02)
    seen = np.concatenate([np.random.default_rng(6).standard_normal((5, COUNT)), np.zeros((1, COUNT))])
    builder = DiagramBuilder()
    system = builder.AddSystem(one)
    for name, values in zip((*READ, "external_torque"), seen, strict=True):
        source = builder.AddSystem(ConstantVectorSource(values))
        builder.Connect(source.get_output_port(), system.GetInputPort(name))
    names = ("residual", "cause", "change", "statistic", "tracked")
    blocks = [builder.AddSystem(PassThrough(system.GetOutputPort(name).size())) for name in names]
    for name, block in zip(names, blocks, strict=True):
        builder.Connect(system.GetOutputPort(name), block.get_input_port())
    if fused:
        fuse(builder)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.1)
    memory, shown = one.start()
    needed = one.needed(seen, np.full(COUNT, ROOM))
    for _ in range(100):
        one.tick(seen, needed, memory, shown)
    table = shown.reshape(COUNT, -1)
    for number, (name, block) in enumerate(zip(names, blocks, strict=True)):
        found = block.get_output_port().Eval(block.GetMyContextFromRoot(simulator.get_context()))
        np.testing.assert_array_equal(found, table[:, 4:].ravel() if name == "tracked" else table[:, number])


def test_it_stands_at_the_front_door_and_refuses_a_deviation_of_zero(joints):
    with pytest.raises(ParamsError, match="deviation: expected positive numbers"):
        drake_tc.ModelMonitor(joints.models(), 0.0, 0.02)


@pytest.mark.parametrize("memory", [0.005, 0.05])
def test_the_correlation_time_of_a_learned_error_is_that_of_torque_uncertainty_files(memory):
    """Of a first-order process, e^(-|t|/T) over all lags: 2 T; a diagnosis writes the same into its file."""
    dt, keep = 1e-3, np.exp(-1e-3 / memory)
    drawn = np.random.default_rng(5).standard_normal(400_000)
    error = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], drawn)
    deviation, time = healthy_error(error, np.ones(error.size, dtype=bool), dt)
    assert deviation == pytest.approx(1.0, rel=0.02)
    assert time == pytest.approx(2.0 * memory, rel=0.1)
    assert spread(error).correlation_time * dt == pytest.approx(time, rel=0.1)
