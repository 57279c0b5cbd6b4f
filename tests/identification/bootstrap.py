"""Moving-block bootstrap of a linear fit: intervals that assume no shape of the autocorrelation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.errors import IdentificationError
from drake_tc.identification.autocorrelation import automatic_bandwidth, critical_value_95, stretches
from drake_tc.identification.regression import checked, column_scale
from drake_tc.types import FloatArray

_CELLS_PER_BLOCK = 8


@dataclass(frozen=True)
class BootstrapFit:
    """Spread of the estimates over resampled logs.

    Attributes:
        names: The p parameters.
        draws: (count, p) estimates, one a resampled log.
        covariance: (p, p) of the draws.
        ci95: (p, 2) percentiles 2.5 and 97.5 of the draws, drawn apart from the estimate by the same factor as a
            t statistic's critical value at this block length (few blocks: their spread is itself uncertain).
        coefficients: (p,) estimate from the whole log.
        block: Samples in a block.
    """

    names: tuple[str, ...]
    draws: FloatArray
    covariance: FloatArray
    ci95: FloatArray
    coefficients: FloatArray
    block: int


def block_bootstrap(
    columns: FloatArray,
    target: FloatArray,
    rng: np.random.Generator,
    *,
    names: Sequence[str] | None = None,
    block: int | None = None,
    count: int = 500,
    lengths: Sequence[int] | None = None,
) -> BootstrapFit:
    """Refit x on `count` logs put together from overlapping blocks drawn with replacement.

    Blocks start on a grid an eighth of a block wide, so that a draw only adds up Gram matrices [A b]ᵀ[A b]
    made once: linear in the samples, whatever the count.

    Args:
        columns: A (T, p), finite.
        target: b (T,), finite.
        rng: Source of the draws.
        names: The p parameters; x0, x1, ... when None.
        block: Samples in a block, longer than the residual remembers; None takes twice the automatic bandwidth.
        count: Resampled logs, at least 40.
        lengths: Lengths of the contiguous stretches; no block straddles two of them.

    Raises:
        IdentificationError: Bad shapes or values, too few draws, or a block longer than every stretch.

    Source: Künsch, Annals of Statistics 17 (1989); the widening follows Kiefer and Vogelsang (2005), since the
    variance over moving blocks of length B is a Bartlett estimate of bandwidth B.
    """
    a, b, labels = checked(columns, target, names)
    if count < 40:
        raise IdentificationError(f"block bootstrap needs at least 40 draws, got {count}")
    scale = column_scale(a, labels)
    rows = a / scale
    estimate: FloatArray = np.asarray(np.linalg.lstsq(rows, b, rcond=None)[0])
    if block is None:
        scores = rows * (b - rows @ estimate)[:, None]
        block = 2 * max(automatic_bandwidth(score, lengths) for score in scores.T)
    grams = _block_grams(np.column_stack([rows, b]), block, lengths)
    blocks = int(np.ceil(b.size / block))
    p = rows.shape[1]
    draws = np.empty((count, p))
    for i in range(count):
        total = grams[rng.integers(0, len(grams), blocks)].sum(axis=0)
        draws[i] = np.linalg.lstsq(total[:p, :p], total[:p, p], rcond=None)[0]
    draws /= scale
    estimate = np.asarray(estimate / scale)
    stretch = critical_value_95(block, b.size) / critical_value_95(0, b.size)
    ci95 = estimate[:, None] + stretch * (np.percentile(draws, [2.5, 97.5], axis=0).T - estimate[:, None])
    return BootstrapFit(labels, draws, np.atleast_2d(np.cov(draws.T)), ci95, estimate, block)


def _block_grams(rows: FloatArray, block: int, lengths: Sequence[int] | None) -> FloatArray:
    """Gram matrices (blocks, p + 1, p + 1) of all blocks on the grid, through sums over its cells."""
    cell = max(1, block // _CELLS_PER_BLOCK)
    cells_in_block = max(1, round(block / cell))
    found = []
    for part in stretches(rows.shape[0], lengths):
        x = rows[part]
        cells = x.shape[0] // cell
        if cells < cells_in_block:
            continue
        x = x[: cells * cell].reshape(cells, cell, -1)
        sums = np.cumsum(np.einsum("kci,kcj->kij", x, x), axis=0)
        sums = np.concatenate([np.zeros_like(sums[:1]), sums])
        found.append(sums[cells_in_block:] - sums[:-cells_in_block])
    if not found:
        raise IdentificationError(f"no stretch of {rows.shape[0]} samples is as long as a block of {block}")
    return np.concatenate(found)
