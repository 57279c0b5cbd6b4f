"""End-effector inertia from static postures: exact without noise, honest intervals with it, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from drake_tc.errors import IdentificationError
from drake_tc.estimation.end_effector import identify_end_effector, sensor_gravity

from .machines import Truth, random_pose, random_robot

MASS, COM = 1.4, np.array([0.03, -0.02, 0.06])
FORCE_BIAS, TORQUE_BIAS = np.array([1.0, -2.0, 0.5]), np.array([0.1, 0.05, -0.2])


def postures(rng, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gravity in a sensor that is turned at random, and what it reads."""
    gravity = Rotation.random(count, rng=rng).apply([0.0, 0.0, -9.81])
    force = MASS * gravity
    return gravity, np.hstack([force + FORCE_BIAS, np.cross(COM, force) + TORQUE_BIAS])


def test_exact_without_noise():
    fit = identify_end_effector(*postures(np.random.default_rng(0), 6))
    assert_allclose(fit.mass, MASS, rtol=1e-12)
    assert_allclose(fit.com, COM, rtol=1e-11)
    assert_allclose(fit.force_bias, FORCE_BIAS, rtol=1e-11)
    assert_allclose(fit.torque_bias, TORQUE_BIAS, rtol=1e-11)


def test_the_intervals_cover_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(1)
    covered = []
    for _ in range(400):
        gravity, wrench = postures(rng, 12)
        wrench += np.array([0.3] * 3 + [0.02] * 3) * rng.standard_normal(wrench.shape)
        fit = identify_end_effector(gravity, wrench)
        errors = [fit.mass - MASS, *(fit.com - COM), *(fit.force_bias - FORCE_BIAS), *(fit.torque_bias - TORQUE_BIAS)]
        widths = [fit.mass_ci95, *fit.com_ci95, *fit.force_bias_ci95, *fit.torque_bias_ci95]
        covered.append(np.abs(errors) <= widths)
    # of 400 draws at 95 %, four standard deviations of the binomial are 4.4 %
    assert np.all(np.abs(np.mean(covered, axis=0) - 0.95) < 0.044)


def test_statics_of_drake_give_the_mass_and_centre_of_a_foot(tmp_path):
    """A foot on a welded base that is turned; the sensor's reading and gravity by Drake, the truth by the URDF.

    The one joint that a robot must have swings elsewhere, and moves nothing of it.
    """
    rng = np.random.default_rng(3)
    gravity, wrench = [], []
    while True:
        robot = random_robot(tmp_path, rng, fixed_base=True, links=3, sensors=1)
        if robot.joints == ("j2",) and '"l0"/><child link="l2"' in robot.urdf.read_text():
            break
    for _ in range(6):
        turned = replace(robot, base_pose=random_pose(rng))
        truth = Truth(turned)
        instant = truth.instant(rng)
        (mount,) = turned.force_torque
        context = truth.plant.CreateDefaultContext()
        X_WL = truth.plant.GetBodyByName("l1").EvalPoseInWorld(context)
        R_WS = (X_WL @ mount.pose.transform).rotation().matrix()
        gravity.append(R_WS.T @ truth.plant.gravity_field().gravity_vector())
        wrench.append(instant.readings)
    fit = identify_end_effector(np.array(gravity), np.array(wrench))
    inertia = truth.plant.GetBodyByName("l1").default_spatial_inertia()
    X_SL = mount.pose.transform.inverse()
    assert_allclose(fit.mass, inertia.get_mass(), rtol=1e-10)
    assert_allclose(fit.com, X_SL @ inertia.get_com(), rtol=1e-9, atol=1e-12)
    assert_allclose(np.concatenate([fit.force_bias, fit.torque_bias]), 0.0, atol=1e-10)


REFUSED = [
    (np.tile([0.0, 0.0, -9.81], (8, 1)), np.zeros((8, 6)), "do not tell mass and force bias apart"),
    (np.zeros((2, 3)), np.zeros((2, 6)), "at least 3 static postures"),
    (np.zeros((4, 2)), np.zeros((4, 6)), r"expected gravity \(T, 3\)"),
    (np.full((4, 3), np.nan), np.zeros((4, 6)), "finite"),
]


@pytest.mark.parametrize(("gravity", "wrench", "message"), REFUSED)
def test_refusals(gravity, wrench, message):
    with pytest.raises(IdentificationError, match=message):
        identify_end_effector(gravity, wrench)


def test_turning_about_one_axis_leaves_the_centre_of_mass_unknown_or_known_badly():
    angles = np.linspace(-0.02, 0.02, 9)
    gravity = 9.81 * np.column_stack([np.sin(angles), np.zeros(9), -np.cos(angles)])
    with pytest.raises(IdentificationError, match="turn the sensor further"):
        identify_end_effector(gravity, np.zeros((9, 6)))


def test_gravity_from_an_accelerometer_at_rest():
    rotations = Rotation.random(5, rng=np.random.default_rng(4))
    accel = rotations.inv().apply([0.0, 0.0, 9.6])  # reads up, a little short
    assert_allclose(sensor_gravity(rotations.as_matrix(), accel), np.tile([0.0, 0.0, -9.81], (5, 1)), atol=1e-12)
    with pytest.raises(IdentificationError, match="readings of gravity"):
        sensor_gravity(rotations.as_matrix(), np.zeros((5, 3)))
