"""Effects that the training runs chose and that are not believed."""

from dataclasses import dataclass
from typing import Literal

Withdrawal = Literal[
    "implausible",
    "below_resolution",
    "looks_like_known_load",
    "may_be_wander",
    "training_run_against",
    "heldout_run_against",
    "no_longer_needed",
    "worse_than_declared",
]
"""Why an effect that the search chose is not part of the model after."""


@dataclass(frozen=True)
class DidNotHold:
    """An effect that the training runs chose and that is not believed.

    Attributes:
        key, id, title: Of the effect. reason: as a word. why: one sentence with figures.
        heldout_gain: 1 - held-out error with it / without it; None where it was never part of the model.
    """

    key: str
    id: str
    title: str
    reason: Withdrawal
    why: str
    heldout_gain: float | None = None
