"""The band in which effort and motion tell of each other: above it neither can be a model of the other.

Encoder errors, a controller that answers them and a drive's own estimate of its torque fill the upper frequencies of a
log with power that the balance of motion and load cannot hold. With P_y the spectral density of the effort and P_r that
of what the final model leaves of it, both on the training rows,

    S(f) = 1 - P_r(f)/P_y(f)

is the share of the effort's power that the model explains at f. The band ends where S falls below one half for the
first time, smoothed over a third of an octave. Errors in the band are told beside those of the whole. Gaps between the
rows, at reversals, let some of the power above the limit leak below it: the errors in the band are upper bounds.
"""

import numpy as np

from drake_tc.diagnosis.data.noise_colour import spectral_density
from drake_tc.diagnosis.residual.unexplained import DataSplit, SharedBand
from drake_tc.types import FloatArray

LEAST_SHARE = 0.5
LOWEST_HZ = 0.2
LEAST_LIMIT_HZ = 0.5
OCTAVES = 1.0 / 3.0


def shared_band(train: DataSplit, held: DataSplit) -> SharedBand | None:
    """The band that the training runs choose.

    None where the model explains the effort up to the end of the filters' band. Where it does not explain half of the
    effort's power even below half a hertz, there is no band: the limit is 0 and the errors are NaN.

    Args:
        train: Training rows.
        held: Held-out rows.
    """
    samples = train.samples
    frequency, left = spectral_density(samples, train.after)
    effort = spectral_density(samples, samples.reduce(samples.signals.effort))[1]
    top = _top(train, frequency)
    edges = np.arange(np.log2(LOWEST_HZ), np.log2(max(top, 2.0 * LOWEST_HZ)), OCTAVES)
    for low, high in zip(2.0 ** edges[:-1], 2.0 ** edges[1:], strict=True):
        inside = (frequency >= low) & (frequency < high)
        if inside.any() and left[inside].sum() > (1.0 - LEAST_SHARE) * effort[inside].sum():
            limit = float(low)
            if limit < LEAST_LIMIT_HZ:
                return SharedBand(0.0, float("nan"), float("nan"))
            return SharedBand(limit, _below(train, limit), _below(held, limit))
    return None


def _top(split: DataSplit, frequency: FloatArray) -> float:
    """Frequency at which the filters leave a tenth of the amplitude [Hz]."""
    gain = split.samples.light.gain(frequency) * split.samples.kernel.gain(frequency)
    passed = frequency[np.abs(gain) >= 0.1]
    return float(passed.max()) if passed.size else 0.0


def _below(split: DataSplit, limit: float) -> float:
    frequency, left = spectral_density(split.samples, split.after)
    inside = frequency <= limit
    mean = float(np.mean(split.after)) ** 2
    return float(np.sqrt(mean + np.sum(left[inside]) * (frequency[1] - frequency[0])))
