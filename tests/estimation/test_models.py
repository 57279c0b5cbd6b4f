"""The committed robots: perfect sensors give the truth, whoever wrote their URDF."""

import logging
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from optional import skip_without_robots

import drake_tc.models
from drake_tc.estimation.plant import skew
from drake_tc.estimation.torque_model import MeasuredMotion, TorqueModel
from drake_tc.robot.robot import load_robot

from .machines import Push, Truth

MODELS = Path(next(iter(drake_tc.models.__path__)))
FILES = sorted(p for p in MODELS.glob("*/*.yaml") if "\nurdf:" in p.read_text(encoding="utf-8"))


@pytest.mark.parametrize("file", FILES, ids=[file.stem for file in FILES])
def test_torques_and_wrenches_to_round_off(file, caplog):
    caplog.set_level(logging.ERROR)
    if "package://example-robot-data" in file.read_text(encoding="utf-8"):
        skip_without_robots()
    robot = load_robot(file)
    rng = np.random.default_rng(0)
    pushes = [Push(mount.contact, rng.uniform(-50.0, 50.0, 6)) for mount in robot.force_torque]
    instant = Truth(robot).instant(rng, pushes)
    model = TorqueModel(robot)
    result = model.estimate(MeasuredMotion(*instant[:5]), instant.readings)
    # light fingers accelerate at up to 1e7 rad/s^2 under these torques; round-off is relative to that
    close = {"rtol": 0.0, "atol": 1e-14 * max(1e3, float(np.abs(instant.vdot).max()))}
    assert_allclose(result.torque, instant.torque, **close)
    assert_allclose(result.contact_wrench, np.concatenate([np.zeros(0), *(push.wrench for push in pushes)]), **close)
    assert_allclose(result.unknown_wrench, instant.base_reaction, **close)


def test_skew_matrices_are_cross_products_of_one_vector_or_many():
    p, x = np.random.default_rng(0).normal(size=(2, 4, 5, 3))
    assert_allclose(np.einsum("...ij,...j->...i", skew(p), x), np.cross(p, x), atol=1e-15)
    assert_allclose(skew(p[0, 0]) @ x[0, 0], np.cross(p[0, 0], x[0, 0]), atol=1e-15)
