"""What a late encoder does to the balances of all joints.

The encoder of joint j tells q_j(t - d). All that is computed from it is late with it: the loads of every joint, since
these depend on the motion of the whole robot, and the friction and the rotor of its own. To first order the balance of
joint i misses d s_ij, with the links' parameters pi and tau = Y(q, v, vdot) pi

    s_ij = d tau_i/d q_j v_j + d tau_i/d v_j vdot_j + d tau_i/d vdot_j d vdot_j/dt
           + (F_v vdot_j + J d vdot_j/dt if i = j)

A late command of joint j changes the balance of joint j alone: the other joints tell the two apart.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.problem.shared.causes import Cause, CauseColumns, Piece
from drake_tc.estimation.robot_loads import RobotLogs, smoothed_motion
from drake_tc.logs.record import Run
from drake_tc.robot.link_parameters import LinkModel
from drake_tc.types import FloatArray

STEP = 1e-3
"""Of the central difference [s]."""


@dataclass(frozen=True, eq=False)
class OwnMotion:
    """What of a joint's own balance follows its encoder.

    Attributes:
        viscous: F_v [N m s/rad]. inertia: J of rotor and effects [kg m^2].
    """

    viscous: float
    inertia: float


def late_encoder_columns(
    logs: RobotLogs, links: LinkModel, runs: Sequence[Run], pi: FloatArray, own: Mapping[str, OwnMotion]
) -> CauseColumns:
    """One column -s_ij for each joint j of the robot, whose coefficient is the delay d of its encoder [s].

    Args:
        logs: The robot.
        links: Its links by the robot file.
        runs: With all of its joints' positions.
        pi: (10 n,) the links' parameters.
        own: By joint.
    """
    joints = logs.robot.joints
    causes = tuple(Cause("delay", joint, ("delay",), ("s",), slice(k, k + 1)) for k, joint in enumerate(joints))
    friction = np.array([[own[joint].viscous, own[joint].inertia] for joint in joints])
    pieces = {
        run.name: tuple(
            Piece(run.time[part] - run.time[0], -_slopes(links, pi, friction, (q, v, vdot), run.period))
            for part, q, v, vdot in smoothed_motion(logs, run)
        )
        for run in runs
    }
    return CauseColumns(causes, joints, pieces)


def _slopes(
    links: LinkModel, pi: FloatArray, own: FloatArray, motion: tuple[FloatArray, FloatArray, FloatArray], period: float
) -> FloatArray:
    """Slopes s (T, n, n) of one stretch: balance i, encoder j; `own` (n, 2) holds F_v and J of each joint."""
    q, v, vdot = motion
    jerk = np.gradient(vdot, period, axis=0)
    out = np.empty((*q.shape, q.shape[1]))
    for j in range(q.shape[1]):
        chosen = np.zeros(q.shape[1])
        chosen[j] = STEP
        ahead, behind = (
            links.columns(q + s * chosen * v, v + s * chosen * vdot, vdot + s * chosen * jerk) @ pi for s in (1.0, -1.0)
        )
        out[:, :, j] = (ahead - behind) / (2.0 * STEP)
        out[:, j, j] += own[j, 0] * vdot[:, j] + own[j, 1] * jerk[:, j]
    return out
