"""Effects that the training runs chose and that are not believed: an objection to each, with its figures.

An objection is one small record a kind. `reason` is its word in report.json, which kinds may share;
`drake_tc.report.sentences.objections` makes the sentence.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

Withdrawal = Literal[
    "implausible",
    "below_resolution",
    "looks_like_known_load",
    "may_be_wander",
    "training_run_against",
    "heldout_run_against",
    "no_longer_needed",
    "superfluous",
    "worse_than_declared",
]
"""Why an effect that the search chose is not part of the model after."""


@dataclass(frozen=True)
class ImpossibleValues:
    """The effect's values break a law.

    Attributes:
        statement: Values, law and its source, a sentence of the effect library (`effects.plausibility.implausible`).
    """

    statement: str
    reason: ClassVar[Withdrawal] = "implausible"


@dataclass(frozen=True)
class CorrectsCurve:
    """A ripple that corrects the form of the curve over the position beside it.

    Attributes:
        periods: Of the ripple, that the positions span. coefficients: of the curve.
    """

    periods: float
    coefficients: int
    reason: ClassVar[Withdrawal] = "implausible"


@dataclass(frozen=True)
class NotSeenToRepeat:
    """A ripple that the positions do not span often enough.

    Attributes:
        periods: That they span. least: that they would have to. cycles_per_turn: of the ripple.
    """

    periods: float
    least: float
    cycles_per_turn: float
    reason: ClassVar[Withdrawal] = "implausible"


@dataclass(frozen=True)
class NoiseOfEffort:
    """A lag that explains hardly more than it does played backwards in time."""

    reason: ClassVar[Withdrawal] = "implausible"


@dataclass(frozen=True)
class BelowEncoderStep:
    """A correction of the encoder that is smaller than what the encoder resolves.

    Attributes:
        quantity: Name of what was compared. size: of it [rad]. step: that the encoder resolves [rad].
    """

    quantity: str
    size: float
    step: float
    reason: ClassVar[Withdrawal] = "below_resolution"


@dataclass(frozen=True)
class BelowLeastAmplitude:
    """A wave of the encoder's error that is smaller than the smallest one that the logs resolve.

    Attributes:
        amplitude: Of the wave [rad]. least: that the logs resolve [rad].
    """

    amplitude: float
    least: float
    reason: ClassVar[Withdrawal] = "below_resolution"


@dataclass(frozen=True)
class SizeMayBeZero:
    """An effect whose size may be anything, nothing included.

    Attributes:
        shape: Name of the parameter at its bound, or None. size: name of the effect's size. value: of it [unit].
        low, high: its 95 % interval, which holds 0. unit: of the size.
    """

    shape: str | None
    size: str
    value: float
    low: float
    high: float
    unit: str
    reason: ClassVar[Withdrawal] = "below_resolution"


@dataclass(frozen=True)
class SizesMayBeZero:
    """All sizes may be zero by the uncertainty of the links, and the effect lowers the held-out error by little.

    Attributes:
        gain: Relative drop of the held-out error.
    """

    gain: float
    reason: ClassVar[Withdrawal] = "below_resolution"


@dataclass(frozen=True)
class ReplacesInertia:
    """An effect beside which nothing is left of a declared rotor inertia, though the declared model fits with it.

    Attributes:
        inertia: Of the declared model [kg m^2]. floors: noise floors that the declared model leaves.
    """

    inertia: float
    floors: float
    reason: ClassVar[Withdrawal] = "implausible"


@dataclass(frozen=True)
class FormOfKnownLoad:
    """A curve over the position that has the form of the known load.

    Attributes:
        share: Of the curve's variance that the known load explains. zero: whether a wrong zero would look the same too.
    """

    share: float
    zero: bool
    reason: ClassVar[Withdrawal] = "looks_like_known_load"


@dataclass(frozen=True)
class LevelWithinWander:
    """A level that slow drift like that of the residual may have put there.

    Attributes:
        ratio: Of the level to what such drift adds to the mean of a run. least: that is asked for.
    """

    ratio: float
    least: float
    reason: ClassVar[Withdrawal] = "may_be_wander"


@dataclass(frozen=True)
class WithinJumps:
    """What a torque lacks at its jumps may be all that the effect explains, in noise floors of each row."""

    explains: float
    least: float
    reason: ClassVar[Withdrawal] = "below_resolution"


@dataclass(frozen=True)
class TrainingRunAgainst:
    """Fitted on the other training runs, the effect makes the error of this run larger."""

    run: str
    reason: ClassVar[Withdrawal] = "training_run_against"


@dataclass(frozen=True)
class LargerOnHeldOut:
    """The effect makes a held-out error larger.

    Attributes:
        run: Whose; None for all held-out runs together. growth: by which share.
    """

    run: str | None
    growth: float
    reason: ClassVar[Withdrawal] = "heldout_run_against"


@dataclass(frozen=True)
class UncertainOnHeldOut:
    """The effect lowers a held-out error, but not certainly.

    Attributes:
        run: Whose; None for all held-out runs together. gain: by which share.
        certain: Share of the block resamples in which it does. least: that is asked for.
    """

    run: str | None
    gain: float
    certain: float
    least: float
    reason: ClassVar[Withdrawal] = "heldout_run_against"


@dataclass(frozen=True)
class LittleGainAlone:
    """Without the effects that were withdrawn, the effect lowers the training error too little.

    Attributes:
        gain: Relative drop of the cross-validated error. least: that is asked for.
    """

    gain: float
    least: float
    reason: ClassVar[Withdrawal] = "no_longer_needed"


@dataclass(frozen=True)
class ExplainedByOthers:
    """An effect that was chosen before the others: beside them, the model without it fits as well.

    Attributes:
        gain: Relative drop of the cross-validated error. least: from which on a model fits better.
    """

    gain: float
    least: float
    reason: ClassVar[Withdrawal] = "superfluous"


@dataclass(frozen=True)
class NotFoundAgain:
    """Beside links that were fitted without the effects that did not hold, the search did not choose it again."""

    reason: ClassVar[Withdrawal] = "no_longer_needed"


@dataclass(frozen=True)
class LargerThanDeclared:
    """By one drive gain, the model with all effects leaves more than the declared one; this effect explains least.

    Attributes:
        part: Of the runs, or "mean absolute" of both. growth: of the error, as a share; the smaller one of both.
    """

    part: Literal["training", "held-out", "mean absolute"]
    growth: float
    reason: ClassVar[Withdrawal] = "worse_than_declared"


Objection = (
    ImpossibleValues
    | CorrectsCurve
    | NotSeenToRepeat
    | NoiseOfEffort
    | BelowEncoderStep
    | BelowLeastAmplitude
    | SizeMayBeZero
    | SizesMayBeZero
    | ReplacesInertia
    | FormOfKnownLoad
    | LevelWithinWander
    | WithinJumps
    | TrainingRunAgainst
    | LargerOnHeldOut
    | UncertainOnHeldOut
    | LittleGainAlone
    | ExplainedByOthers
    | NotFoundAgain
    | LargerThanDeclared
)


@dataclass(frozen=True)
class DidNotHold:
    """An effect that the training runs chose and that is not believed.

    Attributes:
        key, id, title: Of the effect. objection: why not, with its figures.
        heldout_gain: 1 - held-out error with it / without it; None where it was never part of the model.
    """

    key: str
    id: str
    title: str
    objection: Objection
    heldout_gain: float | None = None

    @property
    def reason(self) -> Withdrawal:
        """The objection as a word."""
        return self.objection.reason
