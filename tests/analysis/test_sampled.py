"""Linearisation of small diagrams whose sampled system is known in closed form."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import (
    Adder,
    DiscreteTimeDelay,
    Gain,
    LinearSystem,
    MatrixGain,
    Saturation,
    ZeroOrderHold,
)
from scipy.linalg import expm

from drake_tc.analysis.release import release
from drake_tc.analysis.sampled import SampledSystem, linearise, open_loop
from drake_tc.analysis.state_coordinates import StateCoordinates
from drake_tc.control.stability_margins import margins
from drake_tc.errors import ParamsError
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter, savgol_weights
from drake_tc.sensing.sensor import Sensor
from drake_tc.sensing.spec import SensorSpec

DT = 0.02
A = np.array([[0.0, 1.0], [-9.0, -0.4]])
B, C = np.array([[0.0], [3.0]]), np.array([[1.0, 0.0]])


def servo(gain=-2.0, delay=0, dt=DT):
    """A continuous oscillator, sampled and held, fed back through a gain and a delay of some ticks."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", LinearSystem(A, B, C, np.zeros((1, 1))))
    control = builder.AddNamedSystem("control", Gain(gain, 1))
    hold = builder.AddNamedSystem("hold", ZeroOrderHold(dt, 1))
    source = plant.get_output_port()
    if delay:
        late = builder.AddNamedSystem("late", DiscreteTimeDelay(dt, delay, 1))
        builder.Connect(source, late.get_input_port())
        source = late.get_output_port()
    builder.Connect(source, control.get_input_port())
    builder.Connect(control.get_output_port(), hold.get_input_port())
    builder.Connect(hold.get_output_port(), plant.get_input_port())
    return builder.Build()


def discretised(dt=DT):
    block = expm(dt * np.block([[A, B], [np.zeros((1, 3))]]))
    return block[:2, :2], block[:2, 2:]


@pytest.mark.parametrize("dt", [DT, 1e-3])
def test_a_sampled_continuous_loop_is_its_matrix_exponential(dt):
    diagram = servo(-2.0, dt=dt)
    found = linearise(diagram, diagram.CreateDefaultContext(), dt)
    ad, bd = discretised(dt)
    wanted = np.linalg.eigvals(ad + bd @ (-2.0 * C))  # the hold passes its input on at the tick
    moving = found.eigenvalues[np.abs(found.eigenvalues) > 1e-6]
    assert_allclose(np.sort_complex(moving), np.sort_complex(wanted), atol=1e-8)


def test_the_open_loop_at_an_output_and_at_an_input_port():
    diagram = servo(-2.0)
    ad, bd = discretised()
    omega = np.geomspace(0.5, 100.0, 20)
    wanted = [2.0 * (C @ np.linalg.solve(np.exp(1j * w * DT) * np.eye(2) - ad, bd))[0, 0] for w in omega]
    for port in ("control:y0", "control:u0", "hold:u"):
        cut = open_loop(diagram, diagram.CreateDefaultContext(), DT, port)
        assert_allclose(cut.loop_response()(omega), wanted, rtol=1e-6)
        closed = linearise(diagram, diagram.CreateDefaultContext(), DT)
        assert_allclose(cut.closed().spectral_radius, closed.spectral_radius, atol=1e-8)


def test_delays_are_states_oldest_first():
    for ticks in (1, 3):
        diagram = servo(-2.0, ticks)
        cut = open_loop(diagram, diagram.CreateDefaultContext(), DT, "control:y0")
        prompt = servo(-2.0)
        free = open_loop(prompt, prompt.CreateDefaultContext(), DT, "control:y0")
        omega = np.geomspace(0.5, 100.0, 10)
        age = (ticks + 1) * DT  # the hold reads, at a tick, what the delay held before it
        later = free.loop_response()(omega) * np.exp(-1j * omega * age)
        assert_allclose(cut.loop_response()(omega), later, rtol=1e-6)


def test_the_gain_margin_is_where_the_closed_loop_oscillates():
    diagram = servo(-1.0, 2)
    found = margins(open_loop(diagram, diagram.CreateDefaultContext(), DT, "control:y0").loop_response(), DT)
    for factor, stable in ((0.98, True), (1.02, False)):
        other = servo(-found.gain_margin * factor, 2)
        radius = linearise(other, other.CreateDefaultContext(), DT).spectral_radius
        assert (radius < 1.0) is stable


def filtered(window=7, tick=0.001):
    builder = DiagramBuilder()
    state = builder.AddNamedSystem(
        "state", LinearSystem(np.eye(1), tick * np.eye(1), np.eye(1), np.zeros((1, 1)), tick)
    )
    smooth = builder.AddNamedSystem("smooth", SavitzkyGolayFilter(1, window, 2, tick))
    gain = builder.AddNamedSystem("gain", MatrixGain(np.array([[-3.0]])))
    builder.Connect(state.get_output_port(), smooth.get_input_port())
    builder.Connect(smooth.GetOutputPort("value"), gain.get_input_port())
    builder.Connect(gain.get_output_port(), state.get_input_port())
    return builder.Build()


def test_a_ring_buffer_gives_the_same_matrix_wherever_its_head_is():
    from pydrake.systems.analysis import Simulator

    diagram = filtered()
    simulator = Simulator(diagram)
    matrices = []
    for tick in (20, 23):
        simulator.AdvanceTo(tick * 0.001)
        matrices.append(linearise(diagram, simulator.get_context(), 0.001))
    assert_allclose(matrices[0].a, matrices[1].a, atol=1e-9)
    # x[k+1] = x[k] - 3 dt w.[x[k-7] ... x[k-1]]: one polynomial
    weights = savgol_weights(7, 2, None, 0, 0.001)[::-1]
    polynomial = np.concatenate(([1.0, -1.0], np.zeros(7))) + 0.003 * np.concatenate(([0.0, 0.0], weights))
    wanted = np.roots(polynomial)
    assert_allclose(matrices[0].spectral_radius, np.abs(wanted).max(), atol=1e-8)


def test_coordinates_go_there_and_back():
    diagram = filtered()
    context = diagram.CreateDefaultContext()
    coordinates = StateCoordinates(diagram, context)
    x = np.random.default_rng(0).normal(size=coordinates.size)
    coordinates.write(context, x)
    assert_allclose(coordinates.read(context), x, rtol=0, atol=0)
    smooth = diagram.GetSubsystemByName("smooth")
    value = smooth.GetOutputPort("value").Eval(smooth.GetMyContextFromRoot(context))
    window = x[[i for i, name in enumerate(coordinates.names) if name.startswith("smooth")]]
    assert_allclose(value, savgol_weights(7, 2, None, 0, 0.001) @ window, rtol=1e-12)


def test_a_limit_at_the_operating_point_is_named_as_a_kink():
    for limit, kinked in ((0.0, True), (-1.0, False)):
        builder = DiagramBuilder()
        hold = builder.AddNamedSystem("memory", DiscreteTimeDelay(DT, 1, 1))
        clip = builder.AddNamedSystem("clip", Saturation(np.array([limit]), np.array([1.0])))
        builder.Connect(hold.get_output_port(), clip.get_input_port())
        builder.Connect(clip.get_output_port(), hold.get_input_port())
        diagram = builder.Build()
        found = linearise(diagram, diagram.CreateDefaultContext(), DT)
        assert bool(found.kinks) is kinked


def test_what_nothing_changes_is_no_state():
    builder = DiagramBuilder()
    builder.AddNamedSystem("constant", ConstantState())
    other = builder.AddNamedSystem("other", DiscreteTimeDelay(DT, 1, 1))
    half = builder.AddNamedSystem("half", Gain(0.5, 1))
    builder.Connect(other.get_output_port(), half.get_input_port())
    builder.Connect(half.get_output_port(), other.get_input_port())
    diagram = builder.Build()
    found = linearise(diagram, diagram.CreateDefaultContext(), DT)
    assert not any(name.startswith("constant") for name in found.states)
    assert_allclose(found.spectral_radius, 0.5**0.5, atol=1e-9)  # a delay of one tick keeps two samples


class ConstantState(LeafSystem):
    def __init__(self):
        super().__init__()
        self.DeclareDiscreteState(2)


def noisy(spec):
    builder = DiagramBuilder()
    memory = builder.AddNamedSystem("memory", DiscreteTimeDelay(DT, 1, 1))
    sensor = builder.AddNamedSystem("sensor", Sensor(1, spec, DT))
    total = builder.AddNamedSystem("total", Adder(1, 1))
    builder.Connect(memory.get_output_port(), sensor.GetInputPort("truth"))
    builder.Connect(sensor.GetOutputPort("reading"), total.get_input_port(0))
    builder.Connect(total.get_output_port(), memory.get_input_port())
    return builder.Build()


def test_refusals():
    for spec in (SensorSpec(noise=1e-3), SensorSpec(resolution=1e-3)):
        diagram = noisy(spec)
        with pytest.raises(ParamsError, match="sensor 'sensor': expected neither noise, quantisation"):
            linearise(diagram, diagram.CreateDefaultContext(), DT)
    late = noisy(SensorSpec(latency=3 * DT))
    assert StateCoordinates(late, late.CreateDefaultContext()).size == 2 + 3
    diagram = servo()
    context = diagram.CreateDefaultContext()
    for port, message in (
        ("control", "expected SYSTEM:PORT"),
        ("nobody:y0", "no system 'nobody'; systems: plant, control, hold"),
        ("control:x", "expected one of y0, u0"),
    ):
        with pytest.raises(ParamsError, match=message):
            open_loop(diagram, context, DT, port)
    context.SetTime(0.5 * DT)
    with pytest.raises(ParamsError, match="expected a time that is a multiple of dt"):
        linearise(diagram, context, DT)
    with pytest.raises(ParamsError, match=r"SampledSystem.b: expected shape \(1, 2\)"):
        SampledSystem(np.eye(1), np.eye(1), np.eye(1), np.eye(1), DT, ("x",), ("u", "v"), ("y",))


@pytest.mark.parametrize("gain", [-1.0, -40.0])
def test_a_kick_grows_or_dies_as_the_eigenvalues_say(gain):
    diagram = servo(gain, 2)
    context = diagram.CreateDefaultContext()
    radius = linearise(diagram, context, DT).spectral_radius
    freed = release(diagram, context, DT, {"plant[0]": 1e-3, "plant[1]": 0.0}, 4.0)
    assert freed.stable is bool(radius < 1.0)
    with pytest.raises(ParamsError, match="no state 'plant\\[9\\]'"):
        release(diagram, context, DT, {"plant[9]": 1.0}, 1.0)


def test_what_drifts_is_left_out_of_what_moves():
    a = np.diag([0.5, 1.0, -0.9, 1.0 + 1e-6])
    system = SampledSystem(a, np.zeros((4, 0)), np.zeros((0, 4)), np.zeros((0, 0)), DT, ("w", "x", "y", "z"), (), ())
    assert_allclose(system.moving(), [-0.9, 0.5], rtol=1e-12)
    assert_allclose(system.moving(1e-7), [1.0 + 1e-6, -0.9, 0.5], rtol=1e-12)
    assert system.radius_but_for_drift() == 0.9 and system.spectral_radius == 1.0 + 1e-6
