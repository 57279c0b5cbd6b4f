"""`ModelMonitor` on joints by closed-form motions, its ports, and its kernel against NumPy."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, PassThrough

import drake_tc
from drake_tc.errors import ParamsError
from drake_tc.loops.fused import fuse
from drake_tc.watch.monitor import CAUSES, READ, ModelMonitor, ModelMonitorSpec
from tests.benchmarks.monitor_hours import ROOM, Joints, calibrated, readings, watched

COUNT = 6


@pytest.fixture(scope="module")
def joints() -> Joints:
    return Joints.drawn(np.random.default_rng(3), COUNT)


@pytest.fixture(scope="module")
def monitor(joints) -> ModelMonitor:
    return calibrated(joints, 3)


def columns(joints, seen, needed, slow):
    """The low-passed needed torque after a tick, and (n, C) by how much a change of each cause changes the residual."""
    q, v, a, load = seen[:4]
    slow = needed if slow is None else slow
    friction, stiffness = needed - load - joints.inertia * a, joints.servo / joints.gain
    late, gap = (needed - slow) / 0.03 + stiffness * v, stiffness * np.sign(needed)
    phi = np.stack([friction, needed, np.sin(q), np.cos(q), late, gap, np.ones_like(q)], axis=1)
    return slow + (needed - slow) * (1.0 - np.exp(-1e-3 / 0.03)), phi


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
    slow, told, true = None, [], []
    for _, chunk in readings(joints, 5.0, np.random.default_rng(7), {}, 0.0):
        for seen in chunk:
            needed = monitor.needed(seen, np.full(COUNT, ROOM))
            slow, phi = columns(joints, seen, needed, slow)
            told.append(np.sum(phi * table[:, 4:], axis=1))
            true.append(0.3 * phi[:, 0])
    # causes that act alike in these strokes share the change, and together they are what more friction costs
    told, true = np.array(told[1:]), np.array(true[1:])
    assert np.all(np.sqrt(np.mean((told - true) ** 2, axis=0)) < 0.35 * np.sqrt(np.mean(true**2, axis=0)))


def test_a_collision_is_a_push_and_no_change(joints, monitor):
    found = watched(joints, monitor, "collision", 25.0, 3)
    assert found.pushed.all() and not np.isfinite(found.any_cause).any() and not found.early.any()


def test_the_tracked_changes_are_those_of_regularised_least_squares(joints):
    spec = ModelMonitorSpec(memory=1e12, rest=0.0)
    one = ModelMonitor(joints.models(), 0.4, 1e-6, spec)  # no correlation: every tick is a row of its own
    memory, shown = one.start()
    rng, rows, slow = np.random.default_rng(5), [], None
    for _ in range(40):
        seen = np.concatenate([rng.standard_normal((5, COUNT)), np.zeros((1, COUNT))])
        needed = one.needed(seen, np.full(COUNT, ROOM))
        one.tick(seen, needed, memory, shown)
        slow, phi = columns(joints, seen, needed, slow)
        rows.append((seen, needed, phi))
    for i in range(COUNT):
        design, target = [], []
        for seen, needed, phi in rows:
            design.append(phi[i])
            target.append(seen[4, i] / joints.gain[i] - needed[i])
        prior = np.array([spec.friction, spec.torque_constant, spec.payload, spec.payload, spec.delay, 0.0, spec.bias])
        prior[5] = spec.backlash if joints.servo[i] else 1e-150
        x, y = np.array(design) / 0.4, np.array(target) / 0.4
        expected = np.linalg.solve(x.T @ x * np.outer(prior, prior) + np.eye(7), prior * (x.T @ y)) * prior
        assert shown.reshape(COUNT, -1)[i, 4:] == pytest.approx(expected, rel=1e-6, abs=1e-9)


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
