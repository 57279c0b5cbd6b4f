"""How far a soft sole gives way under its centre of pressure (CoP).

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

from drake_tc.estimation.base.spec import ContactSpec, Point2, half_planes
from drake_tc.types import FloatArray

_NODES = 25
"""Of the table, each way."""
_INSIDE = 1e-9


@dataclass(frozen=True, eq=False)
class SoftSole:
    """g over a sole, between the nodes of a table linearly (`drake_tc.kernels.base_soles.shape_of`).

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
