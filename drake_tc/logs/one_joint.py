"""Whether the runs of a rig are of one joint: a drive's gain does not change between them."""

from collections.abc import Sequence

import numpy as np

from drake_tc.errors import LogError
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.logs.signs import TURNED, SignEvidence, sign_evidence

MOST_APART = 2.0
"""Factor between the ranges of the gains of two runs of one joint."""
PROPORTIONAL = 0.95
"""Partial correlation of effort and load torque above which their ratio is the gain: a drive at its limit has less."""


def require_one_joint(runs: Sequence[Run], rig: Rig) -> None:
    """Refuse runs whose drive gains are more than a factor of two apart: of another joint, unit or setting.

    With the effort  y = (tau + J qddot + f_v qdot + f_c sign(qdot)) / K  of each run, 1/K of the whole run and of its
    thirds make a range; runs in which the load torque's share of the effort is not clear are not compared. Friction
    may change between runs, but under a measured load it does not drive the joint in one and brake it in another:
    columns are exchanged then.

    Raises:
        LogError: names the two runs that are farthest apart.
    """
    for joint in rig.joints:
        found = [(run, sign_evidence(run, rig, joint)) for run in runs]
        driven = [run for run, e in found if e is not None and e.friction < -TURNED]
        measured = rig.load[joint] == "torque"  # a pendulum that is dropped drives its motor
        if measured and driven and any(e is not None and e.friction > TURNED for _, e in found):
            raise LogError(
                f"{driven[0].source or driven[0].name}: friction would drive {joint} in this run, and brakes it in"
                " others; check the signs and the names of its columns"
            )
        clear = [(run, e.gain) for run, e in found if e is not None and _is_proportional(e)]
        if len(clear) < 2:
            continue
        lowest = min(clear, key=lambda each: each[1][1])
        highest = max(clear, key=lambda each: each[1][0])
        if highest[1][0] > MOST_APART * lowest[1][1]:
            usual = float(np.median([np.log(sum(gain)) for _, gain in clear]))
            odd, other = sorted((highest, lowest), key=lambda each: -round(abs(np.log(sum(each[1])) - usual), 6))
            unit = rig.units_of(joint).text("N m")
            told = " and ".join(f"{low:.4g} to {high:.4g} in {run.name}" for run, (low, high) in (odd, other))
            raise LogError(
                f"{odd[0].source or odd[0].name}: the runs are not of one {joint}: the effort for 1 {unit} of load is"
                f" {told}; leave out the run of another joint or setting, or state its units"
            )


def _is_proportional(evidence: SignEvidence) -> bool:
    """Whether effort and load torque of a run have a ratio."""
    return evidence.steady and evidence.load > PROPORTIONAL and evidence.gain[0] > 0.0
