"""Rows of many tasks and limits as whole matrices, over y or over the torques alone.

With y = C tau + c (by its parts), a row A y is (A_v C_v + A_f C_f + A_tau) tau + A_v c_v + A_f c_f.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.tsid.polytope import LeastSquares, Polytope
from drake_tc.tsid.rows import LimitRows, Parts, TaskRows, identity
from drake_tc.types import FloatArray


@dataclass(frozen=True, eq=False)
class Map:
    """Accelerations and forces that torques cause: vdot = C_v tau + c_v, f = C_f tau + c_f.

    Attributes:
        vdot: (nv, n) C_v.
        vdot_offset: (nv,) c_v.
        force: (k, n) C_f.
        force_offset: (k,) c_f.
    """

    vdot: FloatArray
    vdot_offset: FloatArray
    force: FloatArray
    force_offset: FloatArray


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
    """Every task and limit is named once.

    Raises:
        ParamsError: a name that comes twice.
    """
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ParamsError(f"tasks and limits: wanted different names; {name!r} comes twice")


def _fill(parts: Parts, causes: Map, out: FloatArray, offset: FloatArray) -> None:
    """The matrix over tau of one set of rows into out (r, n), and its value at tau = 0 into offset (r,)."""
    started = False
    if parts.picks is not None:
        out[:], offset[:] = causes.vdot[parts.picks], causes.vdot_offset[parts.picks]
        started = True
    elif parts.vdot is not None:
        np.dot(parts.vdot, causes.vdot, out=out)
        np.dot(parts.vdot, causes.vdot_offset, out=offset)
        started = True
    if parts.force is not None:
        if started:
            out += parts.force.dot(causes.force)
            offset += parts.force.dot(causes.force_offset)
        elif parts.force is identity(offset.size):
            out[:], offset[:] = causes.force, causes.force_offset
        else:
            np.dot(parts.force, causes.force, out=out)
            np.dot(parts.force, causes.force_offset, out=offset)
        started = True
    if started:
        if parts.torque is not None:
            out += parts.torque
    else:
        offset[:] = 0.0
        out[:] = 0.0 if parts.torque is None else parts.torque


def cost_of(tasks: Sequence[TaskRows], causes: Map) -> LeastSquares:
    """||D tau - d||^2 with the weights in the rows."""
    size = sum(rows.target.size for rows in tasks)
    matrix, offset = np.empty((size, causes.vdot.shape[1])), np.empty(size)
    start = 0
    for rows in tasks:
        stop = start + rows.target.size
        _fill(rows.matrix, causes, matrix[start:stop], offset[start:stop])
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
    matrix, offset = np.empty((size, causes.vdot.shape[1])), np.empty(size)
    groups: dict[str, slice] = {}
    labels: tuple[str, ...] = ()
    start = 0
    for rows in limits:
        stop = start + rows.lower.size
        _fill(rows.matrix, causes, matrix[start:stop], offset[start:stop])
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
