"""What the ground can give without the contacts slipping, tilting, twisting or lifting."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Literal, get_args

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.tsid.contacts import ActiveContacts, Contact
from drake_tc.tsid.rows import LimitRows, Parts, Terms
from drake_tc.tsid.tables import Entry
from drake_tc.types import FloatArray

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
