"""Each joint's intervals with what is not known of sensors and shared causes, and its effects' gains on the robot.

A joint's own coefficients follow the shared ones, beta_j(delta) = beta_j - G_j delta (`covariance.own_response`), so
that

    Cov(theta_j) = Cov(theta_j | delta) + D G_j Cov(delta) G_j' D',    D = d theta_j/d beta_j

with the first term from the joint's own fit (`drake_tc.diagnosis.problem.estimates`). The errors of a joint's own
sensors within tolerance are treated alike (`drake_tc.diagnosis.problem.sensor_errors`).
"""

from collections.abc import Mapping

import numpy as np

from drake_tc.diagnosis.result.joint_result import JointResult


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
