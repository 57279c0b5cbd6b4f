"""What the final model leaves, held against the noise floor, and the verdict that follows from it."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace

from drake_tc.diagnosis.data.noise_colour import correlated_noise
from drake_tc.diagnosis.notes import CorrelatedTorqueNoise, NoiseNote, NoiseOfRecordedEffort, ScatteringTimes
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import BalanceCoefficients
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.residual.equal_noise import with_equal_noise
from drake_tc.diagnosis.residual.extrapolation import beyond_training
from drake_tc.diagnosis.residual.structure import assess_residual, features, is_excess, worst_rms
from drake_tc.diagnosis.residual.unexplained import DataSplit, Unexplained, Verdict
from drake_tc.diagnosis.root_mean_square import rms
from drake_tc.diagnosis.thresholds import CORRELATED_NOISE_NOTED, ResidualThresholds
from drake_tc.effects.base import Context, TransmissionEffect


def what_is_left(
    splits: tuple[DataSplit, DataSplit],
    chosen: Fit,
    floor: float,
    context: Context,
    options: DiagnosisOptions,
    executor: Executor | None = None,
) -> tuple[Unexplained, float, tuple[NoiseNote, ...]]:
    """What is left, the noise floor [effort] with all noise of torque sensor and recorded effort in it, and notes."""
    if not options.assess_residual:
        return Unexplained(0.0, 0.0, False, 0.0, 0.0, False, ()), floor, ()
    servo, sensor = context.drive == "position_servo", context.load == "torque"
    known = BalanceCoefficients.of(chosen.terms, chosen.beta)
    first, second = (features(s.samples, known, servo=servo, load_measured=sensor) for s in splits)
    x = (first, second)
    thresholds = _residual_options(options.residual, chosen)
    equal = with_equal_noise(splits, chosen, floor)
    notes: tuple[NoiseNote, ...] = _scattering(splits)
    if equal.by_effort > CORRELATED_NOISE_NOTED:
        notes = (*notes, NoiseOfRecordedEffort(context.drive, equal.by_effort))
    judged, levels = equal.splits, list(equal.floors)
    left = assess_residual(*judged, x, min(levels), thresholds, options.seed, executor, sensor=sensor)
    if left.structured or left.excess:
        effects = [t.effect for t in chosen.terms]
        left = replace(left, beyond=beyond_training(judged, x, effects, context.drive, min(levels), thresholds))
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
    left = left.with_floors(
        rms(judged[1].after) / levels[1],
        max(rms(judged[0].after) / levels[0], worst_rms(judged[1]) / levels[1]),
        excess=is_excess(judged, levels, thresholds),
    )
    return equal.unweighted(left, splits[1], levels[1]), equal.unweighted_floor(levels[1]), notes


def _scattering(splits: Sequence[DataSplit]) -> tuple[ScatteringTimes, ...]:
    """The note on sampling instants that scatter, as the training runs or else the held-out runs show it."""
    found = [s.samples.resolution.timing for s in splits]
    return tuple(ScatteringTimes(t.time, t.fastest, t.noise) for t in found if t is not None)[:1]


def _residual_options(options: ResidualThresholds, chosen: Fit) -> ResidualThresholds:
    """Thresholds of this fit: three times as much may be left with a soft gear or backlash, modelled at rest only."""
    if not any(isinstance(t.effect, TransmissionEffect) for t in chosen.terms):
        return options
    return replace(options, least_of_before=3.0 * options.least_of_before)


def verdict_of(left: Unexplained, *, found: bool) -> Verdict:
    """The verdict of one joint, which follows from what is left and from whether effects were found."""
    if left.structured:
        return "unexplained_structure"
    if left.excess:
        return "unexplained_residual"
    return "effects_found" if found else "no_missing_effect"
