"""A joint's diagnosis that is repeated among the effects which an earlier one confirmed."""

from dataclasses import replace

from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.selection.withdrawal import DidNotHold, NotFoundAgain
from drake_tc.effects.base import Effect


def confirmed_effects(result: JointResult) -> tuple[Effect, ...]:
    """The effects of the final model that the declared one lacks."""
    keys = {effect.key for effect in result.effects}
    return tuple(t.effect for t in result.final.terms if t.effect.key in keys)


def with_first(first: JointResult, again: JointResult) -> JointResult:
    """The repeated diagnosis with what only the first one knows: the effects that were tried and not added.

    Args:
        first: Among all effects of the library.
        again: Among those that the first one confirmed.
    """
    kept = {effect.key for effect in again.effects}
    ids = {effect.id for effect in again.effects}
    told = {each.key for each in again.did_not_hold}
    gone = tuple(
        DidNotHold(each.key, each.id, each.title, NotFoundAgain(), each.heldout_gain)
        for each in first.effects
        if each.key not in kept | told
    )
    pairs = tuple(pair for pair in first.indistinguishable if pair[0] in ids)
    return replace(
        again,
        rejected=first.rejected,
        indistinguishable=pairs,
        next_experiment=first.next_experiment if pairs == first.indistinguishable else again.next_experiment,
        did_not_hold=(*first.did_not_hold, *again.did_not_hold, *gone),
    )
