"""Fused sensors, filters and blocks of Drake's own in small diagrams: the same numbers, or a refusal that says why."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import Gain, LogVectorOutput, MatrixGain, Selector, SelectorParams, Sine

from drake_tc.array_stage import Arrays
from drake_tc.errors import ParamsError
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.loops.fused import fuse
from drake_tc.loops.fused.plan import computed
from drake_tc.sensing.sensor import Sensor, SensorFault, SensorSpec
from drake_tc.types import FloatArray

Logs = list[Any]


def chain(builder: DiagramBuilder, *systems: Any) -> None:
    """Connect the first output of each system to the first input of the next one; named by their place."""
    for number, system in enumerate(systems):
        builder.AddNamedSystem(f"s{number}", system)
        if number:
            builder.Connect(systems[number - 1].get_output_port(0), system.get_input_port(0))


def assert_fused_is_apart(build: Callable[[DiagramBuilder], Logs], duration: float, *, again: bool = False) -> None:
    """Compare all logs with and without `fuse`; `again`: of a second run that starts at t = 0 on the used Context."""
    found: list[list[FloatArray]] = []
    for fused in (True, False):
        builder = DiagramBuilder()
        logs = build(builder)
        if fused:
            assert fuse(builder) is not None
        simulator = Simulator(builder.Build())
        simulator.Initialize()
        simulator.AdvanceTo(duration)
        if again:
            context = simulator.get_mutable_context()
            for log in logs:
                log.FindMutableLog(context).Clear()
            context.SetTime(0.0)
            simulator.Initialize()
            simulator.AdvanceTo(duration)
        found.append([log.FindLog(simulator.get_context()).data().copy() for log in logs])
    for one, other in zip(*found, strict=True):
        assert np.array_equal(one, other, equal_nan=True)


def source() -> LeafSystem:
    return Sine(1.0, 30.0, 0.1, 2)


def sensor(dt: float = 1e-3, **spec: float) -> Sensor:
    return Sensor(2, SensorSpec(**spec), dt)


def swapping() -> Selector:
    params = SelectorParams()
    params.inputs = [SelectorParams.InputPortParams(name="all", size=2)]
    picks = [SelectorParams.OutputSelection(input_port_index=0, input_offset=i) for i in (1, 0)]
    params.outputs = [SelectorParams.OutputPortParams(name="swapped", selections=picks)]
    return Selector(params)


def test_a_block_that_is_logged_behind_a_system_of_the_users_own():
    """No stage computes on the level of this signal: the filter reads it in its update alone."""

    def build(builder: DiagramBuilder) -> Logs:
        select, smooth = swapping(), SavitzkyGolayFilter(2, 5, 2, 1e-3)
        chain(builder, source(), sensor(), Gain(2.0, 2), select, smooth)
        ports = (select.get_output_port(0), smooth.GetOutputPort("value"))
        return [LogVectorOutput(port, builder, 1e-3) for port in ports]

    assert_fused_is_apart(build, 0.03)


def test_several_periods():
    def build(builder: DiagramBuilder) -> Logs:
        filters = (
            SavitzkyGolayFilter(2, 5, 2, 1e-3),
            SavitzkyGolayFilter(2, 3, 1, 2e-3),
            SavitzkyGolayFilter(2, 5, 2, 3e-3),
        )
        chain(builder, source(), sensor(noise=0.1), *filters)
        return [LogVectorOutput(each.GetOutputPort("estimate"), builder, 5e-4) for each in filters]

    assert_fused_is_apart(build, 0.04)


@pytest.mark.parametrize("dt", [1e-3, 1])
def test_noise_of_a_run_that_starts_anew(dt):
    """Also with a period that is a whole number: the kernels read real numbers from memory."""

    def build(builder: DiagramBuilder) -> Logs:
        last = Sensor(2, SensorSpec(noise=0.1), dt, seed=1)
        chain(builder, source(), sensor(dt, noise=0.1), last)
        return [LogVectorOutput(last.get_output_port(0), builder, float(dt))]

    assert_fused_is_apart(build, 300.0 * dt, again=True)


@pytest.mark.parametrize("again", [False, True])
def test_sensors_that_remember_earlier_ticks(again):
    """Latency, frozen and late readings; the delay line begins with the first truth."""

    def build(builder: DiagramBuilder) -> Logs:
        frozen = SensorFault(kind="frozen", start=0.005, duration=0.01, channels=(0,))
        late = SensorFault(kind="late", start=0.01, duration=0.01, value=0.004)
        delayed = sensor(noise=0.1, latency=0.003)
        faulty = [Sensor(2, SensorSpec(noise=0.1, latency=1e-3 * k), 1e-3, (frozen, late), seed=k) for k in range(2)]
        chain(builder, source(), delayed, *faulty)
        return [LogVectorOutput(each.get_output_port(0), builder, 1e-3) for each in (delayed, *faulty)]

    assert_fused_is_apart(build, 0.03, again=again)


def test_a_late_sensor_counts_from_the_start_time():
    found = []
    for fused in (True, False):
        builder = DiagramBuilder()
        chain(builder, source(), sensor(noise=0.1, latency=0.003), sensor(noise=0.2))
        log = LogVectorOutput(builder.GetSubsystemByName("s2").get_output_port(0), builder, 1e-3)
        if fused:
            assert fuse(builder) is not None
        simulator = Simulator(builder.Build())
        simulator.get_mutable_context().SetTime(0.5)
        simulator.Initialize()
        simulator.AdvanceTo(0.52)
        found.append(log.FindLog(simulator.get_context()).data().copy())
    assert np.isfinite(found[0]).all()
    assert np.array_equal(*found)


def test_a_reading_that_is_lost_is_lost_behind_a_matrix_that_only_selects():
    """0 times NaN is NaN."""

    def build(builder: DiagramBuilder) -> Logs:
        fault = SensorFault(kind="dropped", start=0.005, duration=0.01, channels=(0,))
        lossy, last = Sensor(2, SensorSpec(), 1e-3, (fault,)), Sensor(1, SensorSpec(), 1e-3)
        chain(builder, source(), lossy, MatrixGain(np.array([[0.0, 1.0]])), last)
        return [LogVectorOutput(last.get_output_port(0), builder, 1e-3)]

    assert_fused_is_apart(build, 0.02)


def test_a_product_that_runs_alone_sums_as_drake_does():
    rng = np.random.default_rng(0)
    for _ in range(100):
        rows, columns = rng.integers(1, 9, 2)
        gain, u = MatrixGain(rng.normal(size=(rows, columns))), rng.normal(size=columns)
        context, out = gain.CreateDefaultContext(), np.zeros(rows)
        port: Any = gain.get_input_port()
        port.FixValue(context, u)
        nothing = np.zeros(0)
        outputs, _ = computed(gain).bind(Arrays({port.get_name(): u}, out, nothing, nothing))
        outputs(0.0)
        assert np.array_equal(out, gain.get_output_port().Eval(context))


def test_a_circle_through_a_system_of_the_users_own_is_refused():
    builder = DiagramBuilder()
    first, last, back = sensor(), sensor(), Gain(0.5, 2)
    chain(builder, first, last, back)
    builder.Connect(back.get_output_port(), first.get_input_port(0))
    with pytest.raises(ParamsError, match=r"s2\.y0 depends on itself within a tick"):
        fuse(builder)


def test_an_input_that_is_not_connected_is_refused_and_the_builder_stays_as_it_is():
    builder = DiagramBuilder()
    chain(builder, sensor(), sensor())
    LogVectorOutput(builder.GetSubsystemByName("s1").get_output_port(0), builder, 1e-3)
    with pytest.raises(ParamsError, match="input port 'truth' of 's0' is not connected"):
        fuse(builder)
    assert builder.HasSubsystemNamed("s0")
