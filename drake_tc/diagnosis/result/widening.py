"""Each joint's intervals with what is not known of sensors and shared causes, and its effects' gains on the robot.

A joint's own coefficients follow the shared ones, beta_j(delta) = beta_j - G_j delta (`covariance.own_response`), so
that

    Cov(theta_j) = Cov(theta_j | delta) + D G_j Cov(delta) G_j' D',    D = d theta_j/d beta_j

with the first term from the joint's own fit (`drake_tc.diagnosis.problem.estimates`). The errors of a joint's own
sensors within tolerance are treated alike (`drake_tc.diagnosis.problem.sensor_errors`).
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.stats import norm

from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.problem.parameters import physical_parameters, shape_places
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.types import FloatArray

Parameters = Mapping[str, Mapping[str, Estimate]]


def widened(parameters: Parameters, fitted: Fit, spread: FloatArray) -> Parameters:
    """The parameters with wider intervals, which end at the bounds of the parameters.

    Args:
        parameters: Of the fit, by effect and name.
        fitted: One joint's fit.
        spread: Covariance that its own intervals do not know of, (k + s, k + s) of its beta and its shape parameters,
            or (k, k) of its beta alone.
    """
    size = fitted.beta.size
    point = np.concatenate([fitted.beta, shape_places(fitted.terms)[1]])
    named = physical_parameters(fitted, fitted.beta, point[size:])
    slopes: dict[tuple[str, str], FloatArray] = {
        (key, name): np.zeros(point.size) for key in named for name in named[key]
    }
    for k in range(point.size):
        step = 1e-6 * abs(point[k]) + 1e-12
        changed_point = point.copy()
        changed_point[k] += step
        changed = physical_parameters(fitted, changed_point[:size], changed_point[size:])
        for (key, name), slope in slopes.items():
            slope[k] = (changed[key][name] - named[key][name]) / step
    bounds = {(t.effect.key, p.name): (p.lower, p.upper) for t in fitted.terms for p in t.effect.parameters}
    bounds["drive", "gain"] = (0.0, np.inf)
    flat, unbounded = np.zeros(point.size), (-np.inf, np.inf)
    return {
        key: {
            name: _wider(e, slopes.get((key, name), flat), spread, bounds.get((key, name), unbounded))
            for name, e in group.items()
        }
        for key, group in parameters.items()
    }


def _wider(estimate: Estimate, slope: FloatArray, spread: FloatArray, bounds: tuple[float, float]) -> Estimate:
    slope = slope[: len(spread)]
    more = float(norm.ppf(0.975)) ** 2 * max(float(slope @ spread @ slope), 0.0)
    low, high = (abs(estimate.value - end) for end in estimate.ci95)
    ends = (estimate.value - np.hypot(low, np.sqrt(more)), estimate.value + np.hypot(high, np.sqrt(more)))
    return replace(estimate, ci95=(max(float(ends[0]), bounds[0]), min(float(ends[1]), bounds[1])))


def robot_gains(joints: Mapping[str, JointResult], sigma: Mapping[str, float]) -> dict[tuple[str, str], float]:
    """Held-out gain of the whole robot by joint and effect key, told as that of a shared cause.

    1 - sqrt(S/S_0), S the sum over the joints of their held-out squares over sigma_j^2, S_0 the same without the
    effect.

    Args:
        joints: Results.
        sigma: By joint, RMS residual of the shared fit [N m].
    """
    squares = {}
    for name, joint in joints.items():
        stiffness = max(float(joint.final.beta[0]), 1e-12)
        squares[name] = float(np.sum((joint.heldout.after * stiffness) ** 2)) / sigma[name] ** 2
    total = max(sum(squares.values()), 1e-300)
    return {
        (name, effect.key): 1.0 - 1.0 / float(np.sqrt(1.0 + squares[name] * _excess(effect.heldout_gain) / total))
        for name, joint in joints.items()
        for effect in joint.effects
    }


def _excess(gain: float) -> float:
    """By how much the squared error grows, relative, without an effect of this held-out gain; > -1."""
    return 1.0 / max(1.0 - gain, 1e-6) ** 2 - 1.0
