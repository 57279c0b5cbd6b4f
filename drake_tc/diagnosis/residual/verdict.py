"""What the final model leaves, held against the noise floor, and the verdict that follows from it.

Where the held-out runs go beyond the range of the training runs, the model is extrapolated (`beyond_training`). For
example, the residual of a held-out run that is warmer than every training run is the error of the extrapolated
friction, and that of a run with larger efforts is the error of the extrapolated drive gain. Neither shows that an
effect is missing within the range, and neither is an event.
"""

from collections.abc import Collection
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.data.noise_colour import correlated_noise
from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.notes import (
    CorrelatedTorqueNoise,
    NoiseNote,
    NoiseOfRecordedEffort,
    RunsDiffer,
    ScatteringTimes,
)
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.priors import (
    CORRELATED_NOISE_NOTED,
    LEAST_BEYOND,
    LEAST_OF_BEFORE,
    MOST_FLOORS,
    NAMED_FLOORS,
    SEEN,
)
from drake_tc.diagnosis.problem.columns import BalanceCoefficients
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.residual.structure import (
    FEATURES,
    assess_residual,
    beyond_range,
    features,
    is_excess,
    worst_rms,
)
from drake_tc.diagnosis.residual.unexplained import BeyondTraining, DataSplit, Unexplained, Verdict, with_equal_noise
from drake_tc.effects.base import Context, DriveKind, Effect, TransmissionEffect
from drake_tc.types import FloatArray

CURVES_OVER = {name: name for name in ("velocity", "acceleration", "position", "temperature")} | {
    "load_torque": "expected_torque"
}
"""Signals on which effects depend, and the corresponding features of the residual."""
EFFORT = "effort"
"""Signal over which every model extrapolates its drive gain."""


def what_is_left(
    splits: tuple[DataSplit, DataSplit],
    chosen: Fit,
    floor: float,
    context: Context,
    options: DiagnosisOptions,
    executor: Executor | None = None,
) -> tuple[Unexplained, float, tuple[NoiseNote, ...]]:
    """What is left, the noise floor [effort] of the held-out rows, and notes.

    The floor has all noise of the torque sensor and of the recorded effort in it, and the friction that differs from
    run to run no more than the training runs do.
    """
    if not options.assess_residual:
        return Unexplained(0.0, 0.0, False, 0.0, 0.0, False, ()), floor, ()
    first, second = (replace(s, after=s.after - s.of_runs, of_runs=0.0) for s in splits)
    left, floor, notes = _beyond_runs((first, second), chosen, floor, context, options, executor)
    more = rms(np.broadcast_to(splits[1].of_runs, splits[1].after.shape))
    if more == 0.0:
        return left, floor, notes
    whole = float(np.hypot(floor, more))
    if whole > CORRELATED_NOISE_NOTED * floor:
        notes = (*notes, RunsDiffer(whole / max(floor, 1e-300)))
    return replace(left, floors=rms(splits[1].after) / whole), whole, notes


def _beyond_runs(
    splits: tuple[DataSplit, DataSplit],
    chosen: Fit,
    floor: float,
    context: Context,
    options: DiagnosisOptions,
    executor: Executor | None,
) -> tuple[Unexplained, float, tuple[NoiseNote, ...]]:
    servo, sensor = context.drive == "position_servo", context.load == "torque"
    known = BalanceCoefficients.of(chosen.terms, chosen.beta)
    first, second = (features(s.samples, known, servo=servo, load_measured=sensor) for s in splits)
    x = (first, second)
    gears = any(isinstance(t.effect, TransmissionEffect) for t in chosen.terms)  # modelled at rest only
    least = (3.0 if gears else 1.0) * LEAST_OF_BEFORE
    equal = with_equal_noise(splits, chosen, floor)
    timing = [s.samples.resolution.timing for s in splits]
    notes: tuple[NoiseNote, ...] = tuple(ScatteringTimes(t.time, t.fastest, t.noise) for t in timing if t)[:1]
    if equal.by_effort > CORRELATED_NOISE_NOTED:
        notes = (*notes, NoiseOfRecordedEffort(context.drive, equal.by_effort))
    judged, levels = equal.splits, list(equal.floors)
    left = assess_residual(*judged, x, min(levels), options.seed, executor, least_of_before=least, sensor=sensor)
    if left.structured or left.excess:
        effects = [t.effect for t in chosen.terms]
        left = replace(left, beyond=beyond_training(judged, x, effects, context.drive, min(levels)))
    if left.structured:
        return equal.unweighted(left, splits[1], min(levels)), equal.unweighted_floor(min(levels)), notes
    if sensor and not splits[0].samples.resolution.torque_is_declared:
        noise = correlated_noise([(s.samples, s.after / chosen.gain) for s in judged])
        levels = [
            max(each, n.rms * chosen.gain) if n is not None and n.is_noise else each
            for each, n in zip(equal.floors, noise, strict=True)
        ]
        if levels[1] > CORRELATED_NOISE_NOTED * equal.floors[1] and noise[1] is not None:
            notes = (*notes, CorrelatedTorqueNoise(levels[1] / equal.floors[1], noise[1].correlation_time))
    left = replace(
        left,
        floors=rms(judged[1].after) / levels[1],
        floors_anywhere=max(rms(judged[0].after) / levels[0], worst_rms(judged[1]) / levels[1]),
        excess=is_excess(judged, levels, least),
    )
    return equal.unweighted(left, splits[1], levels[1]), equal.unweighted_floor(levels[1]), notes


def verdict_of(left: Unexplained, *, found: bool) -> Verdict:
    """The verdict of one joint, which follows from what is left and from whether effects were found."""
    if left.structured:
        return "unexplained_structure"
    if left.excess:
        return "unexplained_residual"
    return "effects_found" if found else "no_missing_effect"


def beyond_training(
    splits: tuple[DataSplit, DataSplit],
    x: tuple[FloatArray, FloatArray],
    effects: Collection[Effect],
    drive: DriveKind,
    floor: float,
) -> BeyondTraining | None:
    """The signal beyond whose training range nearly all of the held-out residual lies; None where there is none.

    The RMS of the rows inside the range must be at most `MOST_FLOORS` noise floors, and the RMS of the rows
    outside at least twice as large.

    Args:
        splits: Training rows and held-out rows.
        x: Features (N, 8) of the training rows, (M, 8) of the held-out ones.
        effects: Those of the final model. The signals on which one of them depends are tested, and the effort, because
            every model has a drive gain.
        drive: Kind of drive, which decides the unit of the effort, together with the type of the joint.
        floor: Noise floor [effort].
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
        if share >= LEAST_BEYOND and near <= MOST_FLOORS * floor and far >= 2.0 * near:
            runs = [held.samples.runs[k] for k in np.unique(held.samples.run[beyond])]
            trained, reached = ((float(part.min()), float(part.max())) for part in (train, now))
            unit = held.samples.units.on(drive).effort if name == EFFORT else ""
            found.append((beyond.mean() - share, BeyondTraining(name, tuple(runs), trained, reached, share, unit)))
    return min(found, key=lambda each: each[0])[1] if found else None


def visible_share(evidence: Evidence, scored: Scored, floor: float) -> float:
    """Smallest RMS effort error that the rows could have shown, over the RMS of the effort.

    A term x with coefficient c raises the log likelihood by c^2 |x|^2/(2 s^2), |x| that of the whitened
    column beside the others. `SEEN` of it, for a column as loud after the whitening as the effort itself, or half a
    noise floor.
    """
    model = evidence.model
    rows = model.train.rows
    effort = model.train.recorded.effort(())
    white = rows.whitened(effort[:, None], evidence.noise)[0]
    share = rms(white) / max(rms(effort[rows.index]), 1e-300)
    least = np.sqrt(2.0 * SEEN * scored.posterior.variance / max(white.shape[0], 1)) / max(share, 1e-300)
    return float(max(least, NAMED_FLOORS * floor) / model.scale)
