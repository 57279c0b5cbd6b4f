"""What a diagnosis may be told to do otherwise."""

from dataclasses import dataclass, field
from typing import Literal, get_args

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.thresholds import JOINT, ResidualThresholds, SearchThresholds
from drake_tc.effects.base import Effect
from drake_tc.effects.library import effect
from drake_tc.errors import ParamsError

Engine = Literal["rules", "evidence"]


@dataclass(frozen=True)
class DiagnosisOptions:
    """SearchThresholds of the search and of the assessment of what is left; `seed` for resampling.

    `assess_residual`: whether what is left is assessed at all, which costs more than all the rest; False calls nothing
    structured. `width_s`: width of the light kernel [s]; None lets the data choose. `effects`: what the search tries
    in place of the library; a result names effects by their id, so those that are not of the library are registered
    first (`drake_tc.register_effect`). `common`: terms that every joint's declared model has besides its own.
    `command_held`: whether position servos hold their commands, decided for all joints; None: each joint decides.
    `effort_age`: age of the efforts of all joints beyond that of held commands [sampling periods]; negative: they are
    recorded late. `without`: ids of effects that are not looked for.
    `engine`: "evidence" for the posterior odds of `diagnosis.search`. `robots`: engine of whole robots; None: the same.

    Raises:
        ParamsError: an effect that is neither of the library nor registered.
    """

    search: SearchThresholds = JOINT
    residual: ResidualThresholds = field(default_factory=ResidualThresholds)
    seed: int = 0
    assess_residual: bool = True
    width_s: float | None = None
    effects: tuple[Effect, ...] | None = None
    common: tuple[Term, ...] = ()
    command_held: bool | None = None
    effort_age: float = 0.0
    without: frozenset[str] = frozenset()
    engine: Engine = "rules"
    robots: Engine | None = None

    def __post_init__(self) -> None:
        for name, given in (("engine", self.engine), ("robots", self.robots or self.engine)):
            if given not in get_args(Engine):
                raise ParamsError(f"{name}: expected one of {', '.join(get_args(Engine))}, got {given!r}")
        for own in self.effects or ():
            if type(effect(own.key)) is not type(own):
                raise ParamsError(f"effects: the id {own.key!r} is taken by another effect; choose another id")
