"""Why an effect cannot be looked for in some logs."""

from dataclasses import dataclass
from typing import Literal

ObstacleReason = Literal["cannot_be_looked_for", "not_recorded", "not_excited"]


@dataclass(frozen=True)
class Obstacle:
    """What stands in the way.

    Attributes:
        reason: "not_recorded", the logs lack a signal; "not_excited", what they recorded changes too little; or
            "cannot_be_looked_for", this kind of drive or load, or what the rig file declares, does not allow it.
        statement: The same in a few words of the effect's own.
    """

    reason: ObstacleReason
    statement: str
