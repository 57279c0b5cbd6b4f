"""What the reader of a joint's result must not overlook."""

from collections.abc import Sequence

import numpy as np

from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.models import MODEL_FILE
from drake_tc.report.numbers import percent, pretty_unit, significant
from drake_tc.report.words import capital, mostly_unexplained, title_of

LARGER = 1.02
"""Ratio of two position errors from which on the first one is called larger."""


def warnings(joint: JointResult) -> Sequence[str]:
    """What the reader must not overlook, one sentence each."""
    out = [
        f"These logs cannot tell {title_of(a)} from {title_of(b)}; both fit equally well."
        for a, b in joint.indistinguishable
    ]
    for key, group in joint.final_parameters.items():
        out += [
            f"{capital(title_of(key))}: the parameter {name.replace('_', ' ')} lies at a bound of its range, so its "
            "95 % interval is not valid."
            for name, estimate in group.items()
            if estimate.at_bound
        ]
    if not joint.gain_identified:
        gain = joint.final_parameters["drive"]["gain"]
        out.append(
            f"These logs do not identify the drive gain: its 95 % interval reaches from {significant(gain.ci95[0])} "
            f"to {significant(gain.ci95[1])} {pretty_unit(gain.unit)}."
        )
    if joint.effects and joint.after.heldout > joint.before.heldout:
        out.append("The held-out error did not fall: do not use the model after without looking at the plots.")
    if mostly_unexplained(joint):
        share = percent(joint.after.heldout / joint.before.heldout)
        out.append(
            f"With the effects found, {share} of the held-out error is left. While so much is unexplained, an effect "
            "may imitate the missing cause: confirm its kind and its parameters by another experiment."
        )
    before, after = joint.before.free_run_heldout, joint.after.free_run_heldout
    changed = bool(joint.effects) or not joint.links_fitted  # else the models differ by what the links' fit rounds
    if changed and before is not None and after is not None and np.isfinite(before) and after > LARGER * before:
        out.append(
            "The position error of the free run on the held-out runs is larger with the model after than with the "
            "model before: look at the free-run plots before you simulate with the model after."
        )
    refined = joint.refinement.free_run_heldout if joint.refinement is not None else None
    if after is not None and refined is not None and refined > LARGER * after:
        out.append(
            f"The position error of the free run on the held-out runs is larger with {MODEL_FILE} than with the model "
            "after, although it is smaller on the training runs: prefer the model after."
        )
    return out
