"""A reference as a source of a controller's port."""

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, LeafSystem

from drake_tc.array_stage import Arrays, ArrayStage, places
from drake_tc.control.references import Path, Swing
from drake_tc.port_methods import PortMethods
from drake_tc.types import Call

_ALWAYS = np.array([np.inf])


class ReferenceSource(PortMethods, LeafSystem):
    """What a task follows, as a function of time alone.

    Output:
        reference (path.size): y(t) = path.row(t); no state, no input.

    Example:
        >>> from drake_tc.control.references import PointToPoint
        >>> ReferenceSource(PointToPoint((0.0, 0.0, 0.9), (0.05, 0.0, 0.9), 0.5, 1.0)).get_output_port().size()
        9
    """

    def __init__(self, path: Path) -> None:
        """Declare the port.

        Args:
            path: What to follow; its rows must be those of the task.
        """
        super().__init__()
        self._path = path
        self.DeclareVectorOutputPort("reference", path.size, self._write, {self.time_ticket()})

    @property
    def path(self) -> Path:
        """What is followed."""
        return self._path

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""

        def bind(arrays: Arrays) -> tuple[Call, None]:
            out, path = arrays.out, self._path

            def outputs(time: float) -> None:
                out[:] = path.row(time)

            return (path.call(_ALWAYS, out, outputs) if isinstance(path, Swing) else outputs), None

        return ArrayStage(self._path.size, places({"reference": slice(self._path.size)}), bind)

    def _write(self, context: Context, vector: Any) -> None:
        vector.set_value(self._path.row(context.get_time()))
