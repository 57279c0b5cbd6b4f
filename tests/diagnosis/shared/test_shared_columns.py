"""Columns of the shared causes against Drake's inverse dynamics of robots and sensors that are wrong by a little."""

import numpy as np
import pytest
from fitted_arm import JOINTS, URDF
from numpy.testing import assert_allclose
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff
from pydrake.multibody.tree import MultibodyForces_
from robot_files import write_robot as write_arm
from scipy.spatial.transform import Rotation

from drake_tc.diagnosis.shared import cause_columns as cc
from drake_tc.diagnosis.shared.body_motion import body_motion, joint_is_prismatic, structure_of
from drake_tc.estimation.plant import skew
from drake_tc.estimation.torque_model import MeasuredMotion, TorqueModel
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot

from ..small_robot import LINKS, write_robot

ROWS = 12


@pytest.fixture(scope="module")
def rows():
    """Twelve random instants: joints, IMU, gyro's derivative, wrench."""
    rng = np.random.default_rng(4)
    return [
        (
            rng.uniform(-0.8, 0.8, 3),
            rng.uniform(-2.0, 2.0, 3),
            rng.uniform(-8.0, 8.0, 3),
            np.concatenate([rng.uniform(-1.0, 1.0, 3), rng.uniform(-3.0, 3.0, 3) + np.array([0.0, 0.0, 9.81])]),
            rng.uniform(-4.0, 4.0, 3),
            rng.uniform(-20.0, 20.0, 6),
        )
        for _ in range(ROWS)
    ]


def torque(path, rows):
    """(T, n) by Drake's inverse dynamics, through the torque estimator."""
    model = TorqueModel(load_robot(path))
    return np.array([model.estimate(MeasuredMotion(*row[:5]), row[5]).torque for row in rows])


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return write_robot(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def parts(arm, rows):
    model = TorqueModel(load_robot(arm))
    structure = structure_of(model)
    return model, structure, body_motion(model, structure, rows), joint_is_prismatic(model)


def test_only_links_between_base_and_sensor_count(parts):
    _, structure, _, slides = parts
    assert [link.name for link in structure.links] == ["upper", "slide", "lower"]
    assert_allclose([link.loads for link in structure.links], [[1, 0, 0], [1, 1, 0], [1, 1, 1]])
    assert list(slides) == [False, True, False]
    assert structure.above_sensor.all()


def test_motion_and_readings_make_the_estimate(arm, rows, parts):
    _, structure, motion, slides = parts
    wrench = np.array([row[5] for row in rows])
    reading = cc.reading_columns(motion, structure, 0, slides)
    mine = cc.motion_torque(motion, structure, slides) + np.einsum("tjp,tp->tj", reading, wrench)
    assert_allclose(mine, torque(arm, rows), rtol=0, atol=1e-11)  # two exact computations of N m


@pytest.mark.parametrize("index", range(3))
def test_mass_column_is_the_heavier_robot_less_the_lighter(tmp_path, rows, parts, index):
    _, structure, motion, slides = parts
    link = structure.links[index]
    heavier = torque(write_robot(tmp_path, masses={link.name: link.mass + 0.3}), rows)
    lighter = torque(write_robot(tmp_path, masses={link.name: link.mass - 0.3}), rows)
    column = cc.mass_column(motion, link, index, slides)[:, :, 0]
    assert np.abs(column).max() > 1.0
    assert_allclose(column, (heavier - lighter) / 0.6, rtol=0, atol=1e-9)  # linear: no truncation


@pytest.mark.parametrize("index", range(3))
def test_com_columns_are_the_shifted_robots_difference(tmp_path, rows, parts, index):
    _, structure, motion, slides = parts
    link = structure.links[index]
    columns = cc.com_columns(motion, link, index, slides)
    for axis in range(3):
        step = 0.01 * np.eye(3)[axis]
        moved = [
            torque(write_robot(tmp_path, coms={link.name: np.array(LINKS[link.name][1]) + s * step}), rows)
            for s in (1, -1)
        ]
        # quadratic in the shift: central differences are exact
        assert_allclose(columns[:, :, axis], (moved[0] - moved[1]) / 0.02, rtol=0, atol=1e-8)


def test_sensor_columns_are_the_estimate_of_wrong_readings(arm, rows, parts):
    model, structure, motion, slides = parts
    right = torque(arm, rows)
    reading = cc.reading_columns(motion, structure, 0, slides)
    for axis in range(6):
        wrong = [(*row[:5], row[5] + np.eye(6)[axis]) for row in rows]
        assert_allclose(reading[:, :, axis], torque(arm, wrong) - right, rtol=0, atol=1e-11)
    scaled = [(*row[:5], row[5] * [1.1, 1.1, 1.1, 1.0, 1.0, 1.0]) for row in rows]
    wrench = np.array([row[5] for row in scaled])
    delta = 0.1 / 1.1
    column = cc.gain_columns(reading, wrench)[:, :, 0]
    assert_allclose(delta * column, torque(arm, scaled) - right, rtol=0, atol=1e-11)
    turned = cc.alignment_columns(reading, np.array([row[5] for row in rows]))
    for axis in range(3):
        angle = 1e-4 * np.eye(3)[axis]
        wrong = [(*r[:5], r[5] + np.concatenate([np.cross(angle, r[5][:3]), np.cross(angle, r[5][3:])])) for r in rows]
        # linear in the readings: exact but for rounding of N m over 1e-4
        assert_allclose(turned[:, :, axis], (torque(arm, wrong) - right) / 1e-4, rtol=0, atol=1e-6)
    accel = cc.accelerometer_columns(motion, structure, slides)
    for axis in range(3):
        shift = np.concatenate([np.zeros(3), np.eye(3)[axis]])
        wrong = [(*row[:3], row[3] + shift, *row[4:]) for row in rows]
        assert_allclose(accel[:, :, axis], torque(arm, wrong) - right, rtol=0, atol=1e-10)

    def at(offset):
        return body_motion(
            model, structure, [(*r[:3], r[3] + np.concatenate([offset, np.zeros(3)]), *r[4:]) for r in rows]
        )

    gyro = cc.gyro_columns(at, structure, slides)
    for axis in range(3):
        shift = 0.01 * np.concatenate([np.eye(3)[axis], np.zeros(3)])
        ahead, behind = (torque(arm, [(*r[:3], r[3] + s * shift, *r[4:]) for r in rows]) for s in (1, -1))
        # the columns are forward differences over 1e-4 rad/s of a quadratic: off by its curvature times that
        assert_allclose(gyro[:, :, axis], (ahead - behind) / 0.02, rtol=0, atol=1e-3)


def test_a_turned_imu_against_finite_rotations(arm, rows, parts):
    """Gyro, accelerometer and the gyro's derivative turned by +-0.01 rad, not to first order as the columns are."""
    model, structure, _, slides = parts

    def turned_by(turn):
        return [(*r[:3], np.concatenate([turn @ r[3][:3], turn @ r[3][3:]]), turn @ r[4], r[5]) for r in rows]

    def at(angle):
        return body_motion(model, structure, turned_by(np.eye(3) + skew(angle)))

    columns = cc.gyro_columns(at, structure, slides)
    for axis in range(3):
        turns = (Rotation.from_rotvec(sign * 0.01 * np.eye(3)[axis]).as_matrix() for sign in (1, -1))
        ahead, behind = (torque(arm, turned_by(turn)) for turn in turns)
        # forward differences over 1e-4 rad, and the third order of 0.01 rad: some 1e-4 of columns of up to 1e2 N m
        assert_allclose(columns[:, :, axis], (ahead - behind) / 0.02, rtol=0, atol=1e-4 * np.abs(columns).max())


def test_encoder_columns_are_the_derivatives_of_the_loads(tmp_path, rows):
    """Against automatic differentiation of Drake's inverse dynamics, of an arm with a fixed base."""
    robot = load_robot(write_arm(tmp_path, URDF, JOINTS))
    plant = make_plant(robot, 0.0).ToAutoDiffXd()
    context = plant.CreateDefaultContext()
    columns = cc.encoder_columns(
        TorqueModel(robot, base="fixed"), [(*row[:5], row[5][:0]) for row in rows], np.zeros(3)
    )
    for (q, v, vdot, *_), column in zip(rows, columns, strict=True):
        plant.SetPositions(context, InitializeAutoDiff(q)[:, 0])
        plant.SetVelocities(context, v)
        forces = MultibodyForces_[AutoDiffXd](plant)
        plant.CalcForceElementsContribution(context, forces)
        torque = plant.CalcInverseDynamics(context, vdot, forces)
        # central differences over 1e-4 rad of torques of some 10 N m
        assert_allclose(column, ExtractGradient(torque), rtol=0, atol=1e-6)


def test_encoder_columns_at_a_known_offset_are_exact(tmp_path, rows):
    """The loads at the recorded positions less those at the true ones, for an offset of 8 degrees."""
    model = TorqueModel(load_robot(write_arm(tmp_path, URDF, JOINTS)), base="fixed")
    bare, offsets = [(*row[:5], row[5][:0]) for row in rows], np.array([0.0, 0.14, 0.0])
    columns = cc.encoder_columns(model, bare, offsets)
    right = [(row[0] - offsets, *row[1:]) for row in bare]
    loads = [
        np.array([model.estimate(MeasuredMotion(*row[:5]), row[5]).torque for row in each]) for each in (bare, right)
    ]
    assert_allclose(columns[:, :, 1] * 0.14, loads[0] - loads[1], rtol=0, atol=1e-10)  # torques of some 10 N m
