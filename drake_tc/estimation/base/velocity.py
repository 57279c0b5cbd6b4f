"""The program of the velocity update where a centre of pressure ends at its sole's edge.

The equations are those of `drake_tc.kernels.base.velocity`, whose closed form serves everywhere else.

How far a soft sole gives way under its centre of pressure (CoP).

A sole is n springs of stiffness K/n that only push. Under a force F with its CoP at c the springs' forces f_i F have
the least energy of all that bear the load:

    g(c) = n min sum f_i^2   s.t. sum f_i = 1, sum f_i x_i = c, f >= 0        sink at c: s = F g(c)/K

As long as all springs touch, g = 1 + (c_x/r_x)^2 + (c_y/r_y)^2, r^2 = a^2 (m + 1)/(3 (m - 1)) of m springs in a row of
half length a; beyond, the sole rolls onto its edge and g grows faster.

The point of the foot's frame that stands still is (c, s), at the floor. The energy E* = F^2 g(F c/F)/(2K) gives the
deflection's parts at c: the material there sinks by

    ds_material = (g dF + F dg/2)/K

and as c moves along the tilted sole, F dg/(2K) is the way back to the floor, whose slope in the sole is F (dg/dc)/(2K).
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from daqp import solve  # type: ignore[import-not-found, import-untyped, unused-ignore]

from drake_tc.estimation.base.rig import ContactSpec, Point2, half_planes
from drake_tc.types import FloatArray

_NODES = 25
"""Of the table, each way."""
_INSIDE = 1e-9


@dataclass(frozen=True, eq=False)
class SoftSole:
    """g over a sole, between the nodes of a table linearly (`drake_tc.kernels.base.contacts.shape_of`).

    Attributes:
        stiffness: K [N/m].
        origin, step: Of the nodes [m].
        table: (25, 25) g, first index along x [-].
    """

    stiffness: float
    origin: tuple[float, float]
    step: tuple[float, float]
    table: FloatArray


def spring_points(polygon: tuple[Point2, ...], numbers: tuple[int, int]) -> FloatArray:
    """(n, 2) where the springs of a sole are: a grid between its extremes, as far as it is inside [m]."""
    corners = np.array(polygon)
    low, high = corners.min(axis=0), corners.max(axis=0)
    x, y = (np.linspace(low[i], high[i], numbers[i]) for i in (0, 1))
    grid = np.stack([each.ravel() for each in np.meshgrid(x, y, indexing="ij")], axis=1)
    normals, offsets = half_planes("sole", polygon)
    return np.asarray(grid[(grid @ normals.T <= offsets + _INSIDE).all(axis=1)])


def shape_at(points: FloatArray, c: FloatArray) -> float:
    """g(c) by its program; of a c that no push of the springs can have, that of the nearest that one can.

    Args:
        points: (n, 2) springs [m].
        c: (2,) centre of pressure [m].
    """
    n = len(points)
    scale = np.abs(points - points.mean(axis=0)).max(axis=0)
    rows = np.column_stack([(points - c) / scale, np.ones(n)])
    heavy = 1e4  # of c against energy; the sum of f is an equation
    hessian: Any = np.eye(n) + heavy * rows[:, :2] @ rows[:, :2].T
    A, low, high = np.ascontiguousarray(rows[:, 2:].T), np.append(np.zeros(n), 1.0), np.append(np.ones(n), 1.0)
    sense = np.append(np.zeros(n), 5).astype(np.int32)  # 5: an equation
    f = np.asarray(solve(hessian, np.zeros(n), A, high, low, sense)[0])
    return float(n * f @ f)


def soft_sole(contact: ContactSpec) -> SoftSole | None:
    """The table of a contact; None of one that is rigid or a point."""
    if contact.sole_stiffness is None or contact.polygon is None:
        return None
    return SoftSole(contact.sole_stiffness, *_tabled(contact.polygon, contact.sole_points))


@lru_cache(maxsize=32)
def _tabled(polygon: tuple[Point2, ...], numbers: tuple[int, int]) -> tuple[Point2, Point2, FloatArray]:
    """(origin, step, rows) of a sole's table."""
    points = spring_points(polygon, numbers)
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = (np.linspace(low[i], high[i], _NODES) for i in (0, 1))
    table = np.array([[shape_at(points, np.array([a, b])) for b in y.tolist()] for a in x.tolist()])
    step = (high - low) / (_NODES - 1)
    return (float(low[0]), float(low[1])), (float(step[0]), float(step[1])), table


_NO_LIMIT = 1e30


@dataclass(frozen=True, eq=False)
class Soles:
    """The soles of k contacts as half planes N x <= d, padded to the same number m of rows.

    Attributes:
        normals: (k, m, 2); zero rows pad, and all rows of a point are padding: it has no room to leave.
        offsets: (k, m) [m]; `_NO_LIMIT` where padded.
        middle: (k, 2) mean of the corners [m]; zero of a point.
        flat: (k,) 1 for a sole, 0 for a point.
        rows, nothing, sense: (k m, 3 + 2k), (k m,), (k m,) the half planes as the solver takes them.
        template: (k, 3, 3 + 2k) [I 0 ... 0].
    """

    normals: FloatArray
    offsets: FloatArray
    middle: FloatArray
    flat: FloatArray
    rows: FloatArray
    nothing: FloatArray
    sense: Any
    template: FloatArray


def soles_of(contacts: tuple[ContactSpec, ...]) -> Soles:
    """The soles of the contacts.

    Raises:
        ParamsError: a polygon that is not convex.
    """
    k, m = len(contacts), max((len(c.polygon) for c in contacts if c.polygon is not None), default=1)
    normals, offsets = np.zeros((k, m, 2)), np.full((k, m), _NO_LIMIT)
    middle, flat = np.zeros((k, 2)), np.zeros(k)
    for i, contact in enumerate(contacts):
        if contact.polygon is not None:
            rows, limits = half_planes(f"contact {contact.mount.name!r}", contact.polygon)
            normals[i, : len(rows)], offsets[i, : len(rows)] = rows, limits
            middle[i], flat[i] = np.mean(contact.polygon, axis=0), 1.0
    whole = np.zeros((k * m, 3 + 2 * k))
    for i in range(k):
        whole[i * m : (i + 1) * m, 3 + 2 * i : 5 + 2 * i] = normals[i]
    template = np.zeros((k, 3, 3 + 2 * k))
    template[:, :, :3] = np.eye(3)
    below = np.full(k * m, -_NO_LIMIT)
    return Soles(normals, offsets, middle, flat, whole, below, np.zeros(k * m, dtype=np.int32), template)


def rows_of(contacts: tuple[ContactSpec, ...]) -> FloatArray:
    """(k, w) a row a contact, as `drake_tc.kernels.base.sample` has it.

    Raises:
        ParamsError: a polygon that is not convex.
    """
    soles, rows = soles_of(contacts), []
    planes = np.concatenate((soles.normals, soles.offsets[:, :, None]), axis=2)
    for contact, flat, middle, limits in zip(contacts, soles.flat, soles.middle, planes, strict=True):
        sole = soft_sole(contact)
        give = (0.0, 0.0, 0.0, 1.0, 1.0) if sole is None else (sole.stiffness, *sole.origin, *sole.step)
        rows.append([flat, contact.make, contact.break_, *give, *middle, *limits.ravel()])
    return np.array(rows)


def solve_program(program: FloatArray, soles: Soles) -> FloatArray:
    """(4 + 3k,): 1, ydot, x_1 ..., 1 for each sole that ends there; -1 first where the solver gives nothing.

    Points keep x_cop.

    Args:
        program: (5 + 13k,) as `drake_tc.kernels.base.velocity.write_program` has it.
        soles: Limits of the centres of pressure.
    """
    k = len(soles.flat)
    n = 3 + 2 * k
    reference, trust, deviation = program[:3], program[3], program[4]
    matrix, still, pressure, spread, weight = np.split(program[5:], np.cumsum([6 * k, 3 * k, 2 * k, k]))
    A = soles.template.copy()
    curvature = np.full(n, trust)
    for i in np.flatnonzero(spread > 0.0):
        A[i, :, 3 + 2 * i : 5 + 2 * i] = matrix.reshape(k, 3, 2)[i]
        curvature[3 + 2 * i : 5 + 2 * i] = 1.0 / (spread[i] * spread[i])
    # about [ydot_ref; x_cop]: z = goal + dz, so that numbers are small
    scale = np.sqrt(weight)[:, None] / deviation
    A *= scale[:, :, None]
    A = A.reshape(3 * k, n)
    b = (scale * (reference + still.reshape(k, 3))).ravel()
    hessian = A.T @ A
    hessian.flat[:: n + 1] += curvature
    room = soles.offsets - (soles.normals @ pressure.reshape(k, 2, 1))[:, :, 0]
    dz, _, flag, told = solve(hessian, A.T @ b, soles.rows, room.ravel(), soles.nothing, soles.sense, primal_tol=1e-9)
    if flag <= 0 or not dz @ dz < np.inf:
        return np.full(4 + 3 * k, -1.0)
    ends = told["lam"].reshape(k, -1).any(axis=1)
    return np.concatenate(([1.0], reference + dz[:3], pressure + dz[3:], ends))
