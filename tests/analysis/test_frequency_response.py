"""Stepped sines against closed forms: linear systems, a describing function, drifts; and what is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    DiscreteTimeDelay,
    Gain,
    LinearSystem,
    Saturation,
    ZeroOrderHold,
)

from drake_tc.analysis.frequency_response import (
    Bandwidth,
    Channel,
    FrequencyResponse,
    Sweep,
    _lock_in,
    bandwidth,
    channel,
    continuous_phase,
    swept_sine,
)
from drake_tc.analysis.sampled import linearise
from drake_tc.errors import ParamsError, SimulationError

DT = 1e-3
HZ = (1.0, 3.0, 10.0, 40.0)


def chain(*systems):
    """(diagram, context) of a constant source and systems in a row."""
    builder = DiagramBuilder()
    size = systems[0][1].get_input_port(0).size()
    port = builder.AddNamedSystem("source", ConstantVectorSource(np.full(size, 0.3))).get_output_port()
    for name, system in systems:
        builder.AddNamedSystem(name, system)
        builder.Connect(port, system.get_input_port(0))
        port = system.get_output_port(0)
    diagram = builder.Build()
    return diagram, diagram.CreateDefaultContext()


def sampled(pole, gain=1.0, drift=0.0):
    """y[k+1] = pole y[k] + gain u[k]."""
    return LinearSystem([[pole]], [[gain]], [[1.0]], [[0.0]], DT)


def test_a_first_order_system_and_a_delay_have_their_closed_form():
    """H = g/(z - p) z^-7 at z = exp(j w dt): a delay of 6 + 1 ticks, as all update at once."""
    diagram, context = chain(("lag", sampled(0.97, 0.05)), ("late", DiscreteTimeDelay(DT, 6, 1)))
    sweep = Sweep(HZ, 0.2, 0.4, 0.5)
    found = swept_sine(diagram, context, DT, (channel("source:y0"), channel("late:delayed_u")), sweep)
    z = np.exp(2j * np.pi * found.frequency_hz * DT)
    assert_allclose(found.response, 0.05 / (z - 0.97) * z**-7, rtol=2e-5)
    assert_allclose(found.frequency_hz, HZ, rtol=0.01)
    assert (found.distortion < 1e-4).all()


def test_it_is_what_the_linearisation_says():
    diagram, context = chain(("lag", sampled(0.9, 0.3)), ("gain", Gain(2.0, 1)), ("hold", ZeroOrderHold(DT, 1)))
    ports = (channel("lag:u0"), channel("hold:y"))
    found = swept_sine(diagram, context, DT, ports, Sweep(HZ))
    system = linearise(diagram, context, DT, inputs=("lag:u0",), outputs=("hold:y",))
    predicted = system.response(2.0 * np.pi * found.frequency_hz)[:, 0, 0]
    assert_allclose(found.response, predicted, rtol=1e-5)


@pytest.mark.parametrize("amplitude", [0.5, 2.0, 5.0])
def test_a_saturation_has_its_describing_function_and_its_harmonics(amplitude):
    """N(a) = 2/pi (asin(1/a) + 1/a sqrt(1 - 1/a^2)) for a limit of 1, around 0."""
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("source", ConstantVectorSource([0.0]))
    clip = builder.AddNamedSystem("clip", Saturation([-1.0], [1.0]))
    builder.Connect(source.get_output_port(), clip.get_input_port())
    builder.Connect(clip.get_output_port(), builder.AddSystem(ZeroOrderHold(DT, 1)).get_input_port())
    diagram = builder.Build()
    ports = (channel("source:y0"), channel("clip:" + clip.get_output_port().get_name()))
    found = swept_sine(diagram, diagram.CreateDefaultContext(), DT, ports, Sweep((2.0,), amplitude, 0.0))
    share = min(1.0 / amplitude, 1.0)
    wanted = 2.0 / np.pi * (np.arcsin(share) + share * np.sqrt(1.0 - share**2))
    assert_allclose(found.response, [wanted], rtol=1e-4)
    if amplitude < 1.0:
        assert found.distortion[0] < 1e-9
    else:
        power = np.mean(np.clip(amplitude * np.sin(np.linspace(0.0, 2.0 * np.pi, 20001)[:-1]), -1.0, 1.0) ** 2)
        rest = np.sqrt(2.0 * power - (wanted * amplitude) ** 2) / (wanted * amplitude)
        assert_allclose(found.distortion, [rest], rtol=1e-3)


def test_neither_offset_nor_drift_leaks_in():
    """An integrator beside a gain: the constant 0.3 of the source makes a ramp on top of the sine's answer."""
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("source", ConstantVectorSource([0.0]))
    bias = builder.AddNamedSystem("bias", ConstantVectorSource([5.0]))
    ramp = builder.AddNamedSystem("ramp", LinearSystem([[1.0]], [[DT]], [[1.0]], [[0.0]], DT))
    total = builder.AddNamedSystem("total", Adder(2, 1))
    builder.Connect(bias.get_output_port(), ramp.get_input_port())
    builder.Connect(source.get_output_port(), total.get_input_port(0))
    builder.Connect(ramp.get_output_port(), total.get_input_port(1))
    builder.Connect(total.get_output_port(), builder.AddSystem(ZeroOrderHold(DT, 1)).get_input_port())
    diagram = builder.Build()
    ports = (channel("source:y0"), channel("total:sum"))
    found = swept_sine(diagram, diagram.CreateDefaultContext(), DT, ports, Sweep((1.0, 7.0), 0.1, 0.0, 0.5))
    assert_allclose(found.response, 1.0, rtol=1e-9)


def test_one_element_of_a_port_is_moved_and_one_is_read():
    two = LinearSystem(np.zeros((2, 2)), [[0.0, 2.0], [3.0, 0.0]], np.eye(2), np.zeros((2, 2)), DT)
    diagram, context = chain(("swap", two))
    ports = (channel("source:y0[1]"), channel("swap:y0[0]"))
    found = swept_sine(diagram, context, DT, ports, Sweep((5.0,), 1.0, 0.0, 0.4))
    assert_allclose(np.abs(found.response), 2.0, rtol=1e-9)
    silent = swept_sine(diagram, context, DT, (ports[0], channel("swap:y0[1]")), Sweep((5.0,), 1.0, 0.0, 0.4))
    assert_allclose(np.abs(silent.response), 0.0, atol=1e-12)


def test_the_context_stays_as_it_was():
    diagram, context = chain(("lag", sampled(0.9)))
    before = diagram.GetSubsystemByName("lag").GetMyContextFromRoot(context).get_discrete_state_vector().value().copy()
    swept_sine(diagram, context, DT, (channel("source:y0"), channel("lag:y0")), Sweep((5.0,), 1.0, 0.0, 0.4))
    own = diagram.GetSubsystemByName("lag").GetMyContextFromRoot(context)
    assert_allclose(own.get_discrete_state_vector().value(), before, rtol=0.0)
    assert context.get_time() == 0.0


def test_a_port_that_is_not_there_says_what_is():
    diagram, context = chain(("lag", sampled(0.9)))
    good = channel("source:y0")
    for name, says in (
        ("lagg:y0", "no system 'lagg'; systems: source, lag"),
        ("lag:y", "expected one of y0"),
        ("lag:y0[2]", "expected an element 0 to 0, got 2"),
    ):
        with pytest.raises(ParamsError, match=says.replace("[", r"\[")):
            swept_sine(diagram, context, DT, (good, channel(name)), Sweep((5.0,)))
    with pytest.raises(ParamsError, match=r"expected SYSTEM:PORT or SYSTEM:PORT\[i\]"):
        channel("lag:y0[x]")
    with pytest.raises(ParamsError, match=r"expected SYSTEM:PORT or SYSTEM:PORT\[i\]"):
        channel("lag:y0[\N{SUPERSCRIPT TWO}]")


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"frequencies_hz": ()}, "expected positive frequencies"),
        ({"frequencies_hz": (1.0, -2.0)}, "expected positive frequencies"),
        ({"frequencies_hz": (1.0,), "amplitude": 0.0}, "amplitude"),
        ({"frequencies_hz": (1.0,), "settle": -1.0}, "settle"),
    ],
)
def test_an_impossible_sweep_is_refused(fields, says):
    with pytest.raises(ParamsError, match=says):
        Sweep(**fields)


def test_what_is_too_fast_or_grows_out_of_numbers_is_refused():
    diagram, context = chain(("lag", sampled(2.0)))
    ports = (channel("source:y0"), channel("lag:y0"))
    with pytest.raises(ParamsError, match="expected frequencies below 400 Hz"):
        swept_sine(diagram, context, DT, ports, Sweep((450.0,)))
    done = []
    with pytest.raises(ParamsError, match="expected frequencies below 400 Hz"):
        swept_sine(diagram, context, DT, ports, Sweep((5.0, 450.0)), lambda *told: done.append(told))
    assert done == []  # before the first sine
    with pytest.raises(SimulationError, match="not finite at"):
        swept_sine(diagram, context, DT, ports, Sweep((5.0,), 1.0, 1.0, 0.5))


def test_the_bandwidth_is_where_three_decibels_are_lost_first():
    frequency = np.geomspace(1.0, 100.0, 41)
    lag = 1.0 / (1.0 + 1j * frequency / 20.0)
    nothing = np.full(frequency.size, np.nan)
    found = bandwidth(FrequencyResponse(frequency, lag, nothing))
    assert_allclose(found.hz, 20.0, rtol=0.01)
    assert not found.at_least
    assert bandwidth(FrequencyResponse(frequency, np.ones(41, complex), nothing)) == Bandwidth(100.0, at_least=True)
    for gain in (0.1, 10.0):  # not about 1 at the lowest frequency: there is nothing to drop from
        assert bandwidth(FrequencyResponse(frequency, gain * lag, nothing)) is None


def test_nothing_at_all_is_minus_infinity_and_no_number():
    found = FrequencyResponse(np.array([1.0]), np.zeros(1, complex), np.array([np.nan]))
    assert found.magnitude_db[0] == -np.inf


def test_what_has_not_settled_or_grows_is_no_steady_sine():
    """A pole at 1.002 grows by 2.7 in half a second; one of 10 s has hardly begun to settle; one of 5 ms is steady."""
    for pole, steady in ((1.002, False), (1.01, False), (0.98, True)):
        diagram, context = chain(("lag", sampled(pole, 0.01)))
        ports = (channel("source:y0"), channel("lag:y0"))
        found = swept_sine(diagram, context, DT, ports, Sweep((5.0,), 1.0, 0.5, 1.0))
        assert found.steady.tolist() == [steady], pole


def test_half_of_what_is_measured_being_another_sine_is_seen():
    """The halves' H of a sine whose amplitude rises by exp(g t): apart by 2 tanh(g T/4), to first order."""
    n, hz, growth = 1000, 5.0, 0.4
    t = np.arange(n) * DT
    _, _, apart = _lock_in(np.exp(growth * t) * np.sin(2.0 * np.pi * hz * t), hz, DT, 0, 1.0)
    assert_allclose(apart, 2.0 * np.tanh(0.25 * growth * n * DT), rtol=0.02)


@pytest.mark.parametrize("hz", [(1.0, 5.0, 9.0, 13.0, 17.0, 19.0), (12.0, 14.0), (1.0, 40.0), (399.0,)])
def test_a_delay_of_51_ms_is_on_its_own_turn_on_any_grid(hz):
    frequency = np.array(hz)

    def late(f):
        return np.exp(-2j * np.pi * f * 0.051)

    assert_allclose(continuous_phase(late, frequency), -2.0 * np.pi * frequency * 0.051, atol=1e-9)
    measured = FrequencyResponse(frequency, 0.9 * np.exp(0.1j) * late(frequency), np.zeros(frequency.size))
    assert np.abs(measured.phase).max() <= np.pi  # without a prediction
    placed = measured.near(continuous_phase(late, frequency))
    assert_allclose(placed.phase, -2.0 * np.pi * frequency * 0.051 + 0.1, atol=1e-9)


def test_a_sharp_resonance_turns_the_phase_by_180_degrees_on_the_right_side():
    """1/(1 - r^2 + 2 j zeta r), zeta = 1e-4, between two points; a double integrator begins at -180 and stays."""

    def resonance(f):
        r = f / 7.123
        return 1.0 / (1.0 - r**2 + 2e-4j * r)

    assert_allclose(np.degrees(continuous_phase(resonance, np.array([1.0, 30.0]))), [0.0, -180.0], atol=0.1)
    masses = continuous_phase(lambda f: -1.0 / f**2 + 0j, np.array([1.0, 2.0]))
    assert_allclose(np.degrees(masses), -180.0, atol=1e-9)


def test_a_channel_reads_as_it_is_written():
    assert channel("a::b:out") == Channel("a::b:out", 0)
    assert channel("b:out[12]") == Channel("b:out", 12)
    assert Channel("b:out", 12).name == "b:out[12]"
