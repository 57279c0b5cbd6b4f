"""A designed motion as a Drake trajectory is read back by Drake, and moves as the CSV says."""

import numpy as np
from numpy.testing import assert_allclose
from pydrake.common.yaml import yaml_load_typed
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.experiments.design.output import drake_trajectory


def test_drake_reads_the_trajectory_back_with_its_derivatives(tmp_path):
    time = np.arange(1234) / 500.0
    omega, motions = 2.0 * np.pi * 4.0, {}
    for name, size in (("hip", 0.04), ("knee", -0.02)):
        phase = omega * time
        motions[name] = size * np.stack([np.sin(phase), omega * np.cos(phase), -(omega**2) * np.sin(phase), 0 * phase])
    path = tmp_path / "trajectory.drake.yaml"
    path.write_text(drake_trajectory(time, motions), encoding="utf-8")
    found = yaml_load_typed(schema=PiecewisePolynomial, filename=str(path))
    assert found.rows() == 2 and found.start_time() == 0.0
    assert_allclose(found.end_time(), time[-1])
    for order in range(3):
        read = np.stack([found.EvalDerivative(t, order).ravel() for t in time], axis=-1)
        expected = np.stack([motion[order] for motion in motions.values()])
        # Hermite interpolation of degree 5 over 20 ms at 4 Hz: (w h)^6/46080 of the amplitude, more for derivatives
        assert_allclose(read, expected, atol=(3e-7, 2e-5, 1e-3)[order] * np.abs(expected).max())
