"""A delay of less than one sampling period: is it a delay, or the instants at which the log was sampled?

A controller that writes its effort once a sampling period T holds it until the next one, so on average the effort that
acts is T/2 older than the sample. A torque sensor that is read at the end of that time shows the answer to the whole
of it, which adds up to T/2. A log does not tell how its columns lie within one period, so a delay or lag of up to

    0.6 T of an effort that may be held (a tenth for jitter), T beside a torque sensor,
    T/2 beyond the hold of a position servo's command, beside a torque sensor

is taken for the age of the recorded effort and no cause is named. Where no delay was found, the effort of a current or
voltage drive is taken to be held if the model then fits better in 90 % of the block resamples: otherwise half a period
would bias the viscous friction by y_dot T/2.
"""

from collections.abc import Sequence

from drake_tc.diagnosis.data.samples import HELD, Samples
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.selection.comparison import better_share
from drake_tc.diagnosis.selection.lag_or_noise import LATE
from drake_tc.diagnosis.thresholds import HELD_CERTAIN
from drake_tc.effects.base import Context

BESIDE_TORQUE_SENSOR = 1.0
OF_HELD_EFFORT = 0.6


def most_of_sampling(context: Context, samples: Samples) -> float:
    """Delay in sampling periods that the instants of sampling can explain."""
    sensor = context.load == "torque"
    if context.drive == "position_servo":
        return BESIDE_TORQUE_SENSOR - HELD if sensor and samples.effort_age == HELD else 0.0
    if context.load in ("robot", "links"):
        return 0.0
    return BESIDE_TORQUE_SENSOR if sensor else OF_HELD_EFFORT


def sampled_late(prepared: Prepared, chosen: Sequence[Term]) -> float:
    """Delay in sampling periods of the one lag or delay that was found, where sampling can explain it; else 0."""
    samples = prepared.train.samples
    known = {t.effect.key for t in prepared.terms}
    late = [t for t in chosen if t.effect.id in LATE and t.effect.form != "winding" and t.effect.key not in known]
    if len(late) != 1:
        return 0.0
    periods = float(next(iter(late[0].shape.values()))) / samples.signals.period
    return periods if periods <= most_of_sampling(prepared.context, samples) else 0.0


def effort_is_held(stated: bool | None, plain: Prepared, held: Prepared, chosen: Sequence[Term]) -> bool:
    """Whether the effort of a drive that is no position servo acts unchanged from one sample to the next.

    Args:
        stated: What the rig file says; None where it does not.
        plain: The joint with the effort as recorded.
        held: The same with an effort that is half a sampling period older.
        chosen: Terms of the model that was found.
    """
    if stated is not None:
        return False  # `prepare_joint` does as the rig file says
    without, with_hold = (fit(each.train, chosen).block_sse for each in (plain, held))
    if without.size != with_hold.size:
        return False
    return better_share(without - with_hold) >= HELD_CERTAIN


def may_be_held(context: Context, chosen: Sequence[Term]) -> bool:
    """Whether the drive's recorded effort may be held, and nothing that was found is a delay itself."""
    late = any(t.effect.id in LATE for t in chosen)
    return context.drive != "position_servo" and context.load not in ("robot", "links") and not late
