"""What the refinement on free runs did to a joint's model; plain data."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from drake_tc.actuation.model import ActuatorModel

RefinementStatus = Literal[
    "accepted", "no_gain", "worse_held_out", "implausible", "resolved", "nothing_to_simulate", "nothing_to_refine"
]
"""Why the refined model stands or does not, as a word."""


@dataclass(frozen=True)
class RefinedParameter:
    """One number before and after: effect key ("drive" for the gain), name, unit, and whether it rests on a bound."""

    key: str
    name: str
    unit: str
    equation_error: float
    output_error: float
    at_bound: bool


@dataclass(frozen=True)
class Refinement:
    """Output error on the training runs.

    Attributes:
        status: Accepted, or why not.
        why: For "implausible", the effect library's own sentence on values, law and source; "" otherwise.
        model: The refined model; None unless accepted.
        parameters: Numbers that the search was free to change; empty where there was no search.
        train: (model after, refined) mean absolute position error of the free runs of the training runs [rad].
        cross_validated: The same on stretches of runs that were left out in turn.
        error_train, error_heldout: RMS of the model equation under the refined numbers [effort], with the drive gain of
            the model after; None where it cannot be computed.
        free_run_heldout: RMS of the position error of its free runs on the held-out runs [rad]; None without any.
    """

    status: RefinementStatus
    why: str = ""
    model: ActuatorModel | None = None
    parameters: tuple[RefinedParameter, ...] = ()
    train: tuple[float, float] | None = None
    cross_validated: tuple[float, float] | None = None
    error_train: float | None = None
    error_heldout: float | None = None
    free_run_heldout: float | None = None

    @property
    def accepted(self) -> bool:
        """Whether there is a refined model."""
        return self.model is not None


def named_values(model: ActuatorModel) -> Mapping[str, Mapping[str, float]]:
    """Numbers by effect key, with the gain of the drive under "drive"."""
    return {"drive": {"gain": model.drive.gain}, **{v.key: dict(v.parameters) for v in model.effects}}
