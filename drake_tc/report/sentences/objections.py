"""Why an effect that the training runs chose did not hold, as a sentence.

Why an effect was not added, as a sentence.
"""

from typing import assert_never

from drake_tc.config.joint_units import TURNING, JointUnits
from drake_tc.diagnosis.result.joint_result import RejectedEffect
from drake_tc.diagnosis.selection.withdrawal import (
    BelowEncoderStep,
    BelowLeastAmplitude,
    CorrectsCurve,
    ExplainedByOthers,
    FormOfKnownLoad,
    ImpossibleValues,
    LargerOnHeldOut,
    LargerThanDeclared,
    LevelWithinWander,
    LittleGainAlone,
    NoiseOfEffort,
    NotFoundAgain,
    NotSeenToRepeat,
    Objection,
    ReplacesInertia,
    SizeMayBeZero,
    SizesMayBeZero,
    TrainingRunAgainst,
    UncertainOnHeldOut,
    WithinJumps,
)

_OfValues = (
    ImpossibleValues
    | CorrectsCurve
    | NotSeenToRepeat
    | NoiseOfEffort
    | BelowEncoderStep
    | BelowLeastAmplitude
    | SizeMayBeZero
    | SizesMayBeZero
    | ReplacesInertia
)


def why_withdrawn(objection: Objection, units: JointUnits = TURNING) -> str:
    """One or two sentences, in the units of the joint."""
    return units.text(_why(objection))


def _why(objection: Objection) -> str:
    match objection:
        case FormOfKnownLoad(share, zero):
            return (
                f"{100 * share:.0f} % of what it explains has the form of the known load: a wrong scale"
                f"{' or zero' if zero else ''} of that load, of the inertia or of the drive would look the same."
            )
        case LevelWithinWander(ratio, least):
            return (
                f"It mainly adds a constant to each training run. The constant is {ratio:.2g} times what slow drift, "
                f"like that of the residual, can add to the mean of a run; at least {least:g} times are required."
            )
        case WithinJumps(explains, least):
            return (
                "The torque was sampled on a slower clock than the log, so the instants of its jumps are uncertain. "
                f"Beyond what this leaves, it explains {explains:.2g} noise floors; at least {least:g} are required."
            )
        case TrainingRunAgainst(run):
            return f"Fitted on the other training runs, it makes the error of {run} larger."
        case LargerOnHeldOut(run, growth):
            where = "all held-out runs together" if run is None else run
            error = "error" if run is None else "held-out error"
            return f"It makes the {error} of {where} larger, by {100 * growth:.2g} %."
        case UncertainOnHeldOut(run, gain, certain, least):
            return (
                f"It lowers the held-out error{'' if run is None else f' of {run}'} by {100 * gain:.1f} %, but in "
                f"{100 * certain:.0f} % of the block resamples only; {100 * least:g} % are required."
            )
        case LittleGainAlone(gain, least):
            return (
                "Without the withdrawn effects, it lowers the cross-validated training error by "
                f"{100 * max(gain, 0.0):.1f} %, less than the {100 * least:g} % that are required."
            )
        case ExplainedByOthers(gain, least):
            return (
                "Beside the other effects, it lowers the cross-validated training error by "
                f"{100 * max(gain, 0.0):.1f} %, less than the {100 * least:g} % from which on a model counts as better."
            )
        case NotFoundAgain():
            return (
                "Beside links that were fitted without the effects that did not hold, the search does not find it "
                "again."
            )
        case LargerThanDeclared(part, growth):
            return (
                f"With the same drive gain in both models, the {part} error of the model with all effects is "
                f"{100 * growth:.1f} % larger than that of the declared model."
            )
        case _:
            return _of_values(objection)


def _of_values(objection: _OfValues) -> str:
    """Against the values themselves, whatever they explain."""
    match objection:
        case ImpossibleValues(statement):
            return statement
        case CorrectsCurve(periods, coefficients):
            return (
                f"The positions span {periods:.3g} periods of it. The curve over the position beside it has "
                f"{coefficients} coefficients and takes the form of waves of up to {coefficients / 2:g} periods: the "
                "ripple corrects its form."
            )
        case NotSeenToRepeat(periods, least, cycles):
            return (
                f"The positions span {periods:.3g} periods of a ripple of {cycles:.3g} cycles a turn, fewer than "
                f"{least:g}: it was not seen to repeat, so it is a load curve over the position."
            )
        case NoiseOfEffort():
            return (
                "Played backwards in time, the same filter explains almost as much: the effort is noisy, or answers a "
                "torque that no column records."
            )
        case BelowEncoderStep(quantity, size, step):
            return f"{quantity} is {size:.2g} rad; the encoder resolves {step:.2g} rad."
        case BelowLeastAmplitude(amplitude, least):
            return f"amplitude is {amplitude:.2g} rad; these logs resolve {least:.2g} rad."
        case SizeMayBeZero(shape, size, value, low, high, unit):
            where = "" if shape is None else f"{shape} is at its bound, and there "
            return (
                f"{where}{size} is not certain to differ from 0: {value:.3g} {unit}, 95 % interval {low:.3g} to "
                f"{high:.3g}."
            )
        case SizesMayBeZero(gain):
            return (
                "With the uncertainty of the links, its sizes are not certain to differ from 0, and it lowers "
                f"the held-out error by {100 * gain:.1f} % only."
            )
        case ReplacesInertia(inertia, floors):
            return (
                f"Beside it hardly anything is left of the declared rotor inertia. With {inertia:.3g} kg*m^2, the "
                f"declared model leaves {floors:.2g} noise floors: the effect only takes the place of the inertia."
            )
        case _:
            assert_never(objection)


NO_GAIN = 5e-4
"""Cross-validated gain below which an effect is said not to lower the error at all."""


def why_rejected(rejected: RejectedEffect) -> str:
    """One sentence without its full stop."""
    match rejected.reason:
        case "cannot_be_looked_for" | "not_recorded" | "not_excited":
            return rejected.obstacle
        case "too_little_gain" if rejected.train_gain < NO_GAIN:
            return "it does not lower the cross-validated error"
        case "too_little_gain":
            gain, least = 100 * rejected.train_gain, 100 * rejected.least_gain
            return f"it lowers the cross-validated error by {gain:.1f} %, less than {least:g} %"
        case "unstable":
            return f"it helps in only {100 * rejected.share:.0f} % of the resamples"
        case "untested":
            return "untested: the held-out runs ask for more effort than the training runs ever did"
        case "below_floor":
            return "it explains less than the sensors resolve"
        case "too_little_evidence":
            return "the logs hold too few independent samples to tell it from chance"
        case "imperfect_form":
            return "what it explains is small beside the chosen effects, and is more likely an error in their form"
        case "withdrawn":
            return "the search chose it, but it did not hold; the reason is listed among the effects that did not hold"
        case "not_chosen":
            return (
                "beside the chosen effects it passes the thresholds, but the search, which compares whole sets of "
                "effects, took the other ones"
            )
        case _:
            assert_never(rejected.reason)
