"""What the refinement on free runs did, as a reader sees it: one sentence, errors by run, and the changed numbers."""

from dataclasses import dataclass

from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.refinement import Refinement, RefinementStatus
from drake_tc.diagnosis.result.refinement_json import MODEL_FILE, MODELS, position_errors
from drake_tc.report.numbers import pretty_unit, scale_for, significant

KEPT: dict[RefinementStatus, str] = {
    "accepted": "",
    "no_gain": "the free runs do not improve by 5 %",
    "implausible": "the refined values are not physically possible",
    "resolved": "the free runs already follow as well as the encoder resolves",
    "nothing_to_simulate": "the joint cannot be simulated from these logs",
    "nothing_to_refine": "no number of the model was estimated",
}


@dataclass(frozen=True)
class RefinementSection:
    """Text of the section.

    Attributes:
        sentence: What came of it.
        runs: (run, mean absolute and RMS position error before, after, refined) of the held-out runs.
        parameters: (effect, parameter, equation error's value, output error's value, unit, at a bound).
        balance: Sentence on the equation error under the refined numbers; "" where it is not known.
    """

    sentence: str
    runs: tuple[tuple[str, ...], ...]
    parameters: tuple[tuple[str, str, str, str, str, bool], ...]
    balance: str


def refinement_sentence(refinement: Refinement) -> str:
    """What came of the output error, in one or two sentences."""
    train, left_out = (_fall(pair) for pair in (refinement.train, refinement.cross_validated))
    runs = f" on the training runs, {left_out} on the runs left out in turn" if left_out else " on the training runs"
    if refinement.accepted:
        return f"Output error: {MODEL_FILE} has free runs that follow better, {train} mean absolute{runs}."
    why = f" ({refinement.why.rstrip('.')})" if refinement.why else ""
    if refinement.status == "no_gain":
        why = f" ({left_out} mean absolute on the runs left out in turn)" if left_out else f" ({train} mean absolute)"
    return f"Output error: the model after stays, as {KEPT[refinement.status]}{why}."


def _fall(pair: tuple[float, float] | None) -> str:
    """`20 mrad → 5 mrad`: with the model after, and refined."""
    return "" if pair is None else " → ".join(scale_for(value, "rad").quantity(value) for value in pair)


def refinement_section(joint: JointResult) -> RefinementSection | None:
    """The section of one joint; None where no free run was asked for."""
    found = joint.refinement
    if found is None:
        return None
    parameters = tuple(
        (
            p.key,
            p.name.replace("_", " "),
            significant(p.equation_error, 4),
            significant(p.output_error, 4),
            pretty_unit(p.unit),
            p.at_bound,
        )
        for p in found.parameters
    )
    return RefinementSection(refinement_sentence(found), _runs(joint), parameters, _balance(joint, found))


def _runs(joint: JointResult) -> tuple[tuple[str, ...], ...]:
    rows = []
    for run, trace in joint.free_run.items():
        cells = [run]
        for which in (1, 0):
            for name in MODELS:
                errors = position_errors(trace, name)
                cells.append("–" if errors is None else scale_for(errors[which], "rad").quantity(errors[which]))
        rows.append(tuple(cells))
    return tuple(rows)


def _balance(joint: JointResult, found: Refinement) -> str:
    if found.error_heldout is None:
        return ""
    after, refined = joint.after.heldout, found.error_heldout
    scale = scale_for(after, joint.unit)
    return (
        f"Equation error on the held-out runs: {scale.quantity(after)} with the model after, {scale.quantity(refined)} "
        "with the refined numbers. The verdict, the effects and their intervals are those of the equation error."
    )
