"""What the other joints leave open of the links' parameters, as columns of one joint's own regression.

All joints share the links' parameters delta. While joint j's own effects are searched, the other joints and the robot
file know N(m_j, S_j) of them (`stacked.from_others`). With S_j = A A', the joint's balance at the common estimate
delta_0 has the columns C_j A and coefficients u ~ N(A^-1 (m_j - delta_0), I): least squares with this prior gives the
joint the errors and evidence that all joints together would give it, their own effects as they are. Directions along
which C_j A is far below the joint's noise are left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.data.link_prior import LinkPrior, column_name
from drake_tc.diagnosis.problem.columns import coefficients_by_term
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.problem.shared.causes import CauseColumns
from drake_tc.diagnosis.problem.shared.rows import JointRows
from drake_tc.diagnosis.problem.shared.stacked import StackedFit, from_others
from drake_tc.effects.link_load import LinkLoad
from drake_tc.logs.record import Run
from drake_tc.types import FloatArray

NEGLIGIBLE = 0.02
"""RMS of a column over the joint's noise, below which its direction is left out."""


@dataclass(frozen=True, eq=False)
class OpenDirections:
    """Of one joint.

    Attributes:
        joint: Name.
        mix: (p, r) from u to the deviation of delta from the common estimate.
        prior: Of u.
    """

    joint: str
    mix: FloatArray
    prior: LinkPrior


def open_directions(rows: Sequence[JointRows], fitted: StackedFit) -> Mapping[str, OpenDirections]:
    """By joint, what the others leave open.

    Args:
        rows: Training rows of all joints, with their models so far.
        fitted: All joints together.
    """
    return {r.joint: _of_joint(rows, fitted, j) for j, r in enumerate(rows)}


def _of_joint(rows: Sequence[JointRows], fitted: StackedFit, number: int) -> OpenDirections:
    mine = rows[number]
    mean, covariance = from_others(rows, fitted, number)
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    size, turn = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = np.sqrt(np.maximum(size, 1e-12))
    mix = scale[:, None] * turn * root
    towards = ((mean - fitted.delta) / scale) @ turn / root
    columns = mine.shared[:, fitted.columns] @ mix
    strength, directions = np.linalg.eigh(columns.T @ columns / len(columns))
    noise = float(fitted.sigma[number])
    kept = strength > (NEGLIGIBLE * noise) ** 2
    share = max(float(fitted.share[number]), 1e-6)
    prior = LinkPrior(mean=-(towards @ directions[:, kept]), precision=noise**2 / share)
    return OpenDirections(mine.joint, mix @ directions[:, kept], prior)


def with_open_directions(
    runs: Sequence[Run], causes: CauseColumns, fitted: StackedFit, joints: Sequence[OpenDirections]
) -> list[Run]:
    """The runs with the columns C_j A of each of these joints, as `<joint>/link_load_<k>`."""
    out = []
    for run in runs:
        more: dict[str, FloatArray] = {}
        for each in joints:
            columns = causes.of(run.name, each.joint, run.time - run.time[0])[:, fitted.columns] @ each.mix
            more |= {f"{each.joint}/{column_name(k)}": column for k, column in enumerate(columns.T)}
        out.append(replace(run, columns=dict(run.columns) | more))
    return out


def with_links_of(runs: Sequence[Run], models: Mapping[str, Fit]) -> list[Run]:
    """The runs with the load of each joint's own model, tau_j + C_j A u_j, and without the columns C_j A.

    A joint's friction and the errors of its sensors were fitted beside its own u_j. On the loads of the common estimate
    they would leave what u_j explains: a constant of the load and an offset of the effort nearly cancel.

    Args:
        runs: With `<joint>/torque` and `<joint>/link_load_<k>` (`with_open_directions`).
        models: By joint, a fit to such runs.
    """
    own = {
        joint: theta
        for joint, fitted in models.items()
        for term, theta in coefficients_by_term(fitted.terms, fitted.beta)
        if isinstance(term.effect, LinkLoad)
    }
    out = []
    for run in runs:
        columns = dict(run.columns)
        for joint, theta in own.items():
            parts = [weight * columns.pop(f"{joint}/{column_name(k)}") for k, weight in enumerate(theta)]
            columns[f"{joint}/torque"] = columns[f"{joint}/torque"] + np.sum(parts, axis=0)
        out.append(replace(run, columns=columns))
    return out
