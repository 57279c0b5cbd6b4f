"""Rows of many tasks and limits as whole matrices over the torques.

Accelerations and contact forces as what the torques make them (B, the reduced form).

    M vdot + h = S^T tau + J^T f,   J vdot = -Jdot v + a_c

a_c is the contacts' reference acceleration, zero as a rule. With M = L L^T, X = L^-1 J^T, Z = L^-1 S^T, z = L^-1 h:

    (X^T X) f = X^T (z - Z tau) - Jdot v + a_c
    vdot = L^-T (Z tau - z + X f)

Where J loses rank (a knee that is stretched between two feet, a contact given twice), (X^T X) f = b has no or many
solutions. With D the diagonal that makes the diagonal of D X^T X D one, so that no unit matters, and its eigenvalues
lambda_i relative to the largest, f is then D sum_i filter(lambda_i) / lambda_i u_i (u_i^T D b): the force that is
smallest in D^-1 f, of the accelerations that come nearest. filter goes from 0 at RANK_LOST to 1 at RANK_KEPT with
a continuous derivative, so forces move smoothly where rank comes and goes. Forces that cancel each other are then not
free in the reduced form as they are in the full one: make a sole one surface contact rather than points at its corners.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.rows import LeastSquares, LimitRows, Parts, Polytope, TaskRows, Terms, identity
from drake_tc.types import FloatArray


class AffineMap(NamedTuple):
    """Accelerations and forces that torques cause: vdot = C_v tau + c_v, f = C_f tau + c_f.

    Attributes:
        motion: (nv, n + 1) [C_v, c_v].
        push: (k, n + 1) [C_f, c_f].
    """

    motion: FloatArray
    push: FloatArray

    @property
    def vdot(self) -> FloatArray:
        """(nv, n) C_v."""
        return self.motion[:, :-1]

    @property
    def vdot_offset(self) -> FloatArray:
        """(nv,) c_v."""
        return self.motion[:, -1]

    @property
    def force(self) -> FloatArray:
        """(k, n) C_f."""
        return self.push[:, :-1]

    @property
    def force_offset(self) -> FloatArray:
        """(k,) c_f."""
        return self.push[:, -1]


def is_bounds(rows: LimitRows) -> bool:
    """Whether they bound the torques one by one."""
    torque = rows.matrix.torque
    if torque is None or rows.matrix.vdot is not None or rows.matrix.force is not None:
        return False
    unit = identity(torque.shape[1])
    return torque is unit or (torque.shape == unit.shape and np.array_equal(torque, unit))


def order_of(limits: Sequence[LimitRows]) -> list[int]:
    """Places of the limits in the order of their rows: torque bounds first, then group by group as they first come."""
    groups: dict[str, list[int]] = {}
    first = next((i for i, rows in enumerate(limits) if is_bounds(rows)), None) if len(limits) > 1 else None
    if first is not None:
        groups[limits[first].group] = [first]
    for i, rows in enumerate(limits):
        if i != first:
            groups.setdefault(rows.group, []).append(i)
    return [i for group in groups.values() for i in group]


def ordered(limits: Sequence[LimitRows]) -> list[LimitRows]:
    """The limits in the order of `order_of`."""
    return [limits[i] for i in order_of(limits)]


def names_of(limits: Sequence[LimitRows]) -> tuple[str, ...]:
    """Of the polytope's rows, "limit: row"."""
    return tuple(f"{rows.name}: {label}" for rows in ordered(limits) for label in rows.labels)


def check_names(names: Sequence[str]) -> None:
    """Every task and limit is named once, also where spaces count as underscores, as in names of ports.

    Raises:
        ParamsError: a name that comes twice.
    """
    plain = [name.replace(" ", "_") for name in names]
    for i, name in enumerate(names):
        first = plain.index(plain[i])
        if first < i:
            how = "comes twice" if names[first] == name else f"is the same as {names[first]!r} in a name of a port"
            raise ParamsError(f"tasks and limits: expected different names; {name!r} {how}")


def over_torques(parts: Parts, count: int, causes: AffineMap) -> FloatArray:
    """[matrix over tau, value at tau = 0] (count, n + 1) of rows: A_v [C_v, c_v] + A_f [C_f, c_f] + [A_tau, 0]."""
    out = np.zeros((count, causes.motion.shape[1]))
    for part, caused in ((parts.vdot, causes.motion), (parts.force, causes.push)):
        if part is not None:
            out += part @ caused
    if parts.torque is not None:
        out[:, :-1] += parts.torque
    return out


def cost_of(tasks: Sequence[TaskRows], causes: AffineMap) -> LeastSquares:
    """||D tau - d||^2 with the weights in the rows."""
    whole = [np.zeros((0, causes.motion.shape[1]))]
    for rows in tasks:
        over = over_torques(rows.matrix, rows.target.size, causes)
        over[:, -1] = rows.target - over[:, -1]
        whole.append(rows.weight[:, None] * over)
    matrix = np.concatenate(whole)
    return LeastSquares(matrix[:, :-1].copy(), matrix[:, -1].copy())


def polytope_of(limits: Sequence[LimitRows], causes: AffineMap) -> Polytope:
    """The polytope lower <= G tau <= upper, the torques' bounds first where there are some."""
    limits, start = ordered(limits), 0
    over = np.concatenate(
        [
            np.zeros((0, causes.motion.shape[1])),
            *(over_torques(rows.matrix, rows.lower.size, causes) for rows in limits),
        ]
    )
    lower, upper = (
        np.concatenate([np.zeros(0), *(getattr(rows, side) for rows in limits)]) - over[:, -1]
        for side in ("lower", "upper")
    )
    groups: dict[str, slice] = {}
    for rows in limits:
        first = groups[rows.group].start if rows.group in groups else start
        start += rows.lower.size
        groups[rows.group] = slice(first, start)
    bounds = limits[0].lower.size if limits and is_bounds(limits[0]) else 0
    labels = tuple(label for rows in limits for label in rows.labels)
    return Polytope(over[:, :-1].copy(), lower, upper, groups, labels, bounds)


_CAUSES = Kernel("tsid.terms", "causes")


@dataclass(frozen=True, eq=False)
class Reduced:
    """The problem over the torques alone.

    Attributes:
        causes: y of tau.
        cost: ||D tau - d||^2.
        polytope: lower <= G tau <= upper; bounds on the torques first.
    """

    causes: AffineMap
    cost: LeastSquares
    polytope: Polytope

    @property
    def matrix(self) -> FloatArray:
        """(nv + k + n, n) C of y = C tau + c."""
        causes = self.causes
        return np.concatenate([causes.vdot, causes.force, np.eye(causes.vdot.shape[1])])

    @property
    def offset(self) -> FloatArray:
        """(nv + k + n,) c."""
        causes = self.causes
        return np.concatenate([causes.vdot_offset, causes.force_offset, np.zeros(causes.vdot.shape[1])])

    def full(self, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The vdot (nv,) and f (k,) that torques (n,) cause."""
        causes = self.causes
        return causes.vdot.dot(torque) + causes.vdot_offset, causes.force.dot(torque) + causes.force_offset


def reduce(
    terms: Terms,
    tasks: Sequence[TaskRows],
    limits: Sequence[LimitRows],
    contact_acceleration: FloatArray | None = None,
) -> Reduced:
    """The tasks' cost and the limits' polytope over the torques.

    Args:
        terms: At the state of all rows.
        tasks: Rows over y.
        limits: Rows over y.
        contact_acceleration: (k,) a_c; None for zero.
    """
    causes = causes_of(terms, contact_acceleration)
    return Reduced(causes, cost_of(tasks, causes), polytope_of(limits, causes))


def causes_of(terms: Terms, contact_acceleration: FloatArray | None = None) -> AffineMap:
    """C and c of y = C tau + c, by its parts; NaN where the terms have some."""
    drift = terms.contact_bias if contact_acceleration is None else terms.contact_bias - contact_acceleration
    return AffineMap(*_CAUSES(terms.mass_matrix, terms.bias, terms.actuated, terms.contact_jacobian, drift))
