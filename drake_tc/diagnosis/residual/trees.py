"""Functions of signals without a form of their own: gradient-boosted trees, predicted out of fold."""

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from drake_tc.types import FloatArray, IntArray

if TYPE_CHECKING:
    from sklearn.ensemble import HistGradientBoostingRegressor


def cross_predict(
    features: Sequence[FloatArray],
    y: FloatArray,
    group: IntArray,
    seed: int,
    executor: Executor | None = None,
    folds: int = 4,
) -> list[FloatArray]:
    """Out-of-fold predictions (N,) of gradient-boosted trees from each set of features (N, k).

    Args:
        features: One set for each of the predictions.
        y: (N,) what is predicted.
        group: (N,) samples of one group share a fold.
        seed: Of the folds and of the trees.
        executor: Fits the trees beside each other; None fits them here.
        folds: Number of folds.
    """
    fold = np.random.default_rng(seed).permutation(int(group.max()) + 1)[group] % folds
    held = [rows for f in range(folds) if (rows := fold == f).any() and (~rows).sum() > 100]
    jobs = [(x[~rows], y[~rows], x[rows], seed) for x in features for rows in held]
    made: Iterator[FloatArray] = map(_predicted, jobs) if executor is None else executor.map(_predicted, jobs)
    out = [np.zeros_like(y) for _ in features]
    for each in out:
        for rows in held:
            each[rows] = next(made)
    return out


def _predicted(job: tuple[FloatArray, FloatArray, FloatArray, int]) -> FloatArray:
    """Trees of features (N, k) and values (N,), at other features (M, k): (M,)."""
    x, y, there, seed = job
    model = trees(seed, max_leaf_nodes=24, l2_regularization=1.0)
    with threadpool_limits(1):
        return np.asarray(model.fit(x, y).predict(there))


def trees(seed: int, **more: float) -> "HistGradientBoostingRegressor":
    """The regressor; `more` of its options."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    return HistGradientBoostingRegressor(
        max_iter=80, learning_rate=0.12, min_samples_leaf=40, random_state=seed, **more
    )


def share_explained(y: FloatArray, predicted: FloatArray) -> float:
    """1 - sum (y - yhat)^2 / sum (y - mean)^2, at least 0."""
    return max(0.0, 1.0 - float(np.sum((y - predicted) ** 2) / max(np.sum((y - y.mean()) ** 2), 1e-300)))
