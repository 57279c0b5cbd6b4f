"""Functions that are put into their caller: those that call entries of other stages, and one-line equations."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])


def inlined(function: F) -> F:
    """A part of an entry or of a helper, put into it before it is compiled.

    As a `compiling.helper` it would be a library of its own with a copy of each entry that it calls, and these copies
    would all be optimised anew: a dozen of them around Newton's method take minutes.
    """
    part: F = numba.njit(inline="always", error_model="numpy")(function)
    return part
