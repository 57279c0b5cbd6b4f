"""A delay of less than one sampling period: is it a delay, or the instants at which the log was sampled?

A controller that writes its effort once a sampling period T holds it until the next one, so on average the effort that
acts is T/2 older than the sample. A torque sensor that is read at the end of that time shows the answer to the whole
of it, which adds up to T/2. A log does not tell how its columns lie within one period, so a delay or lag of up to

    0.6 T of an effort that may be held (a tenth for jitter), T beside a torque sensor,
    T/2 beyond the hold of a position servo's command, beside a torque sensor

is taken for the age of the recorded effort and no cause is named, unless the rig file says that the samples are points
of a continuous curve. The half period of an effort that is stated to be held is already in the fit. Where no delay was
found, the effort of a current or voltage drive is taken to be older if the model then fits better in 90 % of the block
resamples: half a period that is not taken into account biases friction and inertia, and other effects imitate it.
Joints whose links are fitted are left out: a delay of theirs is sought for all joints together.
"""

from collections.abc import Callable, Sequence

from drake_tc.diagnosis.data.samples import HELD, Samples
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.selection.comparison import better_share
from drake_tc.diagnosis.selection.lag_or_noise import LATE
from drake_tc.diagnosis.thresholds import AGES, BESIDE_TORQUE_SENSOR, HELD_CERTAIN, OF_HELD_EFFORT
from drake_tc.effects.base import Context, DriveEffect


def most_of_sampling(stated: bool | None, context: Context, samples: Samples) -> float:
    """Delay in sampling periods, beyond the age that the fit already has, that the instants of sampling can explain."""
    if stated is False:
        return 0.0
    sensor = context.load == "torque"
    if context.drive == "position_servo":
        return BESIDE_TORQUE_SENSOR - HELD if sensor and samples.effort_age == HELD else 0.0
    if context.load == "links":
        return 0.0
    return (BESIDE_TORQUE_SENSOR if sensor else OF_HELD_EFFORT) - samples.effort_age


def sampled_late(stated: bool | None, prepared: Prepared, chosen: Sequence[Term]) -> float:
    """Delay in sampling periods of the one lag or delay that was found, where sampling can explain it; else 0.

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
    periods = float(next(iter(late[0].shape.values()))) / samples.signals.period
    return periods if periods <= most_of_sampling(stated, prepared.context, samples) else 0.0


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
    if stated is not None or late or context.drive == "position_servo" or context.load == "links":
        return None
    without = fit(plain.train, chosen)
    aged = (prepare(sampled_late=age) for age in AGES if age <= most_of_sampling(stated, context, plain.train.samples))
    best, joint = min(((fit(each.train, chosen), each) for each in aged), key=lambda pair: pair[0].cv_rms)
    if best.block_sse.size != without.block_sse.size:
        return None
    return joint if better_share(without.block_sse - best.block_sse) >= HELD_CERTAIN else None
