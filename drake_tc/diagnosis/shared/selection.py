"""Which causes that no single joint owns are missing: forward selection by the cross-validated error of all joints.

Errors of sensors that have a tolerance are in every fit, with that prior (`stacked`). A candidate among them loses its
prior, and counts only if its estimate lies beyond what tolerance and noise together explain.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.shared.causes import TITLES, Cause
from drake_tc.diagnosis.shared.covariance import covariance
from drake_tc.diagnosis.shared.stacked import JointRows, StackedFit, effective_rows, fit_stacked
from drake_tc.types import FloatArray, IntArray


@dataclass(frozen=True)
class SharedOptions:
    """What counts as a real cause; calibrated on simulated legs that lack nothing (drake_tc/diagnosis/README.md).

    Attributes:
        most: Largest number of causes.
        least_log_evidence: Evidence of all joints that it must leave after its parameters are paid.
        least_gain: Relative drop of the cross-validated RMS that the joint it matters most to must have.
        least_removed: What it must explain there, in noise floors.
        least_of_first: ... and as a share of what the causes before it explain: less is likely their imperfect form.
        second_gain, second_log_evidence: Drop and evidence that at least one more joint must have: else it is one
            joint's own.
        beyond: Standard deviations, of tolerance and estimate together, beyond which a sensor's error is not expected.
        same: Mean logarithm of the error by which causes as good as each other may differ; the smaller one is taken.
    """

    most: int = 3
    least_log_evidence: float = 20.0
    least_gain: float = 0.10
    least_removed: float = 0.5
    least_of_first: float = 0.10
    second_gain: float = 0.05
    second_log_evidence: float = 5.0
    beyond: float = 3.0
    same: float = 0.02


@dataclass(frozen=True, eq=False)
class Trial:
    """One more cause on top of those chosen.

    Attributes:
        cause: Which. fit: with it.
        log_evidence: (n,) evidence by joint. gain: (n,) drop of the cross-validated RMS. removed: (n,) [effort].
        level: Mean logarithm of the cross-validated RMS, joints weighted by their effective rows.
    """

    cause: Cause
    fit: StackedFit
    log_evidence: FloatArray
    gain: FloatArray
    removed: FloatArray
    level: float

    @property
    def evidence(self) -> float:
        """Nats left after the parameters are paid; the rows of all joints count together."""
        return float(self.log_evidence.sum())


@dataclass(frozen=True, eq=False)
class SharedSearch:
    """What was found.

    Attributes:
        chosen: Causes, in the order found. fit: with all of them. baseline: with none.
        ties: By chosen cause, others that do as well in its place.
    """

    chosen: tuple[Cause, ...]
    fit: StackedFit
    baseline: StackedFit
    ties: tuple[tuple[Cause, ...], ...]


def active(causes: Sequence[Cause], chosen: Sequence[Cause]) -> tuple[IntArray, FloatArray]:
    """Columns (p,) of the chosen causes and of all that have a tolerance, and the prior of each (p,): see `StackedFit`.

    The chosen causes come first and have no prior. A tolerance of 0 leaves its parameter out.
    """
    columns = [k for c in chosen for k in range(c.columns.start, c.columns.stop)]
    tolerance = [np.inf] * len(columns)
    for cause in causes:
        for place, size in enumerate(cause.tolerance if cause not in chosen else ()):
            if size > 0.0:
                columns.append(cause.columns.start + place)
                tolerance.append(size)
    return np.array(columns, dtype=np.int64), np.array(tolerance, dtype=np.float64)


def try_cause(
    rows: Sequence[JointRows], causes: Sequence[Cause], chosen: Sequence[Cause], before: StackedFit, cause: Cause
) -> Trial:
    """The fit with one more cause against the one before."""
    columns, tolerance = active(causes, [*chosen, cause])
    fitted = fit_stacked(rows, columns, tolerance, effective=before.effective)
    if not np.isfinite(fitted.cv_rms).all():
        nil = np.zeros(len(rows))
        return Trial(cause, fitted, nil - np.inf, nil, nil, np.inf)
    count = effective_rows(rows, fitted)
    ratio = np.log(before.cv_rms / np.maximum(fitted.cv_rms, 1e-300))
    price = 0.5 * cause.size * np.log(max(count.sum(), 2.0))
    log_evidence = count * ratio - price * count / count.sum()
    removed = np.sqrt(np.maximum(before.cv_rms**2 - fitted.cv_rms**2, 0.0))
    weight = np.array([r.target.size for r in rows], dtype=float)
    level = float(weight @ np.log(fitted.cv_rms) / weight.sum())
    return Trial(cause, fitted, log_evidence, 1.0 - np.exp(-ratio), removed, level)


def real(trial: Trial, floor: FloatArray, explained: FloatArray, options: SharedOptions) -> bool:
    """Whether a trial is a real improvement.

    Args:
        trial: One more cause.
        floor: (n,) noise floors [effort].
        explained: (n,) what the causes before it explain [effort].
        options: Thresholds.
    """
    matters = (
        (trial.gain >= options.least_gain)
        & (trial.removed >= options.least_removed * floor)
        & (trial.removed >= options.least_of_first * explained)
    )
    supports = (trial.gain >= options.second_gain) & (trial.log_evidence >= options.second_log_evidence)
    return bool(trial.evidence >= options.least_log_evidence and matters.any() and supports.sum() >= 2)


def beyond_tolerance(rows: Sequence[JointRows], trial: Trial, most: float) -> bool:
    """Whether an estimate lies where an error within its tolerance does not: |delta_i| > most sqrt(t_i^2 + s_i^2)."""
    cause = trial.cause
    if not cause.tolerance:
        return True
    place = np.isin(trial.fit.columns, np.arange(cause.columns.start, cause.columns.stop))
    noise = np.diag(covariance(rows, trial.fit)[0])[place]
    expected = np.sqrt(np.array(cause.tolerance) ** 2 + noise)
    return bool((np.abs(trial.fit.delta[place]) > most * expected).any())


def select(
    rows: Sequence[JointRows], causes: Sequence[Cause], floor: FloatArray, options: SharedOptions
) -> SharedSearch:
    """Forward selection; ends when no further cause is real.

    Args:
        rows: Training rows of all joints.
        causes: All of them; those in `TITLES` are candidates.
        floor: (n,) noise floors [effort].
        options: Thresholds.
    """
    return select_among(rows, causes, [c for c in causes if c.id in TITLES], floor, options)


def select_among(
    rows: Sequence[JointRows],
    causes: Sequence[Cause],
    candidates: Sequence[Cause],
    floor: FloatArray,
    options: SharedOptions,
) -> SharedSearch:
    """The same, of given candidates."""
    baseline = current = fit_stacked(rows, *active(causes, []))
    chosen: list[Cause] = []
    ties: list[tuple[Cause, ...]] = []
    for _ in range(options.most):
        trials = [try_cause(rows, causes, chosen, current, cause) for cause in candidates if cause not in chosen]
        trials.sort(key=lambda t: -t.evidence)
        explained = np.sqrt(np.maximum(baseline.cv_rms**2 - current.cv_rms**2, 0.0))
        good = [t for t in trials if real(t, floor, explained, options) and beyond_tolerance(rows, t, options.beyond)]
        if not good:
            break
        level = min(t.level for t in good)
        alike = [t for t in good if t.level <= level + options.same]
        best = min(alike, key=lambda t: (t.cause.size, t.level))
        ties.append(tuple(t.cause for t in alike if t is not best))
        chosen.append(best.cause)
        current = fit_stacked(rows, *active(causes, chosen))
    return SharedSearch(tuple(chosen), current, baseline, tuple(ties))
