"""Effects of a joint whose sizes may all be zero once it counts that the links are not known."""

from collections.abc import Mapping
from dataclasses import replace

from drake_tc.diagnosis.result.joint_result import FoundEffect, JointResult
from drake_tc.diagnosis.selection.withdrawal import DidNotHold, SizesMayBeZero
from drake_tc.effects.library import effect

LEAST_HELDOUT_GAIN = 0.05
"""Relative drop of the held-out error from which on an effect is believed whatever its intervals are: two sizes can be
uncertain although they cannot both be zero."""


def without_uncertain_sizes(
    made: Mapping[str, JointResult], widened: Mapping[str, JointResult]
) -> dict[str, JointResult] | None:
    """The joints' results without such effects, which they list as withdrawn; None where there is none.

    Args:
        made: By joint, its diagnosis on loads at one estimate of the links.
        widened: The same with intervals that know how uncertain this estimate is.
    """
    uncertain = {joint: [each for each in result.effects if _may_be_zero(each)] for joint, result in widened.items()}
    if not any(uncertain.values()):
        return None
    return {joint: _without(result, uncertain[joint]) for joint, result in made.items()}


def _may_be_zero(found: FoundEffect) -> bool:
    member = effect(found.key)
    shapes = {p.name for p in (*member.shapes, *member.given_shapes)}
    sizes = [value for name, value in found.parameters.items() if name not in shapes]
    in_doubt = all(value.ci95[0] <= 0.0 <= value.ci95[1] for value in sizes)
    return bool(sizes) and in_doubt and found.heldout_gain < LEAST_HELDOUT_GAIN


def _without(result: JointResult, gone: list[FoundEffect]) -> JointResult:
    objections = tuple(
        DidNotHold(each.key, each.id, each.title, SizesMayBeZero(each.heldout_gain), each.heldout_gain) for each in gone
    )
    kept = tuple(each for each in result.effects if each.key not in {other.key for other in gone})
    return replace(result, effects=kept, did_not_hold=(*result.did_not_hold, *objections))
