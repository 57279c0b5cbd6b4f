"""A real humanoid that walks, against motion capture; skipped where the public data are not there."""

import os
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import LogError
from tests.benchmarks import real_icub

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def data() -> Path:
    named = os.environ.get("DRAKE_TC_DATA")
    root = Path(named) if named else Path(__file__).resolve().parents[4] / "shared" / "data"
    if not (root / real_icub.DATA_SET).is_dir():
        pytest.skip(f"no {real_icub.DATA_SET}: neither ../shared/data beside the project nor DRAKE_TC_DATA")
    return root


@pytest.fixture(scope="module")
def table(data):
    return {row.name: row for row in real_icub.rows(data)}


@pytest.mark.parametrize("what", real_icub.PUBLISHED)
def test_the_published_leg_odometry_is_beaten_by_two_fifths(table, what):
    assert table[f"{real_icub.LONG}/{what}"].value <= 0.6 * real_icub.PUBLISHED[what]


@pytest.mark.parametrize("what", ["x", "y", "yaw"])
def test_our_own_chain_from_the_foot_is_about_the_published_one(table, what):
    """The baseline is no straw man: in x, y and yaw it is as good as the data set's own."""
    assert_allclose(table[f"{real_icub.LONG}/foot_centre_{what}"].value, real_icub.PUBLISHED[what], rtol=0.25)


def test_the_short_log_where_the_imu_gives_no_angles(table):
    assert max(table[f"{real_icub.SHORT}/{what}"].value for what in ("roll", "pitch", "yaw")) < 1.5  # degrees
    assert np.linalg.norm([table[f"{real_icub.SHORT}/{axis}"].value for axis in "xyz"]) < 0.04


def test_a_folder_without_the_set_is_refused(tmp_path):
    with pytest.raises(LogError):
        real_icub.rows(tmp_path)
