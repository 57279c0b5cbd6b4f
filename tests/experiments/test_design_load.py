"""The load of a joint that is known from its logs is that of the runs in which nobody pushes it."""

import numpy as np
from numpy.testing import assert_allclose

from drake_tc.experiments.design.known import _by_run


def test_pushes_in_one_run_do_not_count():
    """Two runs of one load: the first with slow pushes of 20 N m, the second with white noise of 0.2 N m."""
    rng, time, truth = np.random.default_rng(3), np.arange(0.0, 20.0, 5e-3), np.array([0.9, 22.0, 0.0, 0.5])
    blocks, tau = [], []
    for pushes, hz in ((20.0, 0.11), (0.0, 0.4)):
        q = 0.6 * np.sin(2.0 * np.pi * hz * time)
        basis = np.column_stack([-((2.0 * np.pi * hz) ** 2) * q, np.sin(q), np.cos(q), np.ones_like(q)])
        blocks.append(basis)
        hand = pushes * np.sin(2.0 * np.pi * 0.13 * time + 0.4)
        tau.append(basis @ truth + hand + rng.normal(0.0, 0.2, time.size))
    run = np.repeat([0, 1], time.size)
    found = _by_run(np.concatenate(blocks), np.concatenate(tau), run)
    alone, *_ = np.linalg.lstsq(blocks[1], tau[1], rcond=None)
    assert_allclose(found, alone, atol=0.05 * np.abs(truth).max())
    states = blocks[1]
    assert np.sqrt(np.mean((states @ (found - truth)) ** 2)) < 0.05
