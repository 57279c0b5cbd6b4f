"""A delay of less than one sampling period: is it a delay, or the instants at which the log was sampled?

A controller that writes its effort once a sampling period T holds it until the next one, so on average the effort that
acts is T/2 older than the sample. A torque sensor that is read at the end of that time shows the answer to the whole
of it, which adds up to T/2. A log does not tell how its columns lie within one period, so a delay or lag of up to

    0.6 T of an effort that may be held (a tenth for jitter), T beside a torque sensor,
    T/2 beyond the hold of a position servo's command, unless the rig file states the hold and there is no torque sensor
    T/2 of a position servo's command that was not taken to be held

is taken for the age of the recorded effort and no cause is named, unless the rig file says that the samples are points
of a continuous curve. The half period of an effort that is stated to be held is already in the fit. A goal that is
recorded before it is written acts up to T/2 later than a held one, and a goal that is recorded a time s after it was
written acts T/2 - s later than a continuous one. Where no delay was found, the effort is taken to be older if the model
then fits better in 90 % of the block resamples: half a period that is not taken into account biases friction and
inertia, and other effects imitate it. For a position servo this is tried on a slow clock only, and between the ages 0
and T/2, of which one was already chosen.
Joints whose loads are made of the encoders and the links alone are left out. Where links are fitted, a delay is sought
for all joints together. Elsewhere no sensor is nearly free of noise: an effort between two samples is their mean, with
less noise, and would fit better for that reason alone.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from drake_tc.diagnosis.data.samples import HELD, Samples
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.estimates import estimates
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.problem.regression import Fit, fit, noise_floor
from drake_tc.diagnosis.selection.comparison import better_share
from drake_tc.diagnosis.selection.lag_or_noise import LATE
from drake_tc.diagnosis.thresholds import (
    AGES,
    AGES_OF_COMMAND,
    BESIDE_TORQUE_SENSOR,
    CERTAINLY_BETTER,
    HELD_CERTAIN,
    HELD_FROM_PERIOD,
    LEAD_FLOORS,
    OF_HELD_EFFORT,
)
from drake_tc.effects.base import Context, DriveEffect


def most_of_sampling(stated: bool | None, context: Context, samples: Samples) -> float:
    """Delay in sampling periods, beyond the age that the fit already has, that the instants of sampling can explain."""
    if stated is False:
        return 0.0
    sensor = context.load == "torque"
    if context.drive == "position_servo":
        if samples.effort_age == HELD:
            return HELD if sensor or (stated is None and context.load != "links") else 0.0
        return HELD - samples.effort_age
    if context.load == "links":
        return 0.0
    return (BESIDE_TORQUE_SENSOR if sensor else OF_HELD_EFFORT) - samples.effort_age


def sampled_late(stated: bool | None, prepared: Prepared, chosen: Sequence[Term]) -> float:
    """Delay in sampling periods of the one lag or delay that was found, where sampling can explain it; else 0.

    Sampling can explain it where the 95 % interval of the delay reaches down to what sampling explains: with a coarse
    encoder, half a period of 10 ms came out as 6.3 ms, 5.5 to 7.0 ms, and was named a delay.

    Args:
        stated: `command_hold` of the rig file; None where it does not say.
        prepared: The joint as it was fitted.
        chosen: Terms of the model that was found.
    """
    samples = prepared.train.samples
    known = {t.effect.key for t in prepared.terms}
    late = [t for t in chosen if t.effect.id in LATE and t.effect.key not in known]
    if len(late) != 1 or late[0].effect.form == "winding" or not isinstance(late[0].effect, DriveEffect):
        return 0.0
    (name, value), period = next(iter(late[0].shape.items())), samples.signals.period
    most = most_of_sampling(stated, prepared.context, samples)
    if most <= 0.0:
        return 0.0
    found = estimates(prepared.train, fit(prepared.train, chosen), prepared.context.drive)
    surely = found[late[0].effect.key][name].ci95[0] / period
    return min(float(value) / period, most) if surely <= most else 0.0


def age_of_samples(
    stated: bool | None, prepare: Callable[..., Prepared], plain: Prepared, chosen: Sequence[Term]
) -> Prepared | None:
    """The joint with an effort that is older than its samples, where the model then certainly fits better.

    Args:
        stated: `command_hold` of the rig file; None where it does not say. `prepare` does as it says.
        prepare: The joint whose effort is `sampled_late` sampling periods older.
        plain: The joint with the effort as recorded.
        chosen: Terms of the model that was found.
    """
    context = plain.context
    late = any(t.effect.id in LATE for t in chosen)
    of_model = context.load in ("links", "robot") and plain.train.samples.resolution.effort_tells_load
    if stated is not None or late or of_model:
        return None
    ages = _ages(context, plain.train.samples)
    if not ages:
        return None
    without = _aged(prepare, 0.0, chosen)
    tried = {age: _aged(prepare, age, chosen) for age in ages}
    if context.drive == "position_servo":
        tried |= _between(tried, prepare, chosen)
    age, best = min(tried.items(), key=lambda item: item[1].cv_rms)
    if best.block_sse.size != without.block_sse.size:
        return None
    certain = better_share(without.block_sse - best.block_sse) >= HELD_CERTAIN
    return prepare(sampled_late=age) if certain else None


def error_of_age(prepare: Callable[..., Prepared], plain: Prepared, joint: Prepared, chosen: Sequence[Term]) -> float:
    """Largest error that the age of a position servo's command may have, as far as the rows tell [sampling periods].

    The largest distance from the age of `joint` of the ages between those of a continuous and of a held command that do
    not leave a certainly larger error. It is `HELD` where a log does not tell: on a fast clock, beside a channel that
    is recorded late, and where more than noise is left, because a wrong model may prefer a wrong age.

    Args:
        prepare: The joint whose command is `sampled_late` sampling periods older.
        plain: The joint with the command as the declared model has it.
        joint: The joint as it was fitted.
        chosen: Terms of the final model.
    """
    samples, first = joint.train.samples, plain.train.samples
    late = samples.position_late or samples.torque_late or samples.centred
    if samples.signals.period < HELD_FROM_PERIOD or late:
        return HELD
    rows = prepare(sampled_late=samples.effort_age - first.effort_age, both_sides=True).train
    own = fit(rows, chosen)
    if own.cv_rms > LEAD_FLOORS * noise_floor(rows, own):
        return HELD
    left = 0.0
    for age in (0.0, *AGES_OF_COMMAND, HELD):
        distance = abs(age - samples.effort_age)
        if distance <= left:
            continue
        other = _aged(prepare, age - first.effort_age, chosen)
        same_rows = other.block_sse.size == own.block_sse.size
        if not same_rows or better_share(other.block_sse - own.block_sse) < CERTAINLY_BETTER:
            left = distance
    return left


def _aged(prepare: Callable[..., Prepared], age: float, chosen: Sequence[Term]) -> Fit:
    """Fit of the chosen terms to the joint with an effort that is `age` sampling periods older.

    Its rows lie alike on both sides of a reversal. Friction that turns over within a small speed instead of at once
    would otherwise be in the rows before reversals only, where it looks like that of an older effort.
    """
    return fit(prepare(sampled_late=age, both_sides=True).train, chosen)


def _between(tried: Mapping[float, Fit], prepare: Callable[..., Prepared], chosen: Sequence[Term]) -> dict[float, Fit]:
    """The age at which the parabola through the squared errors of three equally spaced ages is least, and its fit.

    None where an error is infinite, because the chosen effects explain nothing at that age.
    """
    ages = sorted(tried)
    low, mid, high = (tried[age].cv_rms ** 2 for age in ages)
    if not np.isfinite([low, mid, high]).all():
        return {}
    bend = low - 2.0 * mid + high
    step = ages[1] - ages[0]
    if not bend > 0.0:
        return {}
    age = float(np.clip(ages[1] + 0.5 * step * (low - high) / bend, ages[0] - step, ages[2] + step))
    return {age: _aged(prepare, age, chosen)}


def _ages(context: Context, samples: Samples) -> list[float]:
    """Ages to try [sampling periods], beyond that which the effort is taken to have."""
    if context.drive == "position_servo":
        if samples.signals.period < HELD_FROM_PERIOD:
            return []
        return [age - samples.effort_age for age in AGES_OF_COMMAND]
    return [age for age in AGES if age <= most_of_sampling(None, context, samples)]
