"""Where the robot may push on its environment: soles that carry a wrench, points that carry a force."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.robot.fields import Mount
from drake_tc.types import FloatArray, IntArray

Kind = Literal["surface", "point"]
Axes = Literal["link", "world"]
_SIZE = {"surface": 6, "point": 3}
Extents = tuple[float, float, float, float]


@dataclass(frozen=True)
class Contact:
    """One place of contact; its frame C has its origin on the sole and z out of the ground.

    The environment pushes on the robot with [fx fy fz tx ty tz] (surface) or [fx fy fz] (point), in `axes`.

    A sole turns with the ground that it lies on, so its axes are C's. A point foot rolls: what the ground gives it does
    not turn with its link. Its axes are the world's, z up, whatever C's; with axes "link" they are C's, for a tip that
    pushes with one side (a hand against a wall).

    Attributes:
        name: As it stands in masks, labels and `Terms.frame`.
        frame: C on its link.
        kind: "surface" or "point".
        half_length, half_width: Of the sole along C's x and y [m]; surfaces only.
        extents: (x_min, x_max, y_min, y_max) of the sole in C instead of the halves, where C is not in its middle [m].
        friction: mu >= 0.
        moment_friction: Of the moment about z over the normal force, >= 0 [m].
        minimum_force, maximum_force: Of the force along z of `axes` [N].
        axes: Of its force, J and cone: "link" for C's, "world" for the world's, points only; None for "link" of a
            surface, "world" of a point.

    Raises:
        ParamsError: an unknown kind or axes, a surface with axes "world", a sole without area, C's origin outside it,
            or a number that is not possible.
    """

    name: str
    frame: Mount
    kind: Kind = "surface"
    half_length: float = 0.0
    half_width: float = 0.0
    extents: Extents | None = None
    friction: float = 0.5
    moment_friction: float = 0.1
    minimum_force: float = 1.0
    maximum_force: float = math.inf
    axes: Axes | None = None

    def __post_init__(self) -> None:
        where = f"contact {self.name!r}"
        if self.kind not in get_args(Kind):
            raise ParamsError(f"{where}: expected a kind of {', '.join(get_args(Kind))}, got {self.kind!r}")
        possible = get_args(Axes)[: 1 if self.kind == "surface" else 2]
        if self.axes is not None and self.axes not in possible:
            raise ParamsError(f"{where}: axes: expected {' or '.join(possible)} for a {self.kind}, got {self.axes!r}")
        for key in ("friction", "moment_friction", "minimum_force"):
            value = getattr(self, key)
            if not (math.isfinite(value) and value >= 0.0):
                raise ParamsError(f"{where}: {key}: expected a finite number >= 0, got {value!r}")
        if not self.maximum_force > self.minimum_force:
            raise ParamsError(
                f"{where}: maximum_force: expected more than minimum_force {self.minimum_force:g},"
                f" got {self.maximum_force!r}"
            )
        if self.extents is not None and (self.half_length or self.half_width):
            raise ParamsError(f"{where}: expected either half_length and half_width or extents, got both")
        if self.kind == "surface":
            self._check_sole(where)

    def _check_sole(self, where: str) -> None:
        x_min, x_max, y_min, y_max = self.sole
        if not (all(math.isfinite(edge) for edge in self.sole) and x_max > x_min and y_max > y_min):
            raise ParamsError(
                f"{where}: expected a sole of positive size (half_length and half_width, or extents x_min x_max y_min"
                f" y_max) [m], got {', '.join(f'{edge:g}' for edge in self.sole)}"
            )
        if not (x_min <= 0.0 <= x_max and y_min <= 0.0 <= y_max):
            raise ParamsError(
                f"{where}: extents: expected the frame's origin on the sole, got {', '.join(map(str, self.sole))}"
            )

    @property
    def size(self) -> int:
        """How many numbers its force has: 6 or 3."""
        return _SIZE[self.kind]

    @property
    def upright(self) -> bool:
        """Whether its axes are the world's."""
        return self.kind == "point" and self.axes != "link"

    @property
    def sole(self) -> Extents:
        """(x_min, x_max, y_min, y_max) in C [m]."""
        if self.extents is not None:
            return self.extents
        return -self.half_length, self.half_length, -self.half_width, self.half_width

    @property
    def corners(self) -> FloatArray:
        """(4, 3) of the sole in C, counter-clockwise; a point's own place (1, 3)."""
        if self.kind == "point":
            return np.zeros((1, 3))
        x_min, x_max, y_min, y_max = self.sole
        return np.array([[x_max, y_max, 0.0], [x_min, y_max, 0.0], [x_min, y_min, 0.0], [x_max, y_min, 0.0]])


@dataclass(frozen=True, eq=False)
class ActiveContacts:
    """The contacts that carry at one instant, and where each stands in f.

    Attributes:
        contacts: Those that are active, in the model's order.
        index: Of each among all contacts of the model.
        places: (a,) the same as an array.
        rows: Of each in f (k,).
        entries: (k,) of f in a vector that holds the forces of all contacts of the model.
        size: k.
    """

    contacts: tuple[Contact, ...]
    index: tuple[int, ...]
    places: IntArray
    rows: tuple[slice, ...]
    entries: IntArray
    size: int


def select(contacts: Sequence[Contact], active: Sequence[bool] | None = None) -> ActiveContacts:
    """Those of `contacts` that are active; None for all of them.

    Raises:
        ParamsError: a mask of another length.
    """
    mask = tuple(active) if active is not None else (True,) * len(contacts)
    if len(mask) != len(contacts):
        raise ParamsError(f"active: expected one value a contact ({len(contacts)}), got {len(mask)}")
    chosen, index, rows = [], [], []
    entries: list[int] = []
    start = first = 0
    for i, contact in enumerate(contacts):
        if mask[i]:
            chosen.append(contact)
            index.append(i)
            rows.append(slice(start, start + contact.size))
            entries.extend(range(first, first + contact.size))
            start += contact.size
        first += contact.size
    places = np.array(index, dtype=np.int64)
    return ActiveContacts(tuple(chosen), tuple(index), places, tuple(rows), np.array(entries, dtype=np.int64), start)
