"""Effects that cannot be looked for, by the reason: many have the same one, and the joints of a robot share most."""

from collections.abc import Mapping, Sequence

from drake_tc.experiments.check.visibility import Visibility

Reasons = dict[str, tuple[str, ...]]
"""By reason, keys of effects."""


def by_reason(effects: Sequence[Visibility]) -> Reasons:
    """Effects of one joint that cannot be looked for, in the order of the library."""
    found: dict[str, list[str]] = {}
    for each in effects:
        if each.obstacle:
            found.setdefault(each.obstacle, []).append(each.key)
    return {reason: tuple(keys) for reason, keys in found.items()}


def shared_and_own(joints: Mapping[str, Sequence[Visibility]]) -> tuple[Reasons, dict[str, Reasons]]:
    """What no joint can show for the same reason, and what is left by joint. A single joint shares nothing.

    Args:
        joints: By joint, its effects.
    """
    each = {joint: by_reason(effects) for joint, effects in joints.items()}
    if len(each) < 2:
        return {}, each
    first, *others = each.values()
    shared = {reason: keys for reason, keys in first.items() if all(o.get(reason) == keys for o in others)}
    own = {joint: {r: k for r, k in reasons.items() if r not in shared} for joint, reasons in each.items()}
    return shared, own
