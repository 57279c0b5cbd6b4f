"""A real humanoid that walks, against motion capture; skipped where the public data are not there."""

import os
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.bench import real_icub
from drake_tc.errors import LogError

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def data() -> Path:
    named = os.environ.get("DRAKE_TC_DATA")
    root = Path(named) if named else Path(__file__).resolve().parents[4] / "shared" / "data"
    if not (root / real_icub.DATA_SET).is_dir():
        pytest.skip(f"no {real_icub.DATA_SET}: neither ../shared/data beside the project nor DRAKE_TC_DATA")
    return root


@pytest.fixture(scope="module")
def walk(data):
    return real_icub.evaluate(data, real_icub.LONG, lambda text, share: None)


def test_the_published_leg_odometry_is_beaten_by_two_fifths(walk):
    ours, _ = walk.errors
    for value, axis in zip(ours.position, "xyz", strict=True):
        assert value <= 0.6 * real_icub.PUBLISHED[axis], axis
    assert np.degrees(ours.angle[2]) <= 0.6 * real_icub.PUBLISHED["yaw"]


def test_our_own_chain_from_the_foot_is_about_the_published_one(walk):
    """The baseline is no straw man: in x, y and yaw it is as good as the data set's own."""
    _, base = walk.errors
    for value, axis in zip(base.position[:2], "xy", strict=True):
        assert_allclose(value, real_icub.PUBLISHED[axis], rtol=0.25)
    assert_allclose(np.degrees(base.angle[2]), real_icub.PUBLISHED["yaw"], rtol=0.25)


def test_the_short_log_where_the_imu_gives_no_angles(data):
    ours, _ = real_icub.evaluate(data, real_icub.SHORT, lambda text, share: None).errors
    assert np.degrees(ours.angle).max() < 1.5
    assert np.linalg.norm(ours.position) < 0.04


def test_a_folder_without_the_set_is_refused(tmp_path):
    with pytest.raises(LogError):
        real_icub.rows(tmp_path)
