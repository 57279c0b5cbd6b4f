"""What `fuse` leaves as it is, and what a stage that it has removed still answers."""

from typing import Any

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Gain, LogVectorOutput, MatrixGain, Sine

from drake_tc.array_stage import Arrays
from drake_tc.control.reference_source import ReferenceSource, StoppingReference
from drake_tc.control.references import PointToPoint
from drake_tc.errors import ParamsError
from drake_tc.loops.fused import StageValues, fuse
from drake_tc.sensing.sensor import Sensor, SensorFault, SensorSpec
from drake_tc.sensor_validation.body_sensors import ValidatedWrench

from .test_small_diagrams import assert_fused_is_apart, chain, sensor, source
from .test_whole_body import wired

PERIOD = 1e-3


class Doubled(Sensor):
    """A sensor of the user's own that computes something else."""

    def _calc(self, context: Any, output: Any) -> None:
        super()._calc(context, output)
        output.set_value(2.0 * output.value())


class Counting(Sensor):
    """A sensor of the user's own with an event."""

    def __init__(self, seen: list[float]) -> None:
        super().__init__(2, SensorSpec(), PERIOD)
        self.DeclarePeriodicPublishEvent(PERIOD, 0.0, lambda context: seen.append(context.get_time()))


def test_a_subclass_that_computes_something_else_stays_a_system():
    def build(builder: DiagramBuilder) -> list[Any]:
        last = sensor()
        chain(builder, source(), sensor(), Doubled(2, SensorSpec(), PERIOD), last)
        return [LogVectorOutput(last.get_output_port(0), builder, PERIOD)]

    assert_fused_is_apart(build, 0.01)


def test_a_subclass_with_an_event_stays_a_system():
    seen: list[float] = []
    builder = DiagramBuilder()
    counting = Counting(seen)
    chain(builder, source(), sensor(), counting, sensor())
    assert fuse(builder) is not None
    assert counting in builder.GetSystems()
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.0105)
    assert len(seen) == 11


class Shifted(ReferenceSource):
    """A reference of the user's own that computes something else."""

    def _write(self, context: Any, vector: Any) -> None:
        vector.set_value(self._path.row(context.get_time()) + 1.0)


def test_a_stopping_reference_follows_a_source_of_the_users_own():
    moving = StoppingReference(Shifted(PointToPoint((0.0,) * 3, (1.0,) * 3, 0.0, 0.5)), PERIOD)
    context, out, x = moving.CreateDefaultContext(), np.zeros(9), np.array([0.1])
    state: Any = context
    state.SetDiscreteState(x)
    outputs, _ = moving.on_arrays().bind(Arrays({}, out, x, x.copy()))
    for time in (0.0, 0.05, 0.2, 1.0):
        context.SetTime(time)
        outputs(time)
        assert np.array_equal(out, moving.get_output_port().Eval(context))


@pytest.mark.parametrize("outside", [False, True])
def test_contacts_that_depend_on_a_reading_which_does_not_depend_on_them(outside):
    """On arrays, `reading` is computed together with `contacts`; the diagram has no algebraic loop."""

    def build(builder: DiagramBuilder) -> list[Any]:
        lost = SensorFault(kind="dropped", start=0.005, duration=0.01, channels=(2,))
        raw, checked, last = Sensor(12, SensorSpec(), PERIOD, (lost,)), ValidatedWrench(2, 2, (0, 1), PERIOD), sensor()
        chain(builder, Sine(1.0, 30.0, 0.1, 12), raw, checked)
        healthy = builder.AddSystem(ConstantVectorSource(np.zeros(4)))
        builder.Connect(healthy.get_output_port(), checked.GetInputPort("flagged"))
        contact = MatrixGain(np.kron(np.eye(2), [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
        signs = Gain(1.0, 2) if outside else MatrixGain(np.eye(2))
        for system in (contact, signs, last):
            builder.AddSystem(system)
        for port, system in ((checked.GetOutputPort("reading"), contact), (contact.get_output_port(), signs)):
            builder.Connect(port, system.get_input_port())
        builder.Connect(signs.get_output_port(), checked.GetInputPort("contacts"))
        builder.Connect(checked.GetOutputPort("contacts"), last.get_input_port(0))
        return [LogVectorOutput(last.get_output_port(0), builder, PERIOD)]

    assert_fused_is_apart(build, 0.03)


def test_stages_that_nothing_reads():
    builder = DiagramBuilder()
    chain(builder, source(), sensor())
    other = builder.AddSystem(sensor())
    builder.Connect(builder.GetSubsystemByName("s0").get_output_port(0), other.get_input_port(0))
    assert fuse(builder) is not None
    Simulator(builder.Build()).AdvanceTo(0.01)


def test_inputs_of_stages_are_those_of_systems_of_their_own():
    """Also those on which only the next state depends, and those of early outputs."""
    found = []
    for fused in (True, False):
        builder, loop = wired()
        loop.add_log(builder)
        stages = fuse(builder) if fused else None
        simulator = Simulator(builder.Build())
        loop.start(simulator.get_mutable_context(), stages)
        simulator.Initialize()
        simulator.AdvanceTo(0.004)
        values, systems = StageValues(simulator.get_mutable_context(), stages), loop.systems
        names = {"base_estimator": ("position", "velocity", "imu", "wrench"), "sensor_loss_stop": ("torque", "lost")}
        found.append({f"{name}.{port}": values.input(systems[name], port) for name in names for port in names[name]})
    for name, value in found[1].items():
        assert np.array_equal(found[0][name], value), name
    assert all(np.any(found[1][f"base_estimator.{name}"]) for name in ("position", "velocity", "imu", "wrench"))


@pytest.fixture(name="bare", scope="module")
def _bare() -> Any:
    """A fused loop without log, its stages and its diagram."""
    builder, loop = wired()
    stages = fuse(builder)
    return loop, stages, builder.Build()


def test_an_output_that_nothing_reads_is_refused_and_other_contexts_are_not_disturbed(bare):
    loop, stages, diagram = bare
    values = StageValues(diagram.CreateDefaultContext(), stages)
    for _ in range(2):
        with pytest.raises(ParamsError, match="is not computed, as nothing reads it"):
            values.output(loop.systems["flags"].get_output_port())
    simulator = Simulator(diagram)
    loop.start(simulator.get_mutable_context(), stages)
    simulator.AdvanceTo(0.002)


@pytest.mark.parametrize(
    ("name", "ask"),
    [
        ("tsid", lambda stage, context: stage.last_error(context)),
        ("base_estimator", lambda stage, context: stage.base_state(context)),
        ("actuators", lambda stage, context: stage.coordinates(context)),
        ("actuators", lambda stage, context: stage.set_coordinates(context, np.zeros(0))),
        ("actuators", lambda stage, context: stage.set_initial_velocity(context, np.zeros(23))),
        ("encoder", lambda stage, context: stage.coordinates(context)),
        ("velocity_filter", lambda stage, context: stage.coordinates(context)),
    ],
)
def test_a_removed_stage_refuses_contexts_of_other_systems(bare, name, ask):
    loop, stages, diagram = bare
    systems = {**loop.systems, "encoder": loop.sensors.encoder}
    root = diagram.CreateDefaultContext()
    for context in (systems[name].GetMyMutableContextFromRoot(root), stages.GetMyMutableContextFromRoot(root)):
        with pytest.raises(RuntimeError, match="Context"):
            ask(systems[name], context)


def test_a_fused_loop_is_started_with_what_fuse_returned(bare):
    loop, stages, diagram = bare
    with pytest.raises(ParamsError, match="has no Context in this diagram; if `fuse` has removed it"):
        loop.start(diagram.CreateDefaultContext())
    values = StageValues(diagram.CreateDefaultContext(), stages)
    with pytest.raises(ParamsError, match="has no Context in this diagram"):
        values.context_of(loop.systems["tsid"])
    with pytest.raises(ParamsError, match=r"expected \d+ numbers, got \(1,\)"):
        values.set_state(loop.systems["base_estimator"], np.zeros(1))
