"""What every task is: named rows of a least-squares cost at one state, following a reference."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import TaskRows, Terms
from drake_tc.types import FloatArray, IntArray

Gains = float | Sequence[float] | FloatArray


class Task(Protocol):
    """sum over rows of (weight (A y - a))^2 at a state, y = (vdot, f, tau).

    Attributes:
        name: Of the binding in a program and of the reference's port.
        weight: (r,) of each row; it is squared in the cost.
        reference_size: Of the vector that `rows` follows.
    """

    @property
    def name(self) -> str:
        """Of the task."""
        ...

    @property
    def weight(self) -> FloatArray:
        """Of each row."""
        ...

    @property
    def reference_size(self) -> int:
        """Of the vector that `rows` follows."""
        ...

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing where `terms` are: to stay, to rest, no force."""
        ...

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state; never raises on numbers, a NaN stays one."""
        ...


def gains(where: str, value: Gains, size: int) -> FloatArray:
    """(size,) from one number for all or a vector.

    Raises:
        ParamsError: another size, a number that is not finite, or a negative one.
    """
    try:
        given = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ParamsError(f"{where}: expected a number or {size} of them, got {value!r}") from None
    if given.ndim > 1 or (given.ndim == 1 and given.size != size):
        raise ParamsError(f"{where}: expected a number or {size} of them, got shape {given.shape}")
    if not (np.isfinite(given).all() and (given >= 0.0).all()):
        raise ParamsError(f"{where}: expected finite numbers >= 0, got {given.tolist()}")
    full = np.full(size, given) if given.ndim == 0 else given.copy()
    full.setflags(write=False)
    return full


def axes(where: str, mask: Sequence[bool] | None, size: int) -> IntArray:
    """Indices of the chosen axes; a mask of None is for all of them.

    Raises:
        ParamsError: another size, or no axis at all.
    """
    if mask is None:
        return np.arange(size)
    if len(mask) != size or not all(isinstance(value, (bool, np.bool_)) for value in mask):
        raise ParamsError(f"{where}: expected {size} of true or false, got {list(mask)!r}")
    if not any(mask):
        raise ParamsError(f"{where}: expected at least one axis, got none")
    return np.flatnonzero(mask)


def check_frame(where: str, model: TsidModel, frame: str) -> str:
    """A frame of the model.

    Raises:
        ParamsError: it is not there.
    """
    names = model.frame_names()
    if frame not in names:
        raise ParamsError(f"{where}: no frame {frame!r}; frames: {', '.join(names)}")
    return frame
