"""The error budget: contributions against closed forms, and the total against their root sum."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.tree import JacobianWrtVariable

from drake_tc.diagrams.papers.delprete2016.error_budget import Filters, Run, error_budget, imperfections
from drake_tc.errors import ParamsError
from drake_tc.estimation.torque_model import MeasuredMotion, TorqueModel
from drake_tc.filtering.savitzky_golay import savgol_weights
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import Robot
from drake_tc.sensing.spec import SensorSpec
from drake_tc.sensing.suite import SensorSuiteSpec

from .machines import random_robot
from .test_torque_model import pendulum

DT = 1e-3
FILTERS = Filters(encoder=41, other=41)
L1, L2, M1, M2 = 0.4, 0.3, 2.0, 1.5


@pytest.fixture(scope="module")
def robot(tmp_path_factory) -> Robot:
    folder: Path = tmp_path_factory.mktemp("pendulum")
    return pendulum(folder, L1, L2, M1, M2)


def run_of(model: TorqueModel, speed: float) -> Run:
    """Sines, with torques by the estimator itself at the exact derivatives: it is proven elsewhere."""
    w = 2.0 * np.pi * speed * np.array([1.0, 1.7])
    time = DT * np.arange(1500)[:, None]
    size = np.array([0.3, 0.4])
    q, v, a = size * np.sin(w * time), size * w * np.cos(w * time), -size * w**2 * np.sin(w * time)
    nothing = np.zeros(6)
    torque = [
        model.estimate(MeasuredMotion(*x, nothing, nothing[:3]), nothing[:0]).torque for x in zip(q, v, a, strict=True)
    ]
    return Run(q, np.zeros((1500, 6)), np.zeros((1500, 0)), np.array(torque), DT)


def test_perfect_sensors_and_slow_motion_leave_nothing_but_the_filter(robot):
    model = TorqueModel(robot, base="fixed")
    budget = error_budget(model, run_of(model, 0.05), SensorSuiteSpec.perfect(), FILTERS, mass_error=0.0)
    assert set(budget.contributions) == {"filter smoothing", "filter lag"}
    assert np.all(budget.contributions["filter smoothing"] < 1e-3)


def test_lag_is_the_torques_change_over_the_filters_delay(robot):
    model = TorqueModel(robot, base="fixed")
    run = run_of(model, 0.3)
    budget = error_budget(model, run, SensorSuiteSpec.perfect(), FILTERS, mass_error=0.0)
    delay = (41 - 1) // 2
    change = run.torque[41:-41] - run.torque[41 - delay : -41 - delay]
    assert_allclose(budget.contributions["filter lag"], np.sqrt(np.mean(change**2, axis=0)), rtol=0.02)


def test_encoder_noise_comes_through_the_second_derivative(robot):
    """At rest the error is M times the derivative filter's noise, gravity's part aside: sigma |w_2| per joint."""
    model = TorqueModel(robot, base="fixed")
    still = run_of(model, 1e-6)
    sigma = 1e-4
    suite = replace(SensorSuiteSpec.perfect(), encoder=SensorSpec(noise=sigma))
    budget = error_budget(model, still, suite, FILTERS, mass_error=0.0, stride=1)
    inner = M2 * L1 * L2
    mass = np.array(
        [[M1 * L1**2 + M2 * (L1**2 + L2**2) + 2 * inner, M2 * L2**2 + inner], [M2 * L2**2 + inner, M2 * L2**2]]
    )
    gain = np.linalg.norm(savgol_weights(41, 2, 20, 2, DT))
    expected = sigma * gain * np.sqrt(np.sum(mass**2, axis=1))
    # 1400 samples of noise correlated over 41: some 100 independent ones, 7 % of an RMS each way
    assert_allclose(budget.contributions["encoder noise"], expected, rtol=0.2)


def test_encoder_bias_is_gravitys_slope_at_rest(robot):
    model = TorqueModel(robot, base="fixed")
    bias = 1e-3
    suite = replace(SensorSuiteSpec.perfect(), encoder=SensorSpec(bias=bias))
    budget = error_budget(model, run_of(model, 1e-6), suite, FILTERS, mass_error=0.0)
    g = 9.81
    expected = bias * np.array([(M1 + M2) * g * L1 + 2 * M2 * g * L2, 2 * M2 * g * L2])
    assert_allclose(budget.contributions["encoder bias"], expected, rtol=1e-3)


def test_independent_contributions_add_up_as_squares(robot):
    model = TorqueModel(robot, base="fixed")
    suite = replace(SensorSuiteSpec.perfect(), encoder=SensorSpec(noise=1e-4, resolution=1e-4))
    budget = error_budget(model, run_of(model, 0.02), suite, FILTERS, mass_error=0.02)
    assert set(budget.contributions) == {
        "filter smoothing",
        "filter lag",
        "encoder noise",
        "encoder quantisation",
        "link masses",
    }
    assert_allclose(budget.total, budget.root_sum, rtol=0.3)
    ends = ["root of the sum of squares", "total", "total without lag"]
    assert [name for name, _ in budget.rows()][-3:] == ends
    assert np.all(budget.total_without_lag < budget.total)


def test_a_force_bias_at_rest_is_taken_for_a_push_at_the_sensor(tmp_path):
    """Its torques are those of a force on the contact body through the sensor's origin, by Drake's Jacobian."""
    tree = random_robot(tmp_path, np.random.default_rng(2), fixed_base=True, sensors=1)
    model = TorqueModel(tree, base="fixed")
    plant, (mount,) = make_plant(tree, 0.0), tree.force_torque
    context = plant.CreateDefaultContext()
    zero = np.zeros((3, model.size))
    still = model.estimate(MeasuredMotion(*zero, np.zeros(6), np.zeros(3)), np.zeros(6)).torque
    samples = 200
    nothing = np.zeros((samples, 6))
    run = Run(np.zeros((samples, model.size)), nothing, nothing, np.tile(still, (samples, 1)), DT)
    bias = (3.0, -2.0, 1.0)
    suite = replace(SensorSuiteSpec.perfect(), force=SensorSpec(bias=bias))
    budget = error_budget(model, run, suite, FILTERS, mass_error=0.0)
    child = plant.GetJointByName(mount.joint).child_body().EvalPoseInWorld(context)
    X_WS = child @ mount.pose.transform
    touched, world = plant.GetBodyByName(mount.contact.link), plant.world_frame()
    at = touched.EvalPoseInWorld(context).inverse() @ X_WS.translation()
    jacobian = plant.CalcJacobianTranslationalVelocity(
        context, JacobianWrtVariable.kV, touched.body_frame(), at[:, None], world, world
    )
    pushed = jacobian.T @ X_WS.rotation().matrix() @ bias
    index = [plant.GetJointByName(name).velocity_start() for name in tree.joints]
    assert np.abs(pushed).max() > 0.1
    assert_allclose(budget.contributions["F/T force bias"], np.abs(pushed[index]), atol=1e-9)


def test_each_imperfection_stands_alone():
    suite = SensorSuiteSpec.realistic()
    found = imperfections(suite)
    assert {
        "encoder noise",
        "encoder quantisation",
        "gyro bias",
        "accel noise",
        "F/T force bias",
        "F/T torque noise",
    } <= set(found)
    assert found["gyro bias"].gyro == SensorSpec(bias=suite.gyro.bias)
    assert found["gyro bias"].encoder == SensorSpec()
    assert imperfections(SensorSuiteSpec.perfect()) == {}


def test_refusals(robot):
    model = TorqueModel(robot, base="fixed")
    run = run_of(model, 0.1)
    with pytest.raises(ParamsError, match=r"torque: expected shape \(1500, 2\)"):
        error_budget(model, replace(run, torque=run.torque[:, :1]), SensorSuiteSpec.perfect())
    short = Run(run.position[:80], run.imu[:80], run.wrench[:80], run.torque[:80], DT)
    with pytest.raises(ParamsError, match="more than 160 samples"):
        error_budget(model, short, SensorSuiteSpec.perfect())
