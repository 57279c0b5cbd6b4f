"""Each stage on arrays computes what its system computes, to the last bit, also of inputs that are not finite."""

from typing import Any

import numpy as np
import pytest
from pydrake.systems.framework import PortDataType

from drake_tc.array_stage import Arrays, ArrayStage, offered_stage
from drake_tc.control.reference_source import ReferenceSource, StoppingReference
from drake_tc.control.references import PointToPoint
from drake_tc.estimation.link_position import LinkPosition
from drake_tc.sensing.sensor import Sensor, SensorFault, SensorSpec
from drake_tc.types import FloatArray

from .test_whole_body import wired

PERIOD = 1e-3
TICKS = 250
ODD = np.array([np.nan, np.inf, -np.inf, 1e300, -0.0])


def others() -> list[Any]:
    """Stages that the loop of `wired` does not have."""
    frozen = SensorFault(kind="frozen", start=0.02, duration=0.05, channels=(0,))
    late = SensorFault(kind="late", start=0.1, duration=0.05, value=0.004)
    path = ReferenceSource(PointToPoint((0.0,) * 3, (1.0,) * 3, 0.01, 0.2))
    path.set_name("path")
    return [
        path,
        StoppingReference(path, PERIOD),
        LinkPosition(np.full(4, 0.01), np.full(4, 0.002), PERIOD),
        Sensor(2, SensorSpec(noise=0.1, latency=0.003), PERIOD, (frozen, late), seed=3),
    ]


@pytest.fixture(scope="module")
def systems() -> dict[str, Any]:
    """Stages with vector inputs alone, whose state is discrete."""
    builder, _ = wired()
    found = {}
    for system in (*builder.GetSystems(), *others()):
        ports = (system.get_input_port(index) for index in range(system.num_input_ports()))
        vectors = all(port.get_data_type() == PortDataType.kVectorValued for port in ports)
        if offered_stage(system) is not None and vectors and not system.CreateDefaultContext().num_abstract_states():
            found[system.get_name() or type(system).__name__] = system
    return found


def on_arrays(stage: ArrayStage, inputs: dict[str, FloatArray]) -> tuple[list[Any], dict[str, FloatArray], list[Any]]:
    """Its functions for the outputs, its output ports, and its update with the state before and after."""
    before, after, calls, ports = stage.start.copy(), stage.start.copy(), [], {}
    update = None
    for part in (stage,) if stage.early is None else (stage.early, stage):
        out = np.zeros(part.width)
        outputs, changed = part.bind(Arrays(inputs, out, before, after))
        calls += [outputs] if callable(outputs) else list(outputs or ())
        ports |= {name: (out, where) for name, where in part.ports.items() if part is stage or name not in stage.ports}
        update = changed if part is stage else update
    updates = [update] if callable(update) else list(update or ())
    return calls, ports, [updates, before, after]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # infinity minus infinity, in filters of validated readings
def test_it_computes_what_its_system_computes(systems):
    assert {"tsid", "actuators", "base_estimator", "standing_feet", "joint_sensors", "path"} <= set(systems)
    for name, system in systems.items():
        check_on_arrays(name, system)


def check_on_arrays(name, system):
    rng = np.random.default_rng(0)
    stage: Any = offered_stage(system)
    context: Any = system.CreateDefaultContext()
    ports = [system.get_input_port(index) for index in range(system.num_input_ports())]
    inputs = {port.get_name(): np.zeros(port.size()) for port in ports}
    calls, outputs, (updates, before, after) = on_arrays(stage, inputs)
    every = max(1, round((stage.period or PERIOD) / PERIOD))
    steady = {port.get_name(): rng.normal(size=port.size()) for port in ports}
    for tick in range(TICKS):
        context.SetTime(PERIOD * tick)
        for port in ports:
            value = steady[port.get_name()] + 0.01 * rng.normal(size=port.size())
            if rng.random() < 0.2 and tick % 50 >= 20:
                value[rng.integers(port.size())] = rng.choice(ODD)
            inputs[port.get_name()][:] = value
            port.FixValue(context, value)
        for call in calls:
            call(PERIOD * tick)
        for port_name, (out, where) in outputs.items():
            expected = system.GetOutputPort(port_name).Eval(context)
            assert np.array_equal(out[where], expected, equal_nan=True), (name, tick, port_name)
        if stage.period is not None and tick % every == 0:
            after[:] = before
            for call in updates:
                call(PERIOD * tick)
            before[:] = after
            context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))


def test_it_reads_what_its_ports_depend_on_and_is_updated_at_the_same_times(systems):
    for name, system in systems.items():
        stage: Any = offered_stage(system)
        event = system.GetUniquePeriodicDiscreteUpdateAttribute()
        assert (event and (event.period_sec(), event.offset_sec())) == (stage.period and (stage.period, 0.0)), name
        inputs = [system.get_input_port(index).get_name() for index in range(system.num_input_ports())]
        assert stage.inputs <= set(inputs), name
        for index in range(system.num_output_ports()):
            part = stage.part_with(system.get_output_port(index).get_name())
            if part is not None:
                fed = {port for i, port in enumerate(inputs) if system.HasDirectFeedthrough(i, index)}
                assert fed <= part.reads, (name, index)
