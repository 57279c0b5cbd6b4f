"""Intervals of an arm whose links are fitted, beside drive gains that are declared with a tolerance."""

import numpy as np
import pytest
from fitted_arm import JOINTS, RIG, URDF, record, rig_file
from numpy.testing import assert_allclose
from robot_files import write_robot

from drake_tc.diagnosis.intervals import CRITICAL
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.robot.robot import load_robot

TOLERANCE = 0.05


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Without and with the tolerance."""
    folder = tmp_path_factory.mktemp("arm")
    robot = load_robot(write_robot(folder, URDF, JOINTS))
    paths = [record(folder, robot, f"run_{number}", number) for number in range(2)]
    options = DiagnosisOptions(effects=(), assess_residual=False)
    out = []
    for more in ({}, {"drive_gain_tolerance": TOLERANCE}):
        rig = rig_file(folder, **(RIG | {"load": RIG["load"] | more}))
        out.append(close_loop(rig, paths[:1], paths[1:], options))
    return out


def test_friction_and_links_are_as_uncertain_as_the_gains(results):
    for joint in JOINTS:
        first, second = (each.joints[joint].final_parameters["viscous"]["viscous"] for each in results)
        assert_allclose(second.value, first.value, rtol=1e-9)
        more = np.hypot(first.ci95[1] - first.value, CRITICAL * TOLERANCE * first.value)
        assert_allclose(second.ci95[1] - second.value, more, rtol=1e-6)
    widths = [[entry.estimate.ci95[1] - entry.estimate.ci95[0] for entry in each.links.base] for each in results]
    assert max(np.divide(widths[1], widths[0])) > 1.5
