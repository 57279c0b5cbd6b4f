"""How a run of few half-second blocks confirms an effect."""

from types import SimpleNamespace
from typing import cast

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.selection.runs_against import FEWEST_BLOCKS, cut_blocks, heldout_against


def test_a_short_run_is_resampled_in_smaller_blocks():
    cut = cut_blocks(np.repeat(np.arange(4), [300, 400, 100, 250]))
    assert np.unique(cut).size >= FEWEST_BLOCKS
    assert (np.diff(cut) >= 0).all() and set(np.diff(cut)) <= {0, 1}
    assert {300, 700, 800} <= set(np.flatnonzero(np.diff(cut)) + 1)  # no part lies in two blocks
    many = np.repeat(np.arange(2 * FEWEST_BLOCKS), 5)
    assert (cut_blocks(many) == many).all()


def test_a_clear_gain_on_a_short_heldout_run_is_not_called_chance():
    """Two seconds, four blocks: a gain of 10 % that all of them share must not fail for their small number."""
    rng, rows = np.random.default_rng(5), 1000
    noise, missing = rng.standard_normal(rows), 0.5 * rng.standard_normal(rows)
    run = cast(Samples, SimpleNamespace(run=np.zeros(rows, int), block=np.arange(rows) // 250, runs=("run",)))
    assert heldout_against(run, noise + missing, noise, 1.0) is None
    assert heldout_against(run, noise, noise + missing, 1.0) is not None
