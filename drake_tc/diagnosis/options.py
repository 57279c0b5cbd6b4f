"""What a diagnosis may be told to do otherwise."""

from dataclasses import dataclass

from drake_tc.effects.base import Effect
from drake_tc.effects.library import effect
from drake_tc.errors import ParamsError


@dataclass(frozen=True)
class DiagnosisOptions:
    """What a diagnosis may be told to do otherwise.

    Attributes:
        seed: Of the folds of the assessment of what is left.
        assess_residual: Whether what is left is assessed at all, which costs more than all the rest; False calls
            nothing structured.
        effects: What the search tries in place of the library. A result names effects by their id, so those that are
            not of the library are registered first (`drake_tc.register_effect`).
        command_held: Whether position servos hold their commands, decided for all joints; None: each joint decides.

    Raises:
        ParamsError: an effect that is neither of the library nor registered.
    """

    seed: int = 0
    assess_residual: bool = True
    effects: tuple[Effect, ...] | None = None
    command_held: bool | None = None

    def __post_init__(self) -> None:
        for own in self.effects or ():
            if type(effect(own.key)) is not type(own):
                raise ParamsError(f"effects: the id {own.key!r} is taken by another effect; choose another id")
