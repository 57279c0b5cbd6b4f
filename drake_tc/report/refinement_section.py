"""What the refinement on free runs did, as a reader sees it: one sentence, and the changed numbers."""

from dataclasses import dataclass

from drake_tc.config.joint_units import TURNING, JointUnits
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.models import MODEL_FILE
from drake_tc.diagnosis.result.refinement import Refinement, RefinementStatus
from drake_tc.report.numbers import pretty_unit, scale_for, significant
from drake_tc.report.words import title_of

WHY_NOT: dict[RefinementStatus, str] = {
    "accepted": "",
    "no_gain": "the free runs do not improve by at least 5 %",
    "worse_held_out": "the free runs of the held-out runs are less accurate with it",
    "implausible": "the refined values are not physically possible",
    "resolved": "the free runs already follow the position as closely as the encoder resolves it",
    "nothing_to_simulate": "the joint cannot be simulated from these logs",
    "nothing_to_refine": "no parameter of the model was estimated",
}


@dataclass(frozen=True)
class RefinementSection:
    """Text of the section.

    Attributes:
        sentence: What came of it.
        parameters: (effect, parameter, equation error's value, output error's value, unit, at a bound).
        balance: Sentence on the equation error under the refined numbers; "" where it is not known.
    """

    sentence: str
    parameters: tuple[tuple[str, str, str, str, str, bool], ...]
    balance: str


def refinement_sentence(refinement: Refinement, units: JointUnits = TURNING) -> str:
    """What came of the output error, in one or two sentences."""
    train, left_out = (_fall(pair, units) for pair in (refinement.train, refinement.cross_validated))
    runs = f" on the training runs, {left_out} on the runs left out in turn" if left_out else " on the training runs"
    if refinement.accepted:
        return f"Output error: {MODEL_FILE} follows the recorded position better; mean absolute error {train}{runs}."
    why = f" ({refinement.why.rstrip('.')})" if refinement.why else ""
    if refinement.status == "no_gain":
        where = f"{left_out} on the runs left out in turn" if left_out else train
        why = f" (mean absolute error {where})"
    return f"Output error: there is no refined model, because {WHY_NOT[refinement.status]}{why}."


def _fall(pair: tuple[float, float] | None, units: JointUnits) -> str:
    """`20 mrad → 5 mrad`: with the model after, and refined."""
    if pair is None:
        return ""
    scale = scale_for(max(pair), units.position)
    return " → ".join(scale.quantity(value) for value in pair)


def refinement_section(joint: JointResult) -> RefinementSection | None:
    """The section of one joint; None where no free run was requested."""
    found = joint.refinement
    if found is None:
        return None
    parameters = tuple(
        (
            title_of(p.key),
            p.name.replace("_", " "),
            significant(p.equation_error, 4),
            significant(p.output_error, 4),
            pretty_unit(p.unit),
            p.at_bound,
        )
        for p in found.parameters
    )
    return RefinementSection(refinement_sentence(found, joint.units), parameters, _balance(joint, found))


def _balance(joint: JointResult, found: Refinement) -> str:
    if found.error_heldout is None:
        return ""
    after, refined = joint.after.heldout, found.error_heldout
    scale = scale_for(after, joint.unit)
    return (
        f"Equation error on the held-out runs: {scale.quantity(after)} with the model after, {scale.quantity(refined)} "
        "with the refined numbers. The verdict, the effects and their intervals are those of the equation error."
    )
