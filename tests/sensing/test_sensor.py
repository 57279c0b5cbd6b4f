"""System: ports, feedthrough, output equals kernel, all changing data in the Context."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource, ZeroOrderHold
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.errors import ParamsError
from drake_tc.sensing.sensor import Sensor, SensorFault, SensorSpec, corrupt

DT = 1e-3
FAULTS = (SensorFault("frozen", 0.1, 0.05, (0,)), SensorFault("nan", 0.12, 0.01), SensorFault("biased", 0.2, value=1.0))
LATE = (SensorFault("late", 0.05, 0.1, (1,), value=0.02), SensorFault("late", 0.12, 0.2, value=7e-3))
CASES = {
    "perfect": (SensorSpec(), ()),
    "noisy": (SensorSpec(noise=0.1, scale=1.1, bias=(0.0, 1.0), resolution=(0.01, 0.0)), ()),
    "late": (SensorSpec(noise=0.1, latency=5e-3, dropout=0.1), ()),
    "failing": (SensorSpec(noise=0.1, resolution=0.02), FAULTS),
    "late and failing": (SensorSpec(noise=0.1, latency=3e-3, dropout=0.05), FAULTS),
    "late for a while": (SensorSpec(noise=0.1), LATE),
    "later for a while": (SensorSpec(noise=0.1, latency=3e-3, resolution=0.01), (*FAULTS, *LATE)),
}


def ramp() -> TrajectorySource:
    line = PiecewisePolynomial.FirstOrderHold([0.0, 10.0], np.array([[1.0, 11.0], [0.0, -20.0]]))
    return TrajectorySource(line)


def build(spec, faults, seed=0):
    """A diagram of ramp and sensor."""
    builder = DiagramBuilder()
    source, sensor = builder.AddSystem(ramp()), builder.AddSystem(Sensor(2, spec, DT, faults, seed))
    builder.Connect(source.get_output_port(), sensor.GetInputPort("truth"))
    return builder.Build()


def run(simulator, until):
    """Readings at each tick before `until`, seen before the tick's updates."""
    diagram, context = simulator.get_system(), simulator.get_context()
    sensor = next(s for s in diagram.GetSystems() if isinstance(s, Sensor))
    rows = []
    while context.get_time() < until - 0.5 * DT:
        rows.append(sensor.GetOutputPort("reading").Eval(sensor.GetMyContextFromRoot(context)).copy())
        simulator.AdvanceTo((round(context.get_time() / DT) + 1) * DT)
    return np.array(rows)


@pytest.mark.parametrize("case", CASES)
def test_a_simulation_reads_what_the_kernel_says(case):
    spec, faults = CASES[case]
    diagram = build(spec, faults, seed=9)
    simulator = Simulator(diagram)
    simulator.Initialize()
    got = run(simulator, 0.6)  # more than two blocks of random numbers
    t = np.arange(600)[:, None] * DT
    truth = np.hstack([1.0 + t, -2.0 * t])
    assert_allclose(got, corrupt(truth, spec, DT, faults, seed=9), atol=1e-11)  # rounding of the times


@pytest.mark.parametrize("case", CASES)
def test_a_system_that_samples_it_reads_the_same(case):
    """In the updates of a tick, also of the one in which the next block of random numbers is drawn."""
    spec, faults = CASES[case]
    builder = DiagramBuilder()
    source, sensor = builder.AddSystem(ramp()), builder.AddSystem(Sensor(2, spec, DT, faults, 9))
    hold = builder.AddSystem(ZeroOrderHold(DT, 2))
    builder.Connect(source.get_output_port(), sensor.GetInputPort("truth"))
    builder.Connect(sensor.GetOutputPort("reading"), hold.get_input_port())
    log = LogVectorOutput(hold.get_output_port(), builder, DT)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(600 * DT)
    held = log.FindLog(simulator.get_context()).data().T[1:601]
    t = np.arange(600)[:, None] * DT
    assert_allclose(held, corrupt(np.hstack([1.0 + t, -2.0 * t]), spec, DT, faults, seed=9), atol=1e-11)


@pytest.mark.parametrize("tick", [0, 255, 256, 1000])
def test_a_time_set_by_hand_is_served(tick):
    sensor = Sensor(2, SensorSpec(noise=0.1), DT, seed=4)
    context = sensor.CreateDefaultContext()
    sensor.get_input_port().FixValue(context, [0.0, 0.0])
    context.SetTime(tick * DT)
    want = corrupt(np.zeros((tick + 1, 2)), SensorSpec(noise=0.1), DT, seed=4)[tick]
    assert_array_equal(sensor.get_output_port().Eval(context), want)


def test_two_contexts_of_one_diagram_are_independent_and_repeatable():
    spec, faults = CASES["late and failing"]
    diagram = build(spec, faults, seed=2)
    alone = Simulator(diagram)
    alone.Initialize()
    want = run(alone, 0.3)
    first, second = Simulator(diagram), Simulator(diagram)
    first.Initialize()
    second.Initialize()
    parts = [[], []]
    for until in (0.07, 0.13, 0.3):  # in turns, at different times
        for simulator, part, ahead in zip((first, second), parts, (0.0, 0.05), strict=True):
            part.append(run(simulator, min(until + ahead, 0.3)))
    for part in parts:
        assert_array_equal(np.concatenate([rows for rows in part if rows.size]), want)


@pytest.mark.parametrize("pause", [0.1, 0.125, 0.256])
def test_a_cloned_context_continues_identically(pause):
    spec, faults = CASES["late and failing"]
    diagram = build(spec, faults, seed=2)
    simulator = Simulator(diagram)
    simulator.Initialize()
    run(simulator, pause)
    other = Simulator(diagram, simulator.get_context().Clone())
    other.Initialize()
    assert_array_equal(run(other, 0.3), run(simulator, 0.3))


def test_a_later_start_time_counts_its_ticks_from_there():
    spec, faults = SensorSpec(noise=0.1), (SensorFault("biased", 0.6, 0.1, value=5.0),)
    diagram = build(spec, faults, seed=3)
    simulator = Simulator(diagram)
    simulator.get_mutable_context().SetTime(0.5)
    simulator.Initialize()
    got = run(simulator, 0.8)
    t = np.arange(800)[:, None] * DT
    assert_allclose(got, corrupt(np.hstack([1.0 + t, -2.0 * t]), spec, DT, faults, seed=3)[500:], atol=1e-11)


def test_an_output_never_draws():
    sensor = Sensor(3, SensorSpec(noise=1.0, dropout=0.2), DT)
    context = sensor.CreateDefaultContext()
    port = sensor.GetInputPort("truth")
    seen = []
    for _ in range(3):
        port.FixValue(context, np.zeros(3))  # invalidates the output
        seen.append(sensor.get_output_port().Eval(context).copy())
    assert_array_equal(seen[0], seen[1])
    assert_array_equal(seen[0], seen[2])


def test_without_latency_the_truth_feeds_through_at_once():
    sensor = Sensor(2, SensorSpec(noise=0.1), DT, FAULTS)
    assert sensor.HasAnyDirectFeedthrough()
    context = sensor.CreateDefaultContext()
    port = sensor.GetInputPort("truth")
    port.FixValue(context, [0.0, 0.0])
    before = sensor.get_output_port().Eval(context).copy()
    port.FixValue(context, [1.0, -2.0])
    assert_allclose(sensor.get_output_port().Eval(context) - before, [1.0, -2.0], rtol=1e-12)


def test_every_state_moves_the_reading_as_declared():
    sensor = Sensor(2, SensorSpec(latency=2e-3), DT, [SensorFault("frozen", 0.0, channels=(1,))])
    assert not sensor.HasAnyDirectFeedthrough()
    context = sensor.CreateDefaultContext()
    sensor.get_input_port().FixValue(context, [7.0, 7.0])
    read = lambda: sensor.get_output_port().Eval(context).copy()  # noqa: E731
    now, line, last = range(3)
    assert_array_equal(read(), [np.nan, np.nan])  # nothing has come yet
    context.SetDiscreteState(line, [1.0, 2.0, 3.0, 4.0])
    assert_array_equal(read(), [1.0, 2.0])
    context.SetDiscreteState(last, [8.0, 9.0])
    assert_array_equal(read(), [1.0, 9.0])  # only the second channel is frozen
    row = context.get_discrete_state(now).value().copy()
    row[0] += 1.0
    context.SetDiscreteState(now, row)
    assert_array_equal(read(), [3.0, 9.0])  # the next row of the ring
    row[2:4] = [0.5, 0.0]
    context.SetDiscreteState(now, row)
    assert_array_equal(read(), [3.5, 9.0])
    sensor.get_input_port().FixValue(context, [70.0, 70.0])
    assert_array_equal(read(), [3.5, 9.0])


def test_the_latency_line_of_a_clone_is_not_filled_anew():
    diagram = build(SensorSpec(latency=0.01), ())
    simulator = Simulator(diagram)
    simulator.Initialize()
    run(simulator, 0.05)
    other = Simulator(diagram, simulator.get_context().Clone())
    other.Initialize()
    t = (np.arange(50, 70) - 10) * DT
    assert_allclose(run(other, 0.07), np.column_stack([1.0 + t, -2.0 * t]), atol=1e-11)


def test_refusals_come_from_the_constructor():
    with pytest.raises(ParamsError, match="at least one channel"):
        Sensor(0, SensorSpec(), DT)
    with pytest.raises(ParamsError, match="expected 0 to 1, got 3"):
        Sensor(2, SensorSpec(), DT, [SensorFault("nan", channels=(3,))])
