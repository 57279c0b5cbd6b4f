"""Covariance of what the final model leaves of the held-out runs, as link-side torque: the Sigma of later controllers.

    e = tau - tau_model = (held-out residual [effort])/K        rows in resolved motion, in the band of the diagnosis
    S_jj = mean e_j^2  over the joint's own rows                R_ij: correlation over the rows of all joints
    Sigma = D ((1 - lambda) R + lambda I) D,   D = diag sqrt S_jj

R has unit diagonal and comes from one set of rows, so it and Sigma are positive semidefinite. lambda is the shrinkage
that minimises the expected squared error of R, its variances counting only effective samples.

The rows are correlated in time. With tau_2 the correlation time of e^2 in rows, T rows know the variance as well as

    nu = 2 (mean e^2)^2 T / (tau_2 var e^2)

independent normal ones would; nu S/sigma^2 is taken as chi-squared with nu degrees of freedom (Satterthwaite).

Source: Schäfer and Strimmer, Stat. Appl. Genet. Mol. Biol. 4 (2005) 32, target D; Satterthwaite, Biometrics 2 (1946).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from drake_tc.config.files import utf8_name
from drake_tc.control.torque_uncertainty_file import TorqueUncertainty
from drake_tc.diagnosis.data.samples import one_clock
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.types import FloatArray, IntArray

FEWEST_COMMON = 100
"""Rows of all joints together; below it only the diagonal is estimated."""


@dataclass(frozen=True, eq=False)
class Rows:
    """One joint's torque error on rows of a common clock.

    Attributes:
        error: (N,) e [N m].
        index: (N,) rising places on the clock.
        stride: Places between neighbouring rows of an unbroken stretch.
        segment: (N,) number of the unbroken stretch of the clock.
    """

    error: FloatArray
    index: IntArray
    stride: int
    segment: IntArray

    @property
    def lengths(self) -> list[int]:
        """Rows in each unbroken stretch."""
        broken = (np.diff(self.index) > 1.5 * self.stride) | (np.diff(self.segment) != 0)
        cuts = np.flatnonzero(broken) + 1
        return [int(n) for n in np.diff(np.concatenate([[0], cuts, [self.index.size]]))]


@dataclass(frozen=True)
class Spread:
    """Spread of one joint's error: sigma about zero, its 95 % interval, mean [N m]; correlation time in rows; nu."""

    sigma: float
    ci95: tuple[float, float]
    mean: float
    correlation_time: float
    effective_samples: float


def spread(error: FloatArray, lengths: Sequence[int] | None = None) -> Spread:
    """Spread of a series (N,) [N m] whose neighbours are correlated; `lengths` of its unbroken stretches."""
    square = error**2
    second = float(np.mean(square))
    mean = float(np.mean(error))
    if not second > 0.0:
        return Spread(0.0, (0.0, 0.0), 0.0, 1.0, float(error.size))
    varying = square - second
    variance = float(np.mean(varying**2)) * correlation_time(varying, lengths) / error.size
    nu = float(np.clip(2.0 * second**2 / max(variance, 1e-300), 1.0, error.size))
    low, high = (np.sqrt(second * nu / chi2.ppf(p, nu)) for p in (0.975, 0.025))
    return Spread(float(np.sqrt(second)), (float(low), float(high)), mean, correlation_time(error - mean, lengths), nu)


def common_errors(rows: Sequence[Rows]) -> tuple[FloatArray, list[int]]:
    """(C, n) errors at the places where all joints have rows, and the lengths of unbroken stretches.

    The places are those of the joint with the widest stride; between two neighbouring rows of another joint its error,
    which has passed a low-pass of that width, is taken from a straight line.
    """
    widest = max(rows, key=lambda r: r.stride)
    kept = np.ones(widest.index.size, dtype=bool)
    columns = []
    for each in rows:
        after = np.clip(np.searchsorted(each.index, widest.index), 0, each.index.size - 1)
        before = np.where(each.index[after] == widest.index, after, np.maximum(after - 1, 0))
        reach = each.index[after] - each.index[before]
        inside = (each.index[before] <= widest.index) & (widest.index <= each.index[after])
        kept &= inside & (reach <= each.stride) & (each.segment[before] == each.segment[after])
        columns.append(np.interp(widest.index, each.index, each.error))
    part = Rows(widest.error[kept], widest.index[kept], widest.stride, widest.segment[kept])
    return np.stack(columns, axis=1)[kept], part.lengths


def shrunk_correlation(errors: FloatArray, lengths: Sequence[int]) -> tuple[FloatArray, float, float]:
    """(R shrunk (n, n), lambda, least effective samples of any pair) of errors (C, n) about zero."""
    count, n = errors.shape
    size = np.sqrt(np.mean(errors**2, axis=0))
    unit = errors / np.where(size > 0.0, size, 1.0)
    raw = unit.T @ unit / count
    np.fill_diagonal(raw, 1.0)
    variance, square, fewest = 0.0, 0.0, float(count)
    for i in range(n):
        for j in range(i):
            product = unit[:, i] * unit[:, j] - raw[i, j] * 0.5 * (unit[:, i] ** 2 + unit[:, j] ** 2)
            effective = count / correlation_time(product - product.mean(), lengths)
            variance += float(np.var(product)) / effective
            square += raw[i, j] ** 2
            fewest = min(fewest, effective)
    share = 1.0 if square <= 0.0 else float(np.clip(variance / square, 0.0, 1.0))
    share = share if n > 1 else 0.0
    return (1.0 - share) * raw + share * np.eye(n), share, fewest


def torque_uncertainty(result: CloseLoopResult) -> TorqueUncertainty:
    """Sigma of a result's joints, with all there is to know of how well it is known."""
    rows = {name: torque_error(joint) for name, joint in result.joints.items()}
    spreads = {name: spread(each.error, each.lengths) for name, each in rows.items()}
    correlation, share, common = np.eye(len(rows)), 0.0, 0.0
    if len(rows) > 1 and one_clock([joint.heldout.samples for joint in result.joints.values()]):
        errors, lengths = common_errors(list(rows.values()))
        if errors.shape[0] >= FEWEST_COMMON:
            correlation, share, common = shrunk_correlation(errors, lengths)
    sigma = np.array([each.sigma for each in spreads.values()])
    ticks = [rows[name].stride * joint.heldout.samples.signals.period for name, joint in result.joints.items()]
    return TorqueUncertainty(
        joints=tuple(result.joints),
        covariance=correlation * np.outer(sigma, sigma),
        mean=np.array([each.mean for each in spreads.values()]),
        ci95=np.array([each.ci95 for each in spreads.values()]),
        correlation_time=np.array([each.correlation_time * t for each, t in zip(spreads.values(), ticks, strict=True)]),
        effective_samples=np.array([each.effective_samples for each in spreads.values()]),
        samples=np.array([each.error.size for each in rows.values()], dtype=np.float64),
        common_effective_samples=common,
        shrinkage=share,
        provenance={
            "made_by": "drake-tc close-loop",
            "rig": utf8_name(result.rig_file),
            "holdout": [utf8_name(path) for path in result.heldout_files],
            "model": "model_after.yaml",
        },
    )


def torque_error(joint: JointResult) -> Rows:
    """What the final model leaves of the held-out rows, as link-side torque."""
    samples = joint.heldout.samples
    ends = np.array([s.stop for s in samples.segments])
    index = samples.rows
    stride = int(np.median(np.diff(index))) if index.size > 1 else 1
    gain = joint.final_parameters["drive"]["gain"].value
    if "servo_gain" in joint.final_parameters:  # the drive is listed with its declared gain
        gain /= 1.0 + joint.final_parameters["servo_gain"]["gain_error"].value
    return Rows(joint.heldout.after / gain, index, stride, np.searchsorted(ends, index, side="right").astype(np.int64))
