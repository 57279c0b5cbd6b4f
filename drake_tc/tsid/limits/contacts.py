"""What the ground can give without the contacts slipping, tilting, twisting or lifting.

Keeps the capture point, where the robot could come to rest, inside the polygon of its contacts.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Literal, get_args

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.tsid.contacts import ActiveContacts, Contact
from drake_tc.tsid.fused import Entry
from drake_tc.tsid.rows import LimitRows, Parts, Terms
from drake_tc.types import GRAVITY, FloatArray

Pyramid = Literal["inner", "outer"]


def cone_rows(contact: Contact, pyramid: Pyramid = "inner") -> tuple[FloatArray, FloatArray, FloatArray, list[str]]:
    """Rows of lower <= B f <= upper of one contact, f = [fx fy fz (tx ty tz)] in its axes, z outwards.

    +-fx, +-fy <= m fz              pyramid in the round cone (m = mu / sqrt 2, "inner") or around it (m = mu, "outer")
    fmin <= fz <= fmax
    x_min fz <= -ty <= x_max fz     the centre of pressure (-ty, tx) / fz stays on the sole; surface contacts only,
    y_min fz <=  tx <= y_max fz     as the next ones
    +-tz <= mu_m fz                 [mu_m in m]

    Returns:
        B (11, 6) or (5, 3), lower, upper (11,) or (5,), labels.
    """
    mu = contact.friction * (math.sqrt(0.5) if pyramid == "inner" else 1.0)
    surface = contact.kind == "surface"
    rows = [
        (axis, sign, mu, f"friction {end}{letter}")
        for axis, letter in enumerate("xy")
        for sign, end in ((1.0, "+"), (-1.0, "-"))
    ]
    if surface:
        x_min, x_max, y_min, y_max = contact.sole
        rows += [(4, -1.0, x_max, "pressure +x"), (4, 1.0, -x_min, "pressure -x")]
        rows += [(3, 1.0, y_max, "pressure +y"), (3, -1.0, -y_min, "pressure -y")]
        rows += [(5, sign, contact.moment_friction, f"twist {end}z") for sign, end in ((1.0, "+"), (-1.0, "-"))]
    matrix = np.zeros((len(rows) + 1, 6 if surface else 3))
    lower, upper = np.full(len(rows) + 1, -np.inf), np.zeros(len(rows) + 1)
    for i, (component, sign, reach, _) in enumerate(rows):
        matrix[i, component] = sign
        matrix[i, 2] = -reach
    matrix[-1, 2], lower[-1], upper[-1] = 1.0, contact.minimum_force, contact.maximum_force
    return matrix, lower, upper, [f"{contact.name} {row[3]}" for row in rows] + [f"{contact.name} normal force"]


class WrenchCones:
    """The cones of all contacts that are active: 11 rows a surface contact, 5 a point contact, the same at all states.

    Linear in f; see `cone_rows`. The true twist limit couples tz with the forces off C; the box of `twist` is the
    paper's (Del Prete and Mansard, 2015: mu, mu_moment, fmin, centre of pressure: 11 a foot).
    """

    group = "force"

    def __init__(self, contacts: Sequence[Contact], *, pyramid: Pyramid = "inner", name: str = "contact cones") -> None:
        """Prepare the rows.

        Args:
            contacts: Those of the model, in its order.
            pyramid: Whether the four friction planes are inside the round cone or around it.
            name: Of the limit.

        Raises:
            ParamsError: an unknown pyramid.
        """
        if pyramid not in get_args(Pyramid):
            raise ParamsError(f"pyramid: expected one of {', '.join(get_args(Pyramid))}, got {pyramid!r}")
        self.name = name
        blocks = tuple(cone_rows(contact, pyramid) for contact in contacts)

        @lru_cache(maxsize=256)
        def of(active: tuple[int, ...]) -> LimitRows:
            chosen = [blocks[index] for index in active]
            matrix = np.zeros([sum(block[0].shape[axis] for block in chosen) for axis in (0, 1)])
            row = column = 0
            for block, *_ in chosen:
                matrix[row : row + block.shape[0], column : column + block.shape[1]] = block
                row, column = row + block.shape[0], column + block.shape[1]
            lower, upper = (np.concatenate([np.zeros(0), *(block[side] for block in chosen)]) for side in (1, 2))
            labels = tuple(label for block in chosen for label in block[3])
            return LimitRows(name, WrenchCones.group, Parts(force=matrix), lower, upper, labels)

        self._of = of

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        rows = self._of(contacts.index)
        return Entry("forces", rows.lower.size, (), (rows.matrix.force, rows.lower, rows.upper))

    def rows(self, terms: Terms) -> LimitRows:
        """Of the contacts that are active at this state; the same object while they stay the same."""
        return self._of(terms.contacts.index)


LEAST_HEIGHT = 0.01
"""Of the centre of mass above its contacts; lower ones count as this [m]."""


def convex_hull(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Corners of the convex hull, counter-clockwise, none of them between two others (Andrew's monotone chain)."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered

    def chain(walk: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        kept: list[tuple[float, float]] = []
        for x, y in walk:
            while len(kept) > 1:
                (ax, ay), (bx, by) = kept[-2], kept[-1]
                if (bx - ax) * (y - ay) > (by - ay) * (x - ax):
                    break
                kept.pop()
            kept.append((x, y))
        return kept[:-1]

    return chain(ordered) + chain(ordered[::-1])


def half_planes(corners: Sequence[tuple[float, float]]) -> tuple[FloatArray, FloatArray]:
    """Unit normals N (r, 2) and d (r,) of N x <= d, inside the hull of the corners; 4 rows for a point or a segment."""
    hull = convex_hull(corners)
    if not hull:
        return np.zeros((0, 2)), np.zeros(0)
    if len(hull) < 3:
        return _around(hull[0], hull[-1])
    normals, reach = [], []
    x, y = hull[-1]
    for next_x, next_y in hull:
        along, across = next_x - x, next_y - y
        length = math.hypot(along, across)
        normal = across / length, -along / length
        normals.append(normal)
        reach.append(normal[0] * x + normal[1] * y)
        x, y = next_x, next_y
    return np.array(normals), np.array(reach)


def _around(one: tuple[float, float], other: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Along and across a segment, or the axes at a point."""
    x, y = other[0] - one[0], other[1] - one[1]
    length = math.hypot(x, y)
    x, y = (x / length, y / length) if length else (1.0, 0.0)
    normals = np.array([[x, y], [-x, -y], [-y, x], [y, -x]])
    return normals, (normals @ np.array([one, other]).T).max(axis=1)


class CapturePointLimit:
    """The capture point after the next period stays `margin` inside the hull of the active contacts, seen from above.

        xi = c + cdot / w,  w^2 = g / z      c, cdot: horizontal place and velocity of the centre of mass, z its height
        xi+ = xi + h cdot + (h^2 / 2 + h / w) cddot,  cddot = J_c vdot + Jdot_c v
        N xi+ <= d - margin                  one row an edge [m]

    Linear in vdot. As xidot = w (xi - p) with the centre of pressure p in the same polygon (linear inverted pendulum),
    a xi inside can be kept inside; one that is outside cannot be brought back but by turning the body, and the problem
    may then have no solution: `infeasible` names the edge. No contact, no rows.

    Source: Del Prete and Mansard, 2015, after Ramos, Mansard and Soueres (Humanoids 2014).
    """

    group = "capture_point"

    def __init__(
        self,
        contacts: Sequence[Contact],
        *,
        period: float,
        margin: float = 0.0,
        gravity: float = GRAVITY,
        name: str = "capture point",
    ) -> None:
        """Keep the numbers.

        Args:
            contacts: Those of the model, in its order.
            period: h: of the controller [s].
            margin: [m].
            gravity: [m/s^2].
            name: Of the limit.

        Raises:
            ParamsError: no contacts, a period or gravity that is not positive, or a margin that is negative or not
                finite.
        """
        for key, value in (("period", period), ("gravity", gravity)):
            if not (math.isfinite(value) and value > 0.0):
                raise ParamsError(f"{name}: {key}: expected a positive number, got {value!r}")
        if not (math.isfinite(margin) and margin >= 0.0):
            raise ParamsError(f"{name}: margin: expected a finite number >= 0 [m], got {margin!r}")
        if not contacts:
            raise ParamsError(f"{name}: expected contacts, over which it is kept, got none")
        self.name = name
        self._period, self._margin, self._gravity = period, margin, gravity
        self._places = tuple((contact.name, contact.corners[:, :2].tolist()) for contact in contacts)
        self._labels = tuple(f"{name} edge {i}" for i in range(4 * len(self._places)))

    def capture_point(self, terms: Terms) -> FloatArray:
        """(2,) xi of this state [m]."""
        _, height = self.corners(terms)
        return np.asarray(terms.com[:2] + terms.com_velocity[:2] / self._rate(terms, height))

    def rows(self, terms: Terms) -> LimitRows:
        """One row an edge of the hull."""
        corners, ground = self.corners(terms)
        normals, reach = half_planes(corners) if math.isfinite(ground) else _unknown()
        rate, h = self._rate(terms, ground), self._period
        gain = 0.5 * h * h + h / rate
        linear = (gain / terms.mass) * terms.momentum_matrix[3:5]
        bias = (gain / terms.mass) * terms.momentum_bias[3:5]
        drift = terms.com[:2] + (h + 1.0 / rate) * terms.com_velocity[:2] + bias
        matrix = normals.dot(linear)
        upper = reach - normals.dot(drift) - self._margin
        return LimitRows(
            self.name, self.group, Parts(vdot=matrix), np.full(len(reach), -np.inf), upper, self._labels[: len(reach)]
        )

    def _rate(self, terms: Terms, ground: float) -> float:
        """W [1/s]."""
        height = float(terms.com[2]) - ground
        return math.sqrt(self._gravity / (height if height > LEAST_HEIGHT else LEAST_HEIGHT))

    def corners(self, terms: Terms) -> tuple[list[tuple[float, float]], float]:
        """Corners of all active contacts from above, and the mean height of their frames [m]."""
        corners: list[tuple[float, float]] = []
        heights, active = 0.0, terms.contacts.index
        for index in active:
            name, places = self._places[index]
            rotation, position = terms.pose(name)
            (xx, xy, _), (yx, yy, _), _ = rotation.tolist()
            px, py, pz = position.tolist()
            corners += [(px + xx * x + xy * y, py + yx * x + yy * y) for x, y in places]
            heights += pz
        return corners, heights / len(active) if active else 0.0


def _unknown() -> tuple[FloatArray, FloatArray]:
    return np.full((1, 2), np.nan), np.full(1, np.nan)
