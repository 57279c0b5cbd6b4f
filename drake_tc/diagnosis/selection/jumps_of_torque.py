"""Does an effect explain more than the jumps of a torque whose slower clock does not tell their instants?

What such a torque lacks between its samples is noise in the rows beside its jumps (`data.between_samples`). Where the
jumps recur at the rhythm of the samples, this noise is the same at each of them, and resampled blocks, other training
runs and held-out runs all agree on an effect that imitates it. An effect must therefore also explain

    sqrt(mean_i (e_i^2 - f_i^2)/(b^2 + s_i^2)) >= 0.5

with e and f the residual without and with it, b the noise floor and s_i that noise in row i.
"""

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.selection.withdrawal import WithinJumps
from drake_tc.diagnosis.thresholds import JOINT
from drake_tc.types import FloatArray


def within_jumps(
    samples: Samples, without: FloatArray, with_it: FloatArray, gain: float, floor: float
) -> WithinJumps | None:
    """What the jumps say against an effect; None where they say nothing or the torque has the clock of the log.

    Args:
        samples: Training rows.
        without: (N,) residual without the effect [N m].
        with_it: (N,) with it.
        gain: Of the drive [effort/(N m)].
        floor: Noise floor [effort].
    """
    if samples.between is None or not samples.between.any():
        return None
    more = (without**2 - with_it**2) / ((floor / gain) ** 2 + samples.between)
    explains = float(np.sqrt(np.maximum(np.mean(more), 0.0)))
    return WithinJumps(explains, JOINT.least_removed) if explains < JOINT.least_removed else None
