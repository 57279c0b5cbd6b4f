"""The joints' intervals with what is not known of the causes that all joints share.

A joint's own coefficients follow the shared ones (`widening`). Where several sets of causes fit alike, each set gives
other coefficients: an F/T sensor's gain scales the torques of all joints, and the mass of a link that fits as well does
not, so that friction and drive gains differ by the gain's error. Every parameter's interval then spans its intervals
under all of these sets, the set that was chosen and each one with an indistinguishable cause in its place, and the
interval of their average with equal weights (`widening.spanning`; Buckland, Burnham and Augustin, 1997).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import norm

from drake_tc.diagnosis.problem.columns import prior_coefficients
from drake_tc.diagnosis.problem.parameters import physical_parameters, shape_places
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.problem.shared.covariance import covariance, own_response
from drake_tc.diagnosis.problem.shared.gain_dilution import dilution
from drake_tc.diagnosis.problem.shared.rows import JointRows
from drake_tc.diagnosis.problem.shared.stacked import StackedFit
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.widening import Parameters, moved, spanned, widened
from drake_tc.effects.link_load import LinkLoad
from drake_tc.types import FloatArray, IntArray


def with_shared_uncertainty(
    joints: Mapping[str, JointResult],
    before: tuple[Sequence[JointRows], StackedFit],
    after: tuple[Sequence[JointRows], StackedFit],
    alternatives: Sequence[StackedFit] = (),
) -> dict[str, JointResult]:
    """The joints' results with intervals that know what is not known of the shared causes.

    Args:
        joints: Results on loads at the estimate of the shared causes.
        before: Training rows with the declared models, and the fit with no cause named.
        after: The same with the final models.
        alternatives: Fits to the rows of `after` with causes that do as well in place of those named.
    """
    rows, chosen = after
    of_before = covariance(*before)[0]
    of_delta = [(fitted, covariance(rows, fitted)[0]) for fitted in (chosen, *alternatives)]
    out = {}
    for number, (name, joint) in enumerate(joints.items()):
        models = []
        for fitted, each in of_delta:
            change = fitted.beta[number] - chosen.beta[number]
            at = _at(joint, change if rows[number].held is None else np.append(0.0, change))
            models.append(widened(at, joint.final, _of_own(rows[number], fitted, each, joint.final)))
        final = spanned(models)
        baseline = _of_own(before[0][number], before[1], of_before, joint.baseline)
        out[name] = replace(
            joint,
            baseline_parameters=widened(joint.baseline_parameters, joint.baseline, baseline),
            final_parameters=final,
            effects=tuple(replace(e, parameters=final[e.key]) for e in joint.effects),
        )
    return out


def _at(joint: JointResult, change: FloatArray) -> Parameters:
    """The final parameters where the joint's own coefficients differ by `change` (1 + k,), as certain as they were."""
    if not change.any():
        return joint.final_parameters
    place = _places(joint.final)[: change.size]
    point = np.concatenate([joint.final.beta, shape_places(joint.final.terms)[1]])
    point[place] += change[: place.size]
    size = joint.final.beta.size
    return moved(joint.final_parameters, physical_parameters(joint.final, point[:size], point[size:]))


def _places(model: Fit) -> IntArray:
    """Which of beta and shape parameters rows of all joints know: those of the joint's own."""
    shapes = sum(len(t.effect.shapes) for t in model.terms)
    return np.flatnonzero(np.concatenate([~prior_coefficients(model.terms, LinkLoad), np.ones(shapes, dtype=np.bool_)]))


def _of_own(rows: JointRows, fitted: StackedFit, of_delta: FloatArray, model: Fit) -> FloatArray:
    """(k + s, k + s) of the model's coefficients and shapes, because of Cov(delta)."""
    response = own_response(rows, fitted)
    place = _places(model)[: len(response)]  # rows without the shapes' slopes say nothing of the shapes
    out = np.zeros((model.beta.size + shape_places(model.terms)[1].size,) * 2)
    out[np.ix_(place, place)] = response @ of_delta @ response.T
    return out


def with_uncertain_gains(
    joints: Mapping[str, JointResult], rows: Sequence[JointRows], fitted: StackedFit, tolerance: float
) -> dict[str, JointResult]:
    """The joints' results with intervals that know how far 1/K may be off, and all torques with it.

    A gain that is fitted may have been shrunk by noise of the effort (`gain_dilution`); declared gains have a
    tolerance.

    Args:
        joints: Results of a robot.
        rows: Training rows with the final models.
        fitted: All joints together.
        tolerance: Standard deviation of the common relative error of the declared drive gains.
    """
    out = {}
    for number, (name, joint) in enumerate(joints.items()):
        own = tolerance if rows[number].held is not None else 0.0
        relative = np.hypot(dilution(rows[number], fitted, number) / float(norm.ppf(0.975)), own)
        links = prior_coefficients(joint.final.terms)
        shapes = sum(len(t.effect.shapes) for t in joint.final.terms)
        scaled = np.concatenate([np.where(links, 0.0, joint.final.beta), np.zeros(shapes)])
        spread = relative**2 * np.outer(scaled, scaled)
        final = widened(joint.final_parameters, joint.final, spread)
        effects = tuple(replace(e, parameters=final[e.key]) for e in joint.effects)
        out[name] = replace(joint, final_parameters=final, effects=effects)
    return out
