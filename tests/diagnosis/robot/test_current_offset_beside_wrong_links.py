"""Offsets of currents within tolerance, where the robot file's links are wrong: neither presses the other away."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from fitted_arm import GAIN, JOINTS, URDF, record, rig_file
from numpy.testing import assert_allclose
from robot_files import write_robot

from drake_tc.diagnosis.data.sensor_prior import SensorPrior
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import FOLDS
from drake_tc.diagnosis.problem.shared.rows import JointRows, fold_grams, prior_weighed
from drake_tc.diagnosis.problem.shared.stacked import fit_stacked
from drake_tc.diagnosis.run import close_loop
from drake_tc.robot.robot import load_robot

OFFSET = np.array([0.4, -0.5, 0.25])
"""Of each current, as a torque [N m]."""
TOLERANCE = 0.4
"""As a torque [N m]."""
LIGHTER = {
    'mass value="4"': 'mass value="3"',
    'mass value="2"': 'mass value="1.4"',
    'mass value="1.2"': 'mass value="0.8"',
}


@pytest.fixture(scope="module", params=[0, 1])
def arms(request, tmp_path_factory):
    """Parameters of the true links, and the result with a robot file whose links are a third too light."""
    true = tmp_path_factory.mktemp("true")
    loaded = load_robot(write_robot(true, URDF, JOINTS))
    folder = tmp_path_factory.mktemp("arm")
    light = URDF
    for mass, less in LIGHTER.items():
        assert mass in light
        light = light.replace(mass, less)
    write_robot(folder, light, JOINTS)
    logs = [record(folder, loaded, f"run_{k}", 10 * request.param + k) for k in range(3)]
    for path in logs:
        columns = dict(np.load(path))
        for i, joint in enumerate(JOINTS):
            columns[f"{joint}/current"] = columns[f"{joint}/current"] + GAIN[i] * OFFSET[i]
        np.savez(path, **columns)
    sensors = {j: {"current": {"bias": float(g * TOLERANCE)}} for j, g in zip(JOINTS, GAIN, strict=True)}
    options = DiagnosisOptions(assess_residual=False)
    result = close_loop(rig_file(folder, sensors=sensors), logs[:2], logs[2:], options)
    right = close_loop(rig_file(true), logs[:2], logs[2:], replace(options, effects=()))
    return {f"{p.link}/{p.name}": p.declared for p in right.links.parameters}, result


def test_the_intervals_of_base_parameters_hold_the_truth(arms):
    true, result = arms
    outside = []
    for base in result.links.base:
        value = sum(factor * true[name] for name, factor in base.weights.items())
        low, high = base.estimate.ci95
        if not low <= value <= high:
            outside.append((base.name, value, base.estimate))
    assert len(outside) <= 1, outside  # of about ten, one in twenty by chance


def test_the_moment_of_gravity_is_not_off_by_the_offset(arms):
    """The lift's offset alone would move it by 0.5/9.81 = 0.05 kg m."""
    true, result = arms
    lift = next(b for b in result.links.base if b.weights.get("boom/mx") and len(b.weights) > 1)
    assert_allclose(lift.estimate.value, sum(f * true[name] for name, f in lift.weights.items()), atol=0.1 * 0.5 / 9.81)


@dataclass(frozen=True)
class Rows:
    """What the fit of all joints asks of its samples."""

    run: np.ndarray
    sensor_prior: SensorPrior


def test_the_estimate_with_the_weighed_prior_is_the_textbook_posterior():
    """One joint with an own column that has the prior N(0, t^2), a shared column, and independent rows."""
    rng = np.random.default_rng(5)
    n, t = 4000, 0.3
    own, shared = np.ones((n, 1)), 1.0 + 0.05 * rng.standard_normal((n, 1))
    target = own @ [0.2] + shared @ [1.5] + 0.8 * rng.standard_normal(n)
    block = (np.arange(n) // 50).astype(np.int64)
    first = SensorPrior(variance=900.0, share=0.02)  # of a fit that left the shared column in its residual
    precision = np.array([first.weight / t**2])
    samples = Rows(np.zeros(n, dtype=np.int64), first)
    grams = fold_grams(own, shared, target, block, precision)
    rows = JointRows("j", samples, own, shared, target, block, grams, held=1.0, precision=precision)
    sigma, share = 0.8, 1.0
    weighed = prior_weighed(rows, sigma, share)
    assert weighed.samples.sensor_prior == SensorPrior(sigma**2, share)
    assert_allclose(weighed.precision, sigma**2 / t**2, rtol=1e-12)
    both = np.hstack([own, shared])
    gram = both.T @ both / sigma**2 + np.diag([1.0 / t**2, 0.0])
    expected = np.linalg.solve(gram, both.T @ target / sigma**2)
    found = fit_stacked([weighed], np.array([0]), effective=np.ones(1), sigma=np.array([sigma]))
    assert_allclose([found.beta[0][0], found.delta[0]], expected, rtol=2e-2)  # sigma is that of the residual
    assert weighed.grams.shape == (FOLDS, 3, 3)
    assert prior_weighed(replace(rows, precision=None), sigma, share).precision is None
