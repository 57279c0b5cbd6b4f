"""Effects that the training runs chose and that are not part of the model after."""

from dataclasses import dataclass
from typing import Literal

Withdrawal = Literal["noise_of_one_channel", "worse_on_held_out", "below_floor"]
"""Why: only the noise of one channel asks for it; it lowers the predictive density of the held-out runs; it contributes
less than `priors.NAMED_FLOORS` noise floors."""


@dataclass(frozen=True)
class DidNotHold:
    """An effect that the training runs chose and that is not believed.

    Attributes:
        key, id, title: Of the effect. reason: why not.
    """

    key: str
    id: str
    title: str
    reason: Withdrawal
