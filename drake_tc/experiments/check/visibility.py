"""What logs show of one effect, and effects that cannot be looked for, by the reason."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from drake_tc.experiments.sizes import Size

Status = Literal["seen", "weakly", "not_seen", "not_separable"]
WEAK = 4.0
"""Smallest size over the typical size, up to which an effect is called weakly seen."""


@dataclass(frozen=True)
class Visibility:
    """What logs show of one effect.

    Attributes:
        key, id, title: Of the effect.
        status: At the typical size.
        size: What tells its strength.
        smallest: Size that is found in 95 % of such logs, whatever most of its other parameters are; infinite where
            none is.
        easiest: Size that is found in 5 % of such logs where its other parameters are the most favourable ones.
        not_separable_from: Ids of effects that fit as well.
        kept: Share of its contribution (RMS) that the rest of the model does not imitate; 0 where it cannot be
            computed.
        reason: Why it is not seen, or only weakly, in one sentence; empty where it is seen.
        separable: Size below which it is found but fits as well as `confused_below`; None where there is no such size.
        confused_below: Ids of these effects.
        obstacle: Why it cannot be looked for at all, without its full stop; empty where it can.
    """

    key: str
    id: str
    title: str
    status: Status
    size: Size
    smallest: float
    easiest: float
    not_separable_from: tuple[str, ...] = ()
    kept: float = 0.0
    reason: str = ""
    separable: float | None = None
    confused_below: tuple[str, ...] = ()
    obstacle: str = ""

    @property
    def why(self) -> str:
        """What the user should know of the verdict, in one sentence without its full stop; empty where nothing is."""
        if self.not_separable_from:
            return f"not separable from {', '.join(self.not_separable_from)}"
        if self.separable is not None:
            names = ", ".join(self.confused_below)
            below = f"below {self.separable:.3g} {self.size.unit}".removesuffix(" -")
            return f"{below} not separable from {names}" if not self.reason else self.reason
        return self.reason


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
