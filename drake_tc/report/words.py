"""The verdict as an engineer would say it."""

import re
from collections.abc import Sequence

import numpy as np

from drake_tc.config.joint_units import JointUnits
from drake_tc.diagnosis.priors import ALTERNATIVE, LEAST_FRACTION, MOST_GROWTH, NAMED_FLOORS
from drake_tc.diagnosis.residual.unexplained import BeyondTraining, Unexplained, Verdict
from drake_tc.diagnosis.result.joint_result import JointResult, RejectedEffect, Withdrawal
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.diagnosis.shared.causes import TITLES
from drake_tc.effects.library import all_effects
from drake_tc.effects.torque_sensor_bias import TorqueSensorBias
from drake_tc.report.numbers import percent, scale_for, significant, times
from drake_tc.report.plots.rows import LABELS
from drake_tc.report.plots.spectrum import Outside

VERDICTS: dict[Verdict, str] = {
    "effects_found": "Missing effect found",
    "no_missing_effect": "No missing effect found",
    "unexplained_structure": "Unexplained structure in the residual",
    "unexplained_residual": "Residual larger than the sensor noise",
    "cannot_tell": "These logs cannot tell",
}
WRONG_SET_UP = "Wrong set-up"
REASONS: dict[Withdrawal, tuple[str, str]] = {
    "noise_of_one_channel": (
        "explains the noise of one channel",
        "It is probable only if all noise is attributed to one channel. A lag that acts in the drive would be probable "
        "with the noise attributed to the effort and with the noise attributed to the load.",
    ),
    "worse_on_held_out": (
        "does not hold in the held-out runs",
        "With it, the model predicts the held-out runs worse than without it.",
    ),
    "below_floor": (
        "smaller than the noise",
        f"Its contribution to the effort is less than {NAMED_FLOORS:g} noise floors.",
    ),
}
"""In a few words, and as a sentence."""


def why_rejected(rejected: RejectedEffect) -> str:
    """Why an effect was not added, as one sentence without its full stop."""
    if rejected.reason != "too_little_evidence":
        return rejected.obstacle or "it would leave nothing of the effort"
    odds = f"{rejected.log_odds:+.1f}".replace("-", "−")
    return f"its log odds are {odds}, at least {ALTERNATIVE:+g} is required"


NEAR = 0.25
"""Smallest held-out gain at which the sentence on the remaining error names an effect that was not added."""
MOSTLY = 0.5
"""Share of the held-out error that effects leave, above which the report says that they may stand for another cause."""
NO_CAUSE = (
    "It does not depend on the recorded signals: possible causes are an unrecorded disturbance, a sensor that drifts, "
    "or an effect that needs another sensor"
)
NO_CAUSE_OF_AN_ARM = (
    "It does not depend on the recorded signals of this joint: possible causes are an unrecorded disturbance, a sensor "
    "that drifts, an effect that needs another sensor, a wrong drive gain of this or another joint (the links were "
    "fitted at the declared gains), or a load in some of the runs that the rig file does not declare (unknown_payload)"
)
GEAR = ("backlash", "elasticity")
"""Effects of the gear between the encoders, which not every drive shows."""
NO_FLOOR = "there is no noise floor, because the logs show neither noise nor steps of the sensors"


def joined(words: Sequence[str]) -> str:
    """Words as one phrase: "a", "a and b", "a, b and c"; empty for none."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def natural(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sorting key of a name in which numbers count by their value: run2 comes before run10."""
    return tuple((0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.findall(r"\d+|\D+", name))


def title_of(effect_id: str) -> str:
    """An effect's title by its id; the id itself, in words, when the library does not know it."""
    if effect_id in TITLES:
        return TITLES[effect_id]
    return next(
        (e.title for e in all_effects() if effect_id in (e.id, e.key)),
        effect_id.replace("_", " "),
    )


def signal_name(name: str) -> str:
    """A signal as people call it."""
    return LABELS[name][0].split(",")[0] if name in LABELS else name.replace("_", " ")


def signal_range(name: str, low: float, high: float, units: JointUnits, effort: str = "") -> str:
    """A signal's range with its unit, such as "24 to 59 °C"; `effort` is the unit of an effort."""
    scale = scale_for(max(abs(low), abs(high)), effort or units.text(LABELS[name][1]))
    return f"{scale.text(low)} to {scale.quantity(high)}"


def verdict_words(found: JointResult | CloseLoopResult) -> str:
    """The verdict on one joint, or on all joints of a rig."""
    if isinstance(found, JointResult):
        wrong, named = found.set_up_wrong, len(found.effects)
    else:
        wrong, named = found.has_wrong_set_up, len(found.shared) + sum(len(j.effects) for j in found.joints.values())
    if wrong:
        return WRONG_SET_UP
    return "Missing effects found" if found.verdict == "effects_found" and named > 1 else VERDICTS[found.verdict]


def floors_left(joint: JointResult) -> float:
    """Held-out error in noise floors, also where what is left was not assessed."""
    assessed = joint.unexplained.floors > 0.0 or joint.noise_floor <= 0.0
    return joint.unexplained.floors if assessed else joint.after.heldout / joint.noise_floor


def headline(joint: JointResult) -> str:
    """One or two sentences: what was missing, what it did to the held-out error, what that leaves."""
    before, after, floor = joint.before.heldout, joint.after.heldout, joint.noise_floor
    scale = scale_for(max((e for e in (before, after) if np.isfinite(e)), default=0.0), joint.unit)
    names = joined([e.title for e in joint.effects])
    above = f"{significant(after / floor)} times the noise floor" if floor > 0.0 else f"and {NO_FLOOR}"
    left = "" if joint.verdict in ("no_missing_effect", "effects_found") else unexplained(joint)
    change = (
        f"the held-out error goes from {scale.quantity(before)} to {scale.quantity(after)} ({times(before, after)})"
    )
    if not (left and joint.unexplained.excess and not joint.unexplained.structured):  # which states the distance
        change += f", {above}"
    if joint.set_up_wrong:
        return (
            "No effects were looked for, because the set-up of the robot is wrong. The held-out error is "
            f"{scale.quantity(after)}, {above}."
        )
    if joint.verdict == "no_missing_effect" and floor <= 0.0:
        error = scale.quantity(after)
        return f"The declared model explains the data: its held-out error is {error}. {capital(NO_FLOOR)}."
    if joint.verdict == "no_missing_effect":
        return f"The declared model explains the data: its held-out error of {scale.quantity(after)} is {above}."
    one = len(joint.effects) == 1
    if mostly_unexplained(joint):
        fits = "fits" if one else "fit"
        return (
            f"The cause of most of the error was not found. Of the effects in the library, {names} {fits} best: with "
            f"{'it' if one else 'them'}, {change}. {capital(left)}"
        )
    found = f"Missing in the model: {names}. With {'it' if one else 'them'}, {change}." if joint.effects else ""
    if joint.verdict == "effects_found":
        return found
    if found:
        return f"{found} However, {left}"
    return f"No effect of the library was added. {capital(left)}"


def capital(sentence: str) -> str:
    """The sentence with a capital first letter."""
    return sentence[:1].upper() + sentence[1:]


def structure_words(left: Unexplained) -> str:
    """Whether what is left has structure."""
    if left.structured:
        return "yes"
    return (
        "no: recorded signals predict part of it, but this part is too small to count" if _is_function(left) else "no"
    )


def dependence_words(left: Unexplained) -> str:
    """The signals on which what is left depends."""
    if not left.depends_on and _is_function(left):
        return "not determined"
    return joined([signal_name(n) for n in left.depends_on]) or "no recorded signal"


def correlation_words(outside: Sequence[Outside], left: Unexplained) -> str:
    """Why a residual that is correlated may have no structure; "" where it has, or where no correlation is left."""
    if left.structured or not outside:
        return ""
    told = (
        (o.title, significant(o.value, 2), f"at a lag of {significant(o.lag, 2)} s, band ±{significant(o.band, 2)}")
        for o in outside
    )
    names = joined([f"{title} ({value} {where})" for title, value, where in told])
    return (
        f"The residual of the model after is correlated with {names}. It still counts as without structure: what the "
        f"recorded signals predict of it ({percent(max(left.fraction, 0.0))} of its variance) is too small to count, "
        "and it stands out at no frequency and in no stretch of time."
    )


def _is_function(left: Unexplained) -> bool:
    """Whether a function of the signals explains so large a share that only its small size keeps it from counting."""
    return left.fraction >= LEAST_FRACTION


def remainder_sentence(joint: JointResult) -> str:
    """Share of the held-out error that the remainder explains; "" if none was fitted or the share is not certain."""
    found = joint.remainder
    if found is None or not found.holds:
        return ""
    low, high = (percent(end) for end in found.model.share_ci95)
    return (
        f"A smooth function of position, velocity and load torque explains {percent(found.model.share)} of the squared"
        f" error on the held-out runs (95 % interval {low} to {high}). model_after.yaml has it as the joint's"
        " `remainder`."
    )


def unexplained(joint: JointResult) -> str:
    """What is left in the residual, in one sentence that can follow "However,"."""
    left = joint.unexplained
    if left.structured and left.beyond is not None:
        return _extrapolated(left.beyond, joint.units) + "."
    parts = []
    if not left.structured and left.excess:
        elsewhere = ""
        if left.floors_anywhere > 1.2 * left.floors:
            several = len(joint.heldout.samples.runs) > 1
            where = "the training runs or on one of the held-out runs" if several else "the training runs"
            elsewhere = f" ({significant(left.floors_anywhere, 2)} times on {where})"
        causes = NO_CAUSE_OF_AN_ARM if joint.links_fitted else NO_CAUSE
        if _is_function(left):
            causes = (
                f"Recorded signals predict {percent(left.fraction)} of its variance, but this part is too small to "
                "count as structure"
            )
        if left.beyond is not None:
            causes = capital(_extrapolated(left.beyond, joint.units))
        return (
            f"the remaining error on the held-out runs is {significant(left.floors, 2)} times the noise floor"
            f"{elsewhere} and {percent(left.share_of_signal)} of the effort's RMS. {causes}."
            f"{_gear_not_looked_for(joint)}"
        )
    if left.depends_on and left.fraction > 0.0 and any(name != "time" for name in left.depends_on):
        names = joined([signal_name(n) for n in left.depends_on])
        parts.append(f"{percent(left.fraction)} of the remaining error can be predicted from {names}{_near(joint)}")
    if left.confined_to:
        where = joined([f"{s.run} from {s.start:.1f} to {s.end:.1f} s" for s in left.confined_to[:3]])
        more = len(left.confined_to) - 3
        parts.append(
            f"most of the remaining error lies in {where}" + (f" and {more} more stretches" if more > 0 else "")
        )
    if left.period_hz is not None:
        parts.append(f"the remaining error repeats at {significant(left.period_hz)} Hz")
    growth = joint.after.heldout / max(joint.after.train, 1e-300)
    if growth <= MOST_GROWTH:
        return (joined(parts) or "the remaining error is larger on the held-out runs than on the training runs") + "."
    other = (
        f"the remaining error is {significant(growth, 2)} times as large on the held-out runs as on the training runs, "
        "as if they were recorded under other conditions, for example with another load."
    )
    return f"{other} {capital(joined(parts))}." if parts else other


def _gear_not_looked_for(joint: JointResult) -> str:
    """That play and elasticity of the gear may be the cause, where this joint's drive does not show them."""
    hidden = [each.id for each in joint.rejected if each.id in GEAR and each.reason == "cannot_be_looked_for"]
    if set(hidden) != set(GEAR):
        return ""
    return " Backlash and elasticity of the gear are possible causes too, but cannot be looked for with these logs."


def _near(joint: JointResult) -> str:
    tried = [each for each in joint.rejected if each.reason == "too_little_evidence"]
    best = max(tried, key=lambda each: each.heldout_gain, default=None)
    if best is None or not best.heldout_gain >= NEAR:
        return f", and no effect that could be looked for has this form{_unseen(joint)}"
    return (
        f"; of the effects that were not added, {title_of(best.id)} would lower the held-out error most (by "
        f"{percent(best.heldout_gain)})"
    )


def _unseen(joint: JointResult) -> str:
    """The effects that may act although the logs cannot show them, as the end of a sentence.

    Those lack a signal, or are of the gear behind which no torque is measured. Other effects that cannot be looked for
    do not concern this drive, or the fitted load already has their form.
    """
    reasons = {each.id: each.reason for each in joint.rejected}
    no_torque = reasons.get(TorqueSensorBias.id) == "cannot_be_looked_for"
    gear = GEAR if no_torque else ()
    names = [
        title_of(name)
        for name, reason in reasons.items()
        if reason == "not_recorded" or (reason == "cannot_be_looked_for" and name in gear)
    ]
    return f"; {joined(names)} could not be looked for" if names else ""


def _extrapolated(beyond: BeyondTraining, units: JointUnits) -> str:
    trained = signal_range(beyond.signal, *beyond.trained, units, beyond.unit)
    return (
        f"{percent(beyond.share)} of the remaining error lies where the {signal_name(beyond.signal)} is outside the "
        f"range of the training runs ({trained}), so the model is extrapolated there"
    )


def band_sentence(joint: JointResult) -> str:
    """Up to which frequency the model explains the effort, and what is left below it."""
    band = joint.shared_band
    if band is None:
        return "the whole band of the filters"
    if band.limit_hz == 0.0:
        return "none: the model explains less than half of the effort's power even below 0.5 Hz"
    left = scale_for(band.heldout, joint.unit).quantity(band.heldout)
    torque = scale_for(band.heldout / joint.final.gain, joint.units.torque).quantity(band.heldout / joint.final.gain)
    return f"up to {significant(band.limit_hz)} Hz, where {left} ({torque}) is left on the held-out runs"


def ranked_effects(result: CloseLoopResult) -> Sequence[tuple[str, str, float]]:
    """Effects of a robot, shared or one joint's own, largest gain first.

    Returns:
        (id, joint or link or sensor, held-out gain of all joints) of each.
    """
    found = [(c.id, c.where, c.heldout_gain) for c in result.shared]
    for joint in result.joints.values():
        found += [(e.id, joint.joint, e.heldout_gain if e.robot_gain is None else e.robot_gain) for e in joint.effects]
    return sorted(found, key=lambda each: -each[2])


def mostly_unexplained(joint: JointResult) -> bool:
    """Whether the effects found leave more than noise, and most of the held-out error, within the trained range."""
    before, after = joint.before.heldout, joint.after.heldout
    unsure = joint.verdict in ("unexplained_structure", "unexplained_residual") and joint.unexplained.beyond is None
    return bool(joint.effects) and unsure and MOSTLY * before < after <= before
