"""What counts as a real improvement: one set of thresholds for each kind of problem.

They were set on simulated rigs that lack nothing, and are judged on rigs of other seeds (drake_tc/diagnosis/README.md).
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Thresholds:
    """When a larger model is taken, and how far the search looks.

    An improvement is real when the evidence of all joints together is large enough, when at least one joint's error
    falls by a share, in noise floors, and beside what earlier effects explain, as below; when enough joints support
    it, and when it holds in the resamples.

    Attributes:
        beam: Models kept at each size. refined: candidates whose shapes are refined. most: largest number added.
        near: Error of a candidate over that of the best, up to which it is refined.
        worth_refining: Relative drop of the error that the best candidate must bring after the first round.
        same: Relative difference of error below which models are as good as each other: the smaller one is taken.
        least_gain: Smallest relative drop of a joint's cross-validated RMS that one more effect must bring.
        least_log_evidence: Evidence of all joints that it must leave after its parameters are paid.
        least_share: Share of block resamples in which it must help.
        least_removed: Smallest RMS it must explain, in noise floors: less is nil in practice.
        least_of_first: ... and as a share of what the effects before it explain: a smaller remainder is more likely an
            imperfect form of those than a cause of its own.
        promising_gain: Smallest relative drop from which on a second effect is tried beside one that is not real by
            itself: each of two effects can hide the evidence of the other.
        least_joints: Joints that must support it. second_gain, second_log_evidence: drop and evidence of a joint that
            does.
    """

    beam: int = 6
    refined: int = 6
    most: int = 4
    near: float = 1.5
    worth_refining: float = 0.01
    same: float = 0.02
    least_gain: float = 0.05
    least_log_evidence: float = 8.0
    least_share: float = 0.98
    least_removed: float = 0.5
    least_of_first: float = 0.10
    promising_gain: float = 0.02
    least_joints: int = 0
    second_gain: float = 0.0
    second_log_evidence: float = 0.0


JOINT = Thresholds()
"""Of one joint whose load is measured."""

LEAST_REMOVED_OF_ESTIMATED_LOAD = 1.0
"""Noise floors that an effect must explain on a joint whose load a robot's model gives: the floor knows the sensors'
noise, but not what the filters do to an estimated load near reversals, which is about as large."""

SHARED = Thresholds(
    beam=1,
    refined=10**6,
    most=3,
    near=np.inf,
    worth_refining=-np.inf,
    least_gain=0.10,
    least_log_evidence=20.0,
    least_share=0.0,
    promising_gain=np.inf,
    least_joints=2,
    second_gain=0.05,
    second_log_evidence=5.0,
)
"""Of causes that no single joint owns: one that a single joint supports is that joint's own."""

ARM = Thresholds(
    beam=1,
    most=30,
    near=np.inf,
    worth_refining=-np.inf,
    same=0.0,
    least_gain=0.02,
    least_log_evidence=-np.inf,
    least_share=0.95,
    least_removed=0.0,
    least_of_first=0.0,
    promising_gain=np.inf,
)
"""Of an arm whose links' parameters are fitted. Looser: the error of a rigid body's sixty parameters is in every
cross-validated figure, so one effect of many lowers it by less."""
