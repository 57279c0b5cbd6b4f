"""Rows of many tasks and limits as whole matrices, over y or over the torques alone.

With y = C tau + c (by its parts), a row A y is (A_v C_v + A_f C_f + A_tau) tau + A_v c_v + A_f c_f.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.tsid.polytope import LeastSquares, Polytope
from drake_tc.tsid.rows import LimitRows, Parts, TaskRows, identity
from drake_tc.types import FloatArray


class Map(NamedTuple):
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


def ordered(limits: Sequence[LimitRows]) -> list[LimitRows]:
    """Torque bounds first, then group by group as they first come."""
    if len(limits) < 2:
        return list(limits)
    groups: dict[str, list[LimitRows]] = {}
    first = next((rows for rows in limits if is_bounds(rows)), None)
    if first is not None:
        groups[first.group] = [first]
    for rows in limits:
        if rows is not first:
            groups.setdefault(rows.group, []).append(rows)
    return [rows for group in groups.values() for rows in group]


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


def _fill(parts: Parts, causes: Map, out: FloatArray) -> None:
    """[matrix over tau, value at tau = 0] of one set of rows into out (r, n + 1)."""
    started = True
    if parts.picks is not None:
        out[:] = causes.motion[parts.picks]
    elif parts.vdot is not None:
        np.dot(parts.vdot, causes.motion, out=out)
    else:
        started = False
    if parts.force is not None:
        if started:
            out += parts.force.dot(causes.push)
        elif parts.force is identity(out.shape[0]):
            out[:] = causes.push
        else:
            np.dot(parts.force, causes.push, out=out)
        started = True
    if parts.torque is None:
        if not started:
            out[:] = 0.0
    elif started:
        out[:, :-1] += parts.torque
    else:
        out[:, :-1], out[:, -1] = parts.torque, 0.0


def cost_of(tasks: Sequence[TaskRows], causes: Map) -> LeastSquares:
    """||D tau - d||^2 with the weights in the rows."""
    size = sum(rows.target.size for rows in tasks)
    whole = np.empty((size, causes.motion.shape[1]))
    matrix, offset = whole[:, :-1], whole[:, -1]
    start = 0
    for rows in tasks:
        stop = start + rows.target.size
        _fill(rows.matrix, causes, whole[start:stop])
        start = stop
    if not tasks:
        return LeastSquares(matrix, offset)
    weight = np.concatenate([rows.weight for rows in tasks])
    target = np.concatenate([rows.target for rows in tasks])
    target -= offset
    target *= weight
    matrix *= weight[:, None]
    return LeastSquares(matrix, target)


def polytope_of(limits: Sequence[LimitRows], causes: Map) -> Polytope:
    """The polytope lower <= G tau <= upper, the torques' bounds first where there are some."""
    limits = ordered(limits)
    size = sum(rows.lower.size for rows in limits)
    whole = np.empty((size, causes.motion.shape[1]))
    matrix, offset = whole[:, :-1], whole[:, -1]
    groups: dict[str, slice] = {}
    labels: tuple[str, ...] = ()
    start = 0
    for rows in limits:
        stop = start + rows.lower.size
        _fill(rows.matrix, causes, whole[start:stop])
        first = groups[rows.group].start if rows.group in groups else start
        groups[rows.group] = slice(first, stop)
        labels += rows.labels
        start = stop
    bounds = limits[0].lower.size if limits and is_bounds(limits[0]) else 0
    if not limits:
        return Polytope(matrix, offset, offset.copy(), groups, labels, 0)
    lower = np.concatenate([rows.lower for rows in limits])
    upper = np.concatenate([rows.upper for rows in limits])
    lower -= offset
    upper -= offset
    return Polytope(matrix, lower, upper, groups, labels, bounds)
