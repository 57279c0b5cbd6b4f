"""What a diagnosis may be told to do otherwise."""

from dataclasses import dataclass, field

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.thresholds import ResidualThresholds
from drake_tc.effects.base import Effect
from drake_tc.effects.library import effect
from drake_tc.errors import ParamsError


@dataclass(frozen=True)
class DiagnosisOptions:
    """Thresholds of the assessment of what is left; `seed` for resampling.

    `assess_residual`: whether what is left is assessed at all, which costs more than all the rest; False calls nothing
    structured. `width_s`: width of the light kernel [s]; None lets the data choose. `effects`: what the search tries
    in place of the library; a result names effects by their id, so those that are not of the library are registered
    first (`drake_tc.register_effect`). `common`: terms that every joint's declared model has besides its own.
    `command_held`: whether position servos hold their commands, decided for all joints; None: each joint decides.
    `effort_age`: age of the efforts of all joints beyond that of held commands [sampling periods]; negative: they are
    recorded late. `without`: ids of effects that are not looked for.

    Raises:
        ParamsError: an effect that is neither of the library nor registered.
    """

    residual: ResidualThresholds = field(default_factory=ResidualThresholds)
    seed: int = 0
    assess_residual: bool = True
    width_s: float | None = None
    effects: tuple[Effect, ...] | None = None
    common: tuple[Term, ...] = ()
    command_held: bool | None = None
    effort_age: float = 0.0
    without: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        for own in self.effects or ():
            if type(effect(own.key)) is not type(own):
                raise ParamsError(f"effects: the id {own.key!r} is taken by another effect; choose another id")
