"""What errors of the encoders' clocks do to the loads of all joints: instants that scatter, and encoders that are late.

**Scatter.** The links' loads are Y(q, qdot, qddot) pi. Positions that err by qdot delta make the loads err by
M d^2(qdot delta)/dt^2 of all joints at once, which is d^2(p delta)/dt^2 while the motion is slow beside the changes of
delta, with the momenta

    p = M(q) qdot = (Y(q, 0, qdot) - Y(q, 0, 0)) pi

**Late encoders.** The encoder of joint j tells q_j(t - d). All that is computed from it is late with it: the loads of
every joint, since these depend on the motion of the whole robot, and the friction and the rotor of its own. To first
order the balance of joint i misses d s_ij, with the links' parameters pi and tau = Y(q, v, vdot) pi

    s_ij = d tau_i/d q_j v_j + d tau_i/d v_j vdot_j + d tau_i/d vdot_j d vdot_j/dt
           + (F_v vdot_j + J d vdot_j/dt if i = j)

A late command of joint j changes the balance of joint j alone: the other joints tell the two apart.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.data.channels import channels_of
from drake_tc.diagnosis.data.clocks import timing_scatter
from drake_tc.diagnosis.shared.causes import GRID_SECONDS, Cause, CauseColumns, Piece
from drake_tc.diagnosis.shared.columns_of_runs import payload_of
from drake_tc.errors import IdentificationError
from drake_tc.estimation.robot_loads import RobotLogs, smoothed_motion
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.robot.rigid_regressor import LinkModel
from drake_tc.types import FloatArray, IntArray

STEP = 1e-3
"""Of the central difference [s]."""


@dataclass(frozen=True, eq=False)
class LinkMomenta:
    """Over a set of runs.

    Attributes:
        joints: Of the columns, n.
        pieces: By run name, columns (G, n, P) of the links' and the payloads' parameters.
        nominal: (P,) the parameters by the robot's file.
    """

    joints: tuple[str, ...]
    pieces: Mapping[str, tuple[Piece, ...]]
    nominal: FloatArray

    def added(self, runs: Sequence[Run], joints: Sequence[str], columns: IntArray, delta: FloatArray) -> list[Run]:
        """The runs with `<joint>/momentum` [N m s], where the parameters are nominal less delta."""
        parameters = self.nominal.copy()
        parameters[columns] -= delta
        out = []
        for run in runs:
            since = run.time - run.time[0]
            more = {f"{joint}/momentum": self._of(run.name, joint, since, parameters) for joint in joints}
            out.append(replace(run, columns=dict(run.columns) | more))
        return out

    def _of(self, run: str, joint: str, time: FloatArray, parameters: FloatArray) -> FloatArray:
        """(T,) at times since the start of a run; 0 outside its usable stretches."""
        number, out = self.joints.index(joint), np.zeros(time.size)
        for piece in self.pieces[run]:
            inside = (time >= piece.time[0] - 1e-9) & (time <= piece.time[-1] + GRID_SECONDS)
            out[inside] = np.interp(time[inside], piece.time, piece.values[:, number] @ parameters)
        return out


def momenta_over(logs: RobotLogs, links: LinkModel, sides: Sequence[Sequence[Run]], rig: Rig) -> LinkMomenta | None:
    """The links' momenta; None where the sampling instants of no joint scatter."""
    if not any(_scatters(runs, joint) for runs in sides for joint in rig.joints):
        return None
    runs = [run for side in sides for run in side]
    payload = payload_of(rig, [run.name for run in runs], links)
    pieces: dict[str, tuple[Piece, ...]] = {}
    for run in runs:
        every, made = max(1, round(GRID_SECONDS / run.period)), []
        for part, q, v, _ in smoothed_motion(logs, run):
            q, v, rest = q[::every], v[::every], np.zeros_like(q[::every])
            columns = links.columns(q, rest, v) - links.columns(q, rest, rest)
            values = np.concatenate([columns, payload.columns(columns, run.name)], axis=2)
            made.append(Piece((run.time[part] - run.time[0])[::every], logs.at_motors(values)))
        pieces[run.name] = tuple(made)
    width = next(piece.values.shape[2] for made in pieces.values() for piece in made)
    nominal = np.concatenate([links.nominal, np.zeros(width - links.nominal.size)])
    return LinkMomenta(logs.robot.joints, pieces, nominal)


def _scatters(runs: Sequence[Run], joint: str) -> bool:
    try:
        channels = channels_of(runs, joint)
    except IdentificationError:
        return False  # the joint's own preparation refuses such runs
    if channels.speed_only:
        return False
    found = timing_scatter(channels.raw("position"), channels.segments, channels.period, channels.step("position"))
    return found is not None


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
    """One column -s_ij for each joint j of the robot, whose coefficient is the delay d of its encoder [s]."""
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
