"""WrenchTare: what it takes for bias and what it leaves out, ports and state; readings are Drake's reaction forces."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from drake_tc.errors import ParamsError
from drake_tc.estimation.joint_torque import WrenchTare
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.sensing.sensor import Sensor
from drake_tc.sensing.spec import SensorSpec

from .machines import Truth, random_robot

BIAS = np.array([1.0, -2.0, 3.0, 0.1, -0.2, 0.3, -4.0, 5.0, -6.0, 0.4, -0.5, 0.6])


@pytest.fixture(scope="module")
def moving(tmp_path_factory):
    """(model, instant): a tree with a floating base and two F/T sensors in violent motion, which nothing touches."""
    rng = np.random.default_rng(3)
    robot = random_robot(tmp_path_factory.mktemp("robot"), rng, fixed_base=False)
    return TorqueModel(robot), Truth(robot).instant(rng)


def fixed(tare, instant, reading):
    """A Context whose inputs are those of an instant."""
    context = tare.CreateDefaultContext()
    fix(tare, context, instant, reading)
    return context


def fix(tare, context, instant, reading):
    joint = np.concatenate([instant.q, instant.v, instant.vdot])
    imu = np.concatenate([instant.imu, instant.gyro_dot, np.zeros(3)])
    for name, value in (("joint_estimate", joint), ("imu_estimate", imu), ("wrench", reading)):
        tare.GetInputPort(name).FixValue(context, value)


def output(tare, context):
    return tare.GetOutputPort("wrench").Eval(context)


def test_the_bias_is_found_in_motion_and_taken_off(moving):
    model, instant = moving
    tare = WrenchTare(model, 0.1, 0.3)
    context = fixed(tare, instant, instant.readings + BIAS)
    simulator = Simulator(tare, context)
    simulator.AdvanceTo(0.095)
    assert_array_equal(output(tare, context), instant.readings + BIAS)  # not yet
    simulator.AdvanceTo(0.5)
    # round-off of forces of some hundred newtons
    assert_allclose(output(tare, context), instant.readings, atol=1e-9 * np.abs(instant.readings).max())
    assert context.get_discrete_state_vector().value()[-1] == 21.0  # 0.10, 0.11 ... 0.30 s
    fix(tare, context, instant, instant.readings + BIAS + 100.0)
    simulator.AdvanceTo(0.6)  # what comes later is no bias
    assert_allclose(output(tare, context), instant.readings + 100.0, atol=1e-9 * np.abs(instant.readings).max())


def test_the_bias_of_noisy_sensors_is_found_within_their_statistics(moving):
    model, instant = moving
    spec = SensorSpec(noise=0.5, bias=tuple(BIAS))
    builder = DiagramBuilder()
    sensor = builder.AddSystem(Sensor(12, spec, 1e-3, seed=5))
    tare = builder.AddSystem(WrenchTare(model, 0.05, 1.04))
    joint = np.concatenate([instant.q, instant.v, instant.vdot])
    imu = np.concatenate([instant.imu, instant.gyro_dot, np.zeros(3)])
    sources = (
        (instant.readings, sensor.GetInputPort("truth")),
        (joint, tare.GetInputPort("joint_estimate")),
        (imu, tare.GetInputPort("imu_estimate")),
    )
    for value, port in sources:
        builder.Connect(builder.AddSystem(ConstantVectorSource(value)).get_output_port(), port)
    builder.Connect(sensor.GetOutputPort("reading"), tare.GetInputPort("wrench"))
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(1.2)
    state = tare.GetMyContextFromRoot(simulator.get_context()).get_discrete_state_vector().value()
    assert state[-1] == 100.0
    error = state[:12] - BIAS
    # the mean of 100 draws of 0.5 N: 0.05 N; twelve of them stay within four of it, and are not exact
    assert np.abs(error).max() < 4.0 * 0.05
    assert np.sqrt(np.mean(error**2)) > 0.2 * 0.05


def test_the_correction_zeroes_other_readings_of_the_same_sensors(moving):
    model, instant = moving
    tare = WrenchTare(model, 0.0, 0.1)
    context = fixed(tare, instant, instant.readings + BIAS)
    assert_array_equal(tare.GetOutputPort("correction").Eval(context), np.zeros(12))
    Simulator(tare, context).AdvanceTo(0.2)
    assert_allclose(tare.GetOutputPort("correction").Eval(context), -BIAS, atol=1e-9 * np.abs(instant.readings).max())
    port = tare.GetOutputPort("correction").get_index()
    assert not any(tare.HasDirectFeedthrough(i, port) for i in range(tare.num_input_ports()))


def test_samples_that_are_not_finite_are_left_out(moving):
    model, instant = moving
    tare = WrenchTare(model, 0.1, 0.3)
    broken = instant.readings + BIAS
    broken[4] = np.nan
    context = fixed(tare, instant, broken)
    simulator = Simulator(tare, context)
    simulator.AdvanceTo(0.155)
    assert_array_equal(context.get_discrete_state_vector().value(), np.zeros(13))
    assert np.isnan(output(tare, context)).tolist() == (np.arange(12) == 4).tolist()
    fix(tare, context, instant._replace(vdot=np.full_like(instant.vdot, np.inf)), instant.readings + BIAS)
    simulator.AdvanceTo(0.205)
    assert_array_equal(context.get_discrete_state_vector().value(), np.zeros(13))
    fix(tare, context, instant, instant.readings + BIAS)
    simulator.AdvanceTo(0.5)
    state = context.get_discrete_state_vector().value()
    assert_allclose(state[:12], BIAS, atol=1e-9 * np.abs(instant.readings).max())
    assert state[-1] == 10.0  # 0.21 ... 0.30 s


def test_the_output_depends_on_wrench_and_state_alone(moving):
    model, instant = moving
    tare = WrenchTare(model, 0.1, 0.3)
    names = [tare.get_input_port(i).get_name() for i in range(tare.num_input_ports())]
    assert [name for i, name in enumerate(names) if tare.HasDirectFeedthrough(i, 0)] == ["wrench"]
    context = fixed(tare, instant, instant.readings)
    assert_array_equal(output(tare, context), instant.readings)
    fix(tare, context, instant, instant.readings + 1.0)
    assert_array_equal(output(tare, context), instant.readings + 1.0)
    context.SetDiscreteState(np.append(BIAS, 3.0))
    assert_array_equal(output(tare, context), instant.readings + 1.0 - BIAS)
    fix(tare, context, instant._replace(q=instant.q + 1.0, imu=instant.imu + 1.0), instant.readings + 1.0)
    assert_array_equal(output(tare, context), instant.readings + 1.0 - BIAS)


def test_contexts_are_independent(moving):
    model, instant = moving
    tare = WrenchTare(model, 0.0, 0.2)
    one, two = (fixed(tare, instant, instant.readings + factor * BIAS) for factor in (1.0, -2.0))
    simulators = [Simulator(tare, context) for context in (one, two)]
    for until in (0.1, 0.2, 0.3):  # in turns
        for simulator in simulators:
            simulator.AdvanceTo(until)
    for context, factor in ((one, 1.0), (two, -2.0)):
        found = context.get_discrete_state_vector().value()[:12]
        assert_allclose(found, factor * BIAS, atol=1e-9 * np.abs(instant.readings).max())
    copy = one.Clone()
    copy.SetDiscreteState(np.zeros(13))
    assert_allclose(one.get_discrete_state_vector().value()[:12], BIAS, atol=1e-6)


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ((-0.1, 0.2), "expected 0 <= begin < end"),
        ((0.2, 0.2), "expected 0 <= begin < end"),
        ((0.2, np.inf), "expected 0 <= begin < end"),
        ((np.nan, 1.0), "expected 0 <= begin < end"),
        ((0.1, 0.2, 0.0), "a positive period"),
        ((0.101, 0.105), "at least one period of 0.01 s"),
    ],
)
def test_times_that_are_not_possible_are_refused(moving, times, message):
    with pytest.raises(ParamsError, match=message):
        WrenchTare(moving[0], *times)


def test_a_robot_without_sensors_is_refused(tmp_path):
    robot = random_robot(tmp_path, np.random.default_rng(0), fixed_base=True, sensors=0)
    with pytest.raises(ParamsError, match="tree has no force/torque sensor"):
        WrenchTare(TorqueModel(robot), 0.1, 0.2)
