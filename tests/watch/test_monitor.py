"""`ModelMonitor` on joints by closed-form motions, its ports, and its kernel against NumPy."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

import drake_tc
from drake_tc.errors import ParamsError
from drake_tc.watch.monitor import CAUSES, ModelMonitor, ModelMonitorSpec
from tests.benchmarks.monitor_hours import ROOM, Joints, calibrated, readings, watched

COUNT = 6


@pytest.fixture(scope="module")
def joints() -> Joints:
    return Joints.drawn(np.random.default_rng(3), COUNT)


@pytest.fixture(scope="module")
def monitor(joints) -> ModelMonitor:
    return calibrated(joints, 3)


def shown_after(joints, monitor, change, seconds=15.0):
    """(n, 4 + C) outputs, and the whitened residuals of the rows (R, n)."""
    memory, shown = monitor.start()
    table, last, rows = shown.reshape(COUNT, -1), np.full(COUNT, np.nan), []
    for _, chunk in readings(joints, seconds, np.random.default_rng(4), change, 0.0):
        for seen in chunk:
            needed = monitor.needed(seen, np.full(COUNT, ROOM))
            monitor.tick(seen, needed, last, memory, shown)
            last = needed
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
    last = np.full(COUNT, np.nan)
    for _, chunk in readings(joints, 0.5, np.random.default_rng(4), {}, 0.0):
        for number, seen in enumerate(chunk):
            if 100 <= number < 160:
                seen = seen.copy()
                seen[channel] = np.nan
            needed = monitor.needed(seen, np.full(COUNT, ROOM))
            monitor.tick(seen, needed, last, memory, shown)
            last = needed
    assert np.isfinite(memory).all() and np.isfinite(shown).all()


def test_more_friction_is_named_and_tracked(joints, monitor):
    table, _ = shown_after(joints, monitor, {"friction": 0.3})
    assert [CAUSES[int(c) - 1] for c in table[:, 1]] == ["friction"] * COUNT
    tracked = table[:, 4 + CAUSES.index("friction")]
    assert np.all(np.abs(table[:, 2] - 0.3) < 0.08)
    assert abs(np.median(tracked) - 0.3) < 0.15  # beside the other causes, with which strokes of one kind confuse it


def test_a_collision_is_a_push_and_no_change(joints, monitor):
    found = watched(joints, monitor, "collision", 25.0, 3)
    assert found.pushed.all() and not np.isfinite(found.any_cause).any() and not found.early.any()


def test_the_tracked_changes_are_those_of_regularised_least_squares(joints):
    spec = ModelMonitorSpec(memory=1e12, rest=0.0)
    one = ModelMonitor(joints.models(), 0.4, 1e-6, spec)  # no correlation: every tick is a row of its own
    memory, shown = one.start()
    rng, rows = np.random.default_rng(5), []
    last = np.full(COUNT, np.nan)
    for _ in range(40):
        seen = np.concatenate([rng.standard_normal((5, COUNT)), np.zeros((1, COUNT))])
        needed = one.needed(seen, np.full(COUNT, ROOM))
        one.tick(seen, needed, last, memory, shown)
        rows.append((seen, needed, needed if np.isnan(last).any() else last))
        last = needed
    for i in range(COUNT):
        design, target = [], []
        for seen, needed, before in rows:
            q, _, a, load, effort, _ = seen[:, i]
            rate = (needed[i] - before[i]) / 1e-3
            friction = needed[i] - load - joints.inertia[i] * a
            gap = np.sign(needed[i]) / joints.gain[i]
            design.append([friction, needed[i], np.sin(q), np.cos(q), rate, gap, 1.0])
            target.append(effort / joints.gain[i] - needed[i])
        prior = np.array([spec.friction, spec.torque_constant, spec.payload, spec.payload, spec.delay, 0.0, spec.bias])
        prior[5] = spec.backlash if joints.servo[i] else 1e-150
        x, y = np.array(design) / 0.4, np.array(target) / 0.4
        expected = np.linalg.solve(x.T @ x * np.outer(prior, prior) + np.eye(7), prior * (x.T @ y)) * prior
        assert shown.reshape(COUNT, -1)[i, 4:] == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_the_system_shows_what_its_tick_computes(joints):
    one = ModelMonitor(joints.models(), 0.4, 0.02)
    seen = np.concatenate([np.random.default_rng(6).standard_normal((5, COUNT)), np.zeros((1, COUNT))])
    builder = DiagramBuilder()
    system = builder.AddSystem(one)
    for name, values in zip(("position", "velocity", "acceleration", "load_torque", "effort"), seen, strict=False):
        source = builder.AddSystem(ConstantVectorSource(values))
        builder.Connect(source.get_output_port(), system.GetInputPort(name))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.1)
    context = system.GetMyContextFromRoot(simulator.get_context())
    memory, shown = one.start()
    last = np.full(COUNT, np.nan)
    needed = one.needed(seen, np.full(COUNT, ROOM))
    for _ in range(100):
        one.tick(seen, needed, last, memory, shown)
        last = needed
    table = shown.reshape(COUNT, -1)
    for number, name in enumerate(("residual", "cause", "change", "statistic")):
        np.testing.assert_array_equal(system.GetOutputPort(name).Eval(context), table[:, number])
    np.testing.assert_array_equal(system.GetOutputPort("tracked").Eval(context), table[:, 4:].ravel())


def test_it_stands_at_the_front_door_and_refuses_a_deviation_of_zero(joints):
    with pytest.raises(ParamsError, match="deviation: expected positive numbers"):
        drake_tc.ModelMonitor(joints.models(), 0.0, 0.02)
