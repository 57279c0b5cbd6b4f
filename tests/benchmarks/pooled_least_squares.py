"""Plain least squares of a whole robot on the rows and in the filters of a `close-loop` call: what it has to beat.

    pooled      y_j / K_j = Y_j(q, v, vdot) pi      + F_v,j v_j + F_c,j sign(v_j) + J_j vdot_j + c_j    j = 1 ... n
    scaled      y_j / K_j = k_j Y_j(q, v, vdot) pi0 + F_v,j v_j + F_c,j sign(v_j) + J_j vdot_j + c_j

with the drive gains K_j of the rig file [effort/(N m)]. *Pooled* has one pi for all joints and no prior. The columns
that are independent numerically are taken (Gautier, 1991). Each joint's rows are weighted by its own residual, to which
the fit is repeated. *Scaled* fits each joint by itself: the parameters pi0 of the robot's file up to a factor k_j, and
four numbers of the joint's own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.diagnosis.robot.runs import over_samples
from drake_tc.diagnosis.shared.causes import CauseColumns
from drake_tc.diagnosis.shared.columns_of_runs import columns_over
from drake_tc.effects.library import effect
from drake_tc.errors import IdentificationError
from drake_tc.estimation.robot_loads import robot_logs
from drake_tc.identification.regression import independent_columns
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

DECLARED = ("viscous", "coulomb", "rotor_inertia")
ROUNDS = 10
"""Of weighing each joint by what the fit before leaves of it."""
LEAST_SPREAD = 1e-9
"""Of the largest one: a joint whose residual vanishes does not weigh infinitely."""


@dataclass(frozen=True, eq=False)
class PlainRows:
    """One joint's rows of one side.

    Attributes:
        target: (N,) y/K [N m]. links: (N, P) Y. own: (N, 4) friction, rotor inertia and the constant.
        nominal: (N,) Y pi0, the torque of the robot's file [N m].
    """

    target: FloatArray
    links: FloatArray
    own: FloatArray
    nominal: FloatArray


@dataclass(frozen=True)
class PlainResiduals:
    """Held-out residuals (N,) of each joint [effort].

    Attributes:
        pooled: Least squares of all joints together.
        scaled: Least squares with the scaled torques of the robot's file.
        own: What the model after leaves when friction, inertia and constant are fitted once more to each held-out run
            by itself (in view of it): how much of the error is that the runs differ in these.
        in_view: Pooled least squares that is fitted to the held-out rows themselves: no model of this structure with
            one set of parameters leaves less.
    """

    pooled: Mapping[str, FloatArray]
    scaled: Mapping[str, FloatArray]
    own: Mapping[str, FloatArray]
    in_view: Mapping[str, FloatArray]


def least_squares_residuals(result: CloseLoopResult, rig: Rig, runs: Sequence[Run]) -> PlainResiduals:
    """Held-out residuals of both kinds of least squares, on the held-out rows of the call.

    Args:
        result: Of `close_loop` with this rig.
        rig: With a fitted robot as load and declared drive gains.
        runs: All runs of the call.

    Raises:
        IdentificationError: The rig has no fitted robot, or a joint without a declared drive gain.
    """
    logs = robot_logs(rig, runs)
    if logs is None or logs.links is None or set(rig.drive_gain) != set(rig.joints):
        raise IdentificationError(
            "pooled least squares: expected `load: {robot: fitted}` and a drive_gain of each joint"
        )
    causes, nominal = columns_over(logs, runs, rig), logs.links.nominal
    train, held = (
        {joint: plain_rows(split.samples, joint, causes, nominal, rig.drive_gain[joint]) for joint, split in each}
        for each in (
            [(joint, r.train) for joint, r in result.joints.items()],
            [(joint, r.heldout) for joint, r in result.joints.items()],
        )
    )
    pooled = fit_and_predict(train, held)
    scaled = {joint: fit_scaled(train[joint], held[joint]) for joint in rig.joints}
    own = {joint: fit_each_run(held[joint], r.heldout.samples, r.heldout.after) for joint, r in result.joints.items()}

    def in_effort(torques: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        return {joint: rig.drive_gain[joint] * torque for joint, torque in torques.items()}

    return PlainResiduals(in_effort(pooled), in_effort(scaled), own, in_effort(fit_and_predict(held, held)))


def fit_each_run(held: PlainRows, samples: Samples, residual: FloatArray) -> FloatArray:
    """What each held-out run's own friction, inertia and constant leave of a residual (N,), in its unit."""
    out = residual.copy()
    for number in np.unique(samples.run):
        rows = samples.run == number
        estimate = np.linalg.lstsq(held.own[rows], residual[rows], rcond=None)[0]
        out[rows] -= held.own[rows] @ estimate
    return out


def plain_rows(samples: Samples, joint: str, causes: CauseColumns, nominal: FloatArray, gain: float) -> PlainRows:
    """One joint's rows from its filtered signals.

    Args:
        samples: Of one side.
        joint: Name.
        causes: Columns over the same runs; those of the links come first.
        nominal: pi0 of the robot's file.
        gain: Drive gain K [effort/(N m)].
    """
    design = Columns(samples).design([Term(effect(name)) for name in DECLARED])
    links = samples.reduce(over_samples(samples, joint, causes), fresh=True)
    own = np.column_stack([design[:, 1:], np.ones(len(design))])
    return PlainRows(design[:, 0] / gain, links, own, links[:, : nominal.size] @ nominal)


def fit_scaled(train: PlainRows, held: PlainRows) -> FloatArray:
    """Residual (N,) of one joint's held-out rows [N m] with the file's torques scaled by one factor."""
    before, after = (np.column_stack([rows.nominal, rows.own]) for rows in (train, held))
    estimate = np.linalg.lstsq(before, train.target, rcond=None)[0]
    return np.asarray(held.target - after @ estimate)


def fit_and_predict(train: Mapping[str, PlainRows], held: Mapping[str, PlainRows]) -> dict[str, FloatArray]:
    """Residual (N,) of each joint's held-out rows [N m]."""
    matrix = _stacked(train)
    kept = independent_columns(matrix)
    ends = np.cumsum([0, *(rows.target.size for rows in train.values())]).tolist()
    whole = np.column_stack([matrix[:, kept], np.concatenate([rows.target for rows in train.values()])])
    parts = [np.linalg.qr(whole[a:b], mode="r") / np.sqrt(b - a) for a, b in pairwise(ends)]
    sizes = np.sqrt(np.diff(ends))
    spread = np.ones(len(parts))
    for _ in range(ROUNDS):
        weighted = np.concatenate([r * size / each for r, size, each in zip(parts, sizes, spread, strict=True)])
        estimate = np.linalg.lstsq(weighted[:, :-1], weighted[:, -1], rcond=None)[0]
        spread = np.array([float(np.linalg.norm(r @ np.append(estimate, -1.0))) for r in parts])
        spread = np.maximum(spread, LEAST_SPREAD * spread.max())
    predicted = _stacked(held)[:, kept] @ estimate
    ends = np.cumsum([0, *(rows.target.size for rows in held.values())]).tolist()
    return {
        joint: rows.target - predicted[a:b] for (joint, rows), (a, b) in zip(held.items(), pairwise(ends), strict=True)
    }


def _stacked(sides: Mapping[str, PlainRows]) -> FloatArray:
    """[Y, own columns of each joint] of all joints' rows."""
    width = next(iter(sides.values())).own.shape[1]
    parts = []
    for number, rows in enumerate(sides.values()):
        own = np.zeros((rows.target.size, width * len(sides)))
        own[:, width * number : width * (number + 1)] = rows.own
        parts.append(np.column_stack([rows.links, own]))
    return np.concatenate(parts)
