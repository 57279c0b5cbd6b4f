"""`Scratch`: the arrays of fused stages in one Context."""

from collections.abc import Callable
from typing import Any

from drake_tc.array_stage import Held
from drake_tc.errors import ParamsError
from drake_tc.types import Call, FloatArray, IntArray


class Inputs(dict[str, Any]):
    """Name of each connected input port of a stage to its value; another name is a ParamsError."""

    def __init__(self, stage: str) -> None:
        """Empty.

        Args:
            stage: Name of the stage.
        """
        super().__init__()
        self._stage = stage

    def __missing__(self, name: str) -> Any:
        raise ParamsError(f"fuse: input port {name!r} of {self._stage!r} is not connected; connect it before fusing")


class Scratch:
    """The arrays of one Context, and the stages' functions on them.

    If the output port of a level is up to date, so are the signals of this level, as its calculation writes both. In a
    cloned Context the ports may be up to date while the arrays are new and empty; `computed` tells so.

    Attributes:
        signals: (N,) all signals; the elements in the plan are indices of it.
        before, after: (S,) states of this tick and of the next one.
        given: For each input port, by its number, where its value is written.
        outputs: For each level, the functions that compute its signals.
        updates: For each period, the functions that compute the next states.
        begins: The functions that compute the states at the start of a simulation.
        computed: Number of levels whose signals have been computed at least once in these arrays.
    """

    signals: FloatArray
    before: FloatArray
    after: FloatArray
    given: list[Any]
    outputs: list[list[Call]]
    updates: dict[float | None, list[Call]]
    begins: list[Call]

    def __init__(self, bind: Callable[["Scratch"], None]) -> None:
        """Make the arrays.

        Args:
            bind: Sets all attributes but `computed`.
        """
        self._bind, self.computed = bind, 0
        bind(self)

    def __deepcopy__(self, memo: object) -> "Scratch":
        return Scratch(self._bind)


def place_of(signals: FloatArray, elements: IntArray | None) -> Any:
    """Where a value from outside is written, by `place[:] = value`."""
    return Held() if elements is None else signals[elements[0] : elements[0] + elements.size]


def read_only(view: FloatArray) -> FloatArray:
    """The view, which is not writeable from now on."""
    view.flags.writeable = False
    return view
