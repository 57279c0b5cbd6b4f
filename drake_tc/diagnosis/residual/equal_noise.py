"""Residuals under noise of different size in each row, weighted so that noise alone would be equally loud everywhere.

Where the sampling instants scatter, fast motion is loud although nothing acts on the joint, and held-out runs that are
faster than the training runs leave more. Jumps of a torque on a slower clock are loud too (`data.clocks`).
The tests of what is left compare rows, stretches and runs with each other. They therefore get the residual times

    w_i = L/sqrt(b^2 + t_i^2)

with t_i what scatter and jumps leave in row i, b what all other noise leaves, and L the RMS of sqrt(b^2 + t_i^2) over
the training rows, which is the noise floor of all weighted rows.
"""

from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.data.noise_colour import left_by_effort_noise
from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.problem.columns import BalanceCoefficients
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.residual.unexplained import DataSplit, Unexplained
from drake_tc.types import FloatArray

LEAST_OTHER_NOISE = 0.01
"""Of the noise floor, that all other noise is taken to leave at least."""
QUIET = 1.0 / 3.0
"""Share of the rows, those in which scatter and jumps leave least, that show the noise of the effort."""

AT_A_SAMPLE = 3.0
"""Variance of what jumps leave that all lie at a sample, over that of jumps anywhere between: (T/2)^2 over T^2/12."""


@dataclass(frozen=True)
class EqualNoise:
    """Both splits under equal noise.

    Attributes:
        splits: Training and held-out rows, weighted where noise grows with the speed.
        floors: Noise floor of each weighted split [effort].
        heldout: Noise floor of the held-out rows as they are [effort].
        by_effort: That floor over the same without noise of the recorded effort.
    """

    splits: tuple[DataSplit, DataSplit]
    floors: tuple[float, float]
    heldout: float
    by_effort: float

    def unweighted_floor(self, level: float) -> float:
        """Noise floor of the held-out rows as they are, where that of the weighted ones is `level` [effort]."""
        return self.heldout / self.floors[1] * level

    def unweighted(self, left: Unexplained, held: DataSplit, level: float) -> Unexplained:
        """What is left, with the figures of the held-out rows as they are.

        Args:
            left: Of the weighted rows.
            held: Held-out rows as they are.
            level: Noise floor of the weighted rows [effort].
        """
        if self.splits[1] is held:
            return left
        ratio = rms(held.after) / max(rms(self.splits[1].after), 1e-300)
        floors = rms(held.after) / self.unweighted_floor(level)
        return replace(left, floors=floors, explainable_rms=ratio * left.explainable_rms)


def with_equal_noise(splits: tuple[DataSplit, DataSplit], chosen: Fit, floor: float) -> EqualNoise:
    """The splits under equal noise; the splits themselves where it is the same in all rows.

    Args:
        splits: Training and held-out rows.
        chosen: The final model.
        floor: What the noise of encoder, torque sensor and sampling instants leaves on the training rows [effort].
    """
    scatter = [_of_scatter(each, chosen) for each in splits]
    timing = [own + _of_jumps(each, chosen, floor) for each, own in zip(splits, scatter, strict=True)]
    if not any(each.any() for each in timing):
        first, second = (float(np.hypot(floor, left_by_effort_noise(s.samples, s.after, floor))) for s in splits)
        return EqualNoise(splits, (first, second), second, second / floor)
    other = max(floor**2 - float(np.mean(scatter[0])), (LEAST_OTHER_NOISE * floor) ** 2)
    efforts = [_effort_in_quiet_rows(each, own, other) for each, own in zip(splits, timing, strict=True)]
    levels = [np.sqrt(other + each**2 + own) for each, own in zip(efforts, timing, strict=True)]
    level, heldout = rms(levels[0]), rms(levels[1])
    train, held = (
        replace(split, before=weight * split.before, after=weight * split.after, weight=weight)
        for split, weight in zip(splits, (level / own for own in levels), strict=True)
    )
    sensors = float(np.sqrt(other + np.mean(timing[1])))
    return EqualNoise((train, held), (level, level), heldout, heldout / sensors)


def _effort_in_quiet_rows(split: DataSplit, timing: FloatArray, other: float) -> float:
    """What noise of the recorded effort leaves [effort], as the rows show it in which scatter and jumps leave least."""
    quiet, samples = timing <= np.quantile(timing, QUIET), split.samples
    rows = replace(samples, rows=samples.rows[quiet], run=samples.run[quiet])
    return left_by_effort_noise(rows, split.after[quiet], float(np.sqrt(other + np.mean(timing[quiet]))))


def _of_scatter(split: DataSplit, chosen: Fit) -> FloatArray:
    """(N,) variances [effort^2] that scatter of the sampling instants leaves on the rows; the floor has them."""
    samples = split.samples
    if samples.timing is None:
        return np.zeros(split.after.size)
    known = BalanceCoefficients.of(chosen.terms, chosen.beta, samples.signals.rotor_inertia)
    return chosen.gain**2 * samples.floor.timing_variance(known.viscous, known.inertia, samples.timing)


def _of_jumps(split: DataSplit, chosen: Fit, floor: float) -> FloatArray:
    """(N,) variances [effort^2] that jumps of a torque on a slower clock leave (`between_samples`).

    Jumps that recur may all lie at the same place between the samples. They then leave all more or all less than
    jumps at any place, and the rows beside them show how much.
    """
    between = split.samples.between
    if between is None:
        return np.zeros(split.after.size)
    found = chosen.gain**2 * between
    beside = found > floor**2
    if not beside.any():
        return found
    shown = (float(np.mean(split.after[beside] ** 2)) - floor**2) / float(np.mean(found[beside]))
    return found * float(np.clip(shown, 0.0, AT_A_SAMPLE))
