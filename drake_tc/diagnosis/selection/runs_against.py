"""Which run speaks against an effect: its error with the effect against its error without, in resampled blocks.

The conditions are those of `selection.confirmation`.
"""

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.data.sliding import LEAST_ROWS
from drake_tc.diagnosis.root_mean_square import rms
from drake_tc.diagnosis.selection.withdrawal import LargerOnHeldOut, UncertainOnHeldOut
from drake_tc.diagnosis.thresholds import HELDOUT_ACTS, HELDOUT_CERTAIN, RUN_ACTS, RUN_CERTAIN
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.types import FloatArray, IntArray

RESAMPLES = 400
FEWEST_STRETCHES = 4
"""Stretches of blocks that a run is cut into at least when it is resampled."""
FEWEST_BLOCKS = 24
"""Blocks that are resampled at least: half a second is most of what a short run has, so its blocks are cut smaller."""


def heldout_against(
    samples: Samples, without: FloatArray, with_it: FloatArray, floor: float
) -> LargerOnHeldOut | UncertainOnHeldOut | None:
    """What the held-out runs say against an effect; None where they say nothing.

    Args:
        samples: Held-out rows.
        without: (N,) residual without the effect [effort].
        with_it: (N,) with it.
        floor: Noise floor [effort].
    """
    for r in np.unique(samples.run):
        rows = samples.run == r
        run, lost = samples.runs[int(r)], rms(with_it[rows]) / max(rms(without[rows]), 1e-300) - 1.0
        if not _says_something(without[rows], with_it[rows], floor):
            continue
        if lost > 0.0:
            return LargerOnHeldOut(run, lost)
        better = _worse_share(samples.block[rows], with_it[rows], without[rows])
        if better < HELDOUT_CERTAIN:
            return UncertainOnHeldOut(run, abs(lost), better, HELDOUT_CERTAIN)
    gain, acts = 1.0 - rms(with_it) / max(rms(without), 1e-300), rms(with_it - without)
    if gain <= 0.0 and acts >= HELDOUT_ACTS * floor:
        return LargerOnHeldOut(None, abs(gain))
    better = _worse_share(samples.block, with_it, without) if acts >= RUN_ACTS * floor else 1.0
    return UncertainOnHeldOut(None, gain, better, HELDOUT_CERTAIN) if better < HELDOUT_CERTAIN else None


def _says_something(without: FloatArray, with_it: FloatArray, floor: float) -> bool:
    """Whether the rows (N,) of a run are enough for a regression and the effect acts in them."""
    return with_it.size >= LEAST_ROWS and rms(with_it - without) >= RUN_ACTS * floor


def speaks_against(
    samples: Samples, without: FloatArray, with_it: FloatArray, floor: float, certain: float = RUN_CERTAIN
) -> str:
    """Name of the run whose error (N,) is larger with an effect, in at least `certain` of block resamples; or ""."""
    worst, name = 0.0, ""
    for r in np.unique(samples.run):
        rows = samples.run == r
        if not _says_something(without[rows], with_it[rows], floor):
            continue
        loss = rms(with_it[rows]) / max(rms(without[rows]), 1e-300) - 1.0
        if loss > worst and _worse_share(samples.block[rows], without[rows], with_it[rows]) >= certain:
            worst, name = loss, samples.runs[int(r)]
    return name


def _worse_share(block: IntArray, without: FloatArray, with_it: FloatArray) -> float:
    """Share of resamples of a run's blocks, half a second at most, in which the effect makes the squared error larger.

    Neighbouring blocks are drawn together, 2 tau - 1 of them where their differences have the correlation time tau: a
    model that is wrong in one way for seconds errs once, not once in each block (circular block bootstrap: Politis and
    Romano, 1992; stretches of tau alone would show half of an AR(1) process's variance).
    """
    number = cut_blocks(np.unique(block, return_inverse=True)[1])
    more = np.bincount(number, with_it**2 - without**2)
    correlated = round(2.0 * correlation_time(more - more.mean())) - 1
    together = min(correlated, max(more.size // FEWEST_STRETCHES, 1))
    starts = np.random.default_rng(0).integers(0, more.size, (RESAMPLES, -(-more.size // together)))
    draws = (starts[..., None] + np.arange(together)) % more.size
    return float(np.mean(more[draws].sum(axis=(1, 2)) > 0.0))


def cut_blocks(block: IntArray) -> IntArray:
    """Blocks (N,) cut into equal parts until there are at least `FEWEST_BLOCKS`, or one for each row."""
    sizes = np.bincount(block)
    parts = -(-FEWEST_BLOCKS // sizes.size)
    if parts == 1:
        return block
    within = np.arange(block.size) - (np.cumsum(sizes) - sizes)[block]
    return np.asarray(np.unique(block * parts + within * parts // sizes[block], return_inverse=True)[1])
