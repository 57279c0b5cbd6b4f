"""Whether the remaining error lies where the held-out runs go beyond the range of the training runs.

Outside this range the model is extrapolated. For example, the residual of a held-out run that is warmer than every
training run is the error of the extrapolated friction, and that of a run with larger efforts is the error of the
extrapolated drive gain. Neither shows that an effect is missing within the range, and neither is an event.
"""

from collections.abc import Collection

import numpy as np

from drake_tc.diagnosis.residual.structure import FEATURES, beyond_range
from drake_tc.diagnosis.residual.unexplained import BeyondTraining, DataSplit
from drake_tc.diagnosis.root_mean_square import rms
from drake_tc.diagnosis.thresholds import ResidualThresholds
from drake_tc.effects.base import DriveKind, Effect
from drake_tc.types import FloatArray

CURVES_OVER = {name: name for name in ("velocity", "acceleration", "position", "temperature")} | {
    "load_torque": "expected_torque"
}
"""Signals on which effects depend, and the corresponding features of the residual."""
EFFORT = "effort"
"""Signal over which every model extrapolates its drive gain."""


def beyond_training(
    splits: tuple[DataSplit, DataSplit],
    x: tuple[FloatArray, FloatArray],
    effects: Collection[Effect],
    drive: DriveKind,
    floor: float,
    options: ResidualThresholds,
) -> BeyondTraining | None:
    """The signal beyond whose training range nearly all of the held-out residual lies; None where there is none.

    The RMS of the rows inside the range must be at most `options.most_floors` noise floors, and the RMS of the rows
    outside at least twice as large.

    Args:
        splits: Training rows and held-out rows.
        x: Features (N, 8) of the training rows, (M, 8) of the held-out ones.
        effects: Those of the final model. The signals on which one of them depends are tested, and the effort, because
            every model has a drive gain.
        drive: Kind of drive, which decides the unit of the effort, together with the type of the joint.
        floor: Noise floor [effort].
        options: Uses `most_floors` and `least_beyond`.
    """
    names = {CURVES_OVER[n] for e in effects for n in (e.signature.x, *e.needs) if n in CURVES_OVER}
    signals = {name: (x[0][:, FEATURES.index(name)], x[1][:, FEATURES.index(name)]) for name in sorted(names)}
    efforts = [split.samples.signals.effort[split.samples.rows] for split in splits]
    held, found = splits[1], []
    for name, (train, now) in {**signals, EFFORT: (efforts[0], efforts[1])}.items():
        beyond = beyond_range(train[:, None], now[:, None])[:, 0]
        if not beyond.any() or beyond.all():
            continue
        share = float(np.sum(held.after[beyond] ** 2) / np.sum(held.after**2))
        near, far = rms(held.after[~beyond]), rms(held.after[beyond])
        if share >= options.least_beyond and near <= options.most_floors * floor and far >= 2.0 * near:
            runs = [held.samples.runs[k] for k in np.unique(held.samples.run[beyond])]
            trained, reached = ((float(part.min()), float(part.max())) for part in (train, now))
            unit = held.samples.units.on(drive).effort if name == EFFORT else ""
            found.append((beyond.mean() - share, BeyondTraining(name, tuple(runs), trained, reached, share, unit)))
    return min(found, key=lambda each: each[0])[1] if found else None
