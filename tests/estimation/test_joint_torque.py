"""The estimator as a system: ports equal the kernel, everything depends on every input, nothing bad comes out."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from drake_tc.estimation.joint_torque import JointTorqueEstimator
from drake_tc.estimation.torque_model import MeasuredMotion, TorqueModel

from .machines import Truth, random_robot

OUTPUTS = ("estimated_torque", "unknown_wrench", "contact_wrench")


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    rng = np.random.default_rng(0)
    robot = random_robot(tmp_path_factory.mktemp("robot"), rng, fixed_base=False, sensors=2)
    return TorqueModel(robot), Truth(robot).instant(rng)


def inputs(instant) -> dict[str, np.ndarray]:
    return {
        "joint_estimate": np.concatenate([instant.q, instant.v, instant.vdot]),
        "imu_estimate": np.concatenate([instant.imu, instant.gyro_dot, np.zeros(3)]),
        "wrench_estimate": instant.readings,
    }


def outputs(system, context) -> dict[str, np.ndarray]:
    return {name: system.GetOutputPort(name).Eval(context).copy() for name in (*OUTPUTS, "fault")}


def fix(system, context, values) -> None:
    for name, value in values.items():
        system.GetInputPort(name).FixValue(context, value)


def test_the_ports_are_the_kernel(rig):
    model, instant = rig
    system = JointTorqueEstimator(model)
    context = system.CreateDefaultContext()
    fix(system, context, inputs(instant))
    seen = outputs(system, context)
    kernel = model.estimate(MeasuredMotion(*instant[:5]), instant.readings)
    for name, value in zip(OUTPUTS, kernel, strict=True):
        assert_array_equal(seen[name], value)
    assert_allclose(seen["estimated_torque"], instant.torque, rtol=1e-8, atol=1e-8)
    assert seen["fault"] == 0.0


@pytest.mark.parametrize("name", ["joint_estimate", "imu_estimate", "wrench_estimate"])
def test_every_input_moves_what_it_should_at_once(rig, name):
    model, instant = rig
    system = JointTorqueEstimator(model)
    assert all(system.HasDirectFeedthrough(i, o) for i in range(3) for o in range(4))
    context = system.CreateDefaultContext()
    values = inputs(instant)
    fix(system, context, values)
    before = outputs(system, context)
    system.GetInputPort(name).FixValue(context, values[name] + 0.1)
    after = outputs(system, context)
    for output in OUTPUTS:
        assert np.abs(after[output] - before[output]).max() > 1e-6
    fix(system, context, values)
    for output, value in outputs(system, context).items():
        assert_array_equal(value, before[output])


def test_two_contexts_and_a_clone_are_independent(rig):
    model, instant = rig
    system = JointTorqueEstimator(model)
    one = system.CreateDefaultContext()
    fix(system, one, inputs(instant))
    first = outputs(system, one)
    two = one.Clone()
    system.GetInputPort("wrench_estimate").FixValue(two, np.zeros(instant.readings.size))
    assert np.abs(outputs(system, two)["estimated_torque"] - first["estimated_torque"]).max() > 1e-3
    system.GetInputPort("imu_estimate").FixValue(one, np.zeros(12))
    system.GetInputPort("imu_estimate").FixValue(one, inputs(instant)["imu_estimate"])
    assert_array_equal(outputs(system, one)["estimated_torque"], first["estimated_torque"])


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data(), name=st.sampled_from(["joint_estimate", "imu_estimate", "wrench_estimate"]))
def test_nothing_that_is_not_finite_comes_out(rig, data, name):
    model, instant = rig
    system = JointTorqueEstimator(model)
    context = system.CreateDefaultContext()
    values = inputs(instant)
    bad = data.draw(st.sampled_from([np.nan, np.inf, -np.inf, 1e300, -1e9]))
    values[name] = values[name].copy()
    values[name][data.draw(st.integers(0, values[name].size - 1))] = bad
    fix(system, context, values)
    seen = outputs(system, context)
    assert seen["fault"] == 1.0
    for output in OUTPUTS:
        assert_array_equal(seen[output], 0.0)


def test_it_recovers_at_once(rig):
    model, instant = rig
    system = JointTorqueEstimator(model)
    context = system.CreateDefaultContext()
    fix(system, context, inputs(instant))
    before = outputs(system, context)
    system.GetInputPort("joint_estimate").FixValue(context, np.full(3 * model.size, np.nan))
    assert outputs(system, context)["fault"] == 1.0
    fix(system, context, inputs(instant))
    for output, value in outputs(system, context).items():
        assert_array_equal(value, before[output])


def test_a_welded_base_works_without_imu_and_without_sensors(tmp_path):
    rng = np.random.default_rng(1)
    robot = random_robot(tmp_path, rng, fixed_base=True, sensors=0)
    instant = Truth(robot).instant(rng)
    system = JointTorqueEstimator(TorqueModel(robot, base="fixed"))
    context = system.CreateDefaultContext()
    system.GetInputPort("joint_estimate").FixValue(context, inputs(instant)["joint_estimate"])
    assert not system.HasInputPort("wrench_estimate") and not system.HasOutputPort("contact_wrench")
    seen = system.GetOutputPort("estimated_torque").Eval(context)
    assert_allclose(seen, instant.torque, rtol=1e-8, atol=1e-8)


def test_the_port_estimate_holds_all_others(rig):
    model, instant = rig
    system = JointTorqueEstimator(model)
    context = system.CreateDefaultContext()
    for values in (inputs(instant), inputs(instant) | {"wrench_estimate": np.full(instant.readings.size, np.nan)}):
        fix(system, context, values)
        seen, joined = outputs(system, context), system.GetOutputPort("estimate").Eval(context)
        assert sum(part.stop - part.start for part in system.parts.values()) == joined.size
        for name, value in seen.items():
            assert_array_equal(joined[system.parts[name]], value)
