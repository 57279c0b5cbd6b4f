"""`StageValues`: outputs and states of stages in a Context, whether they are systems of their own or fused."""

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, OutputPort, System

from drake_tc.errors import ParamsError
from drake_tc.loops.fused.system import FusedStages
from drake_tc.types import FloatArray


class StageValues:
    """Reads outputs and inputs, and reads and sets states, of the stages of a diagram in a Context.

    A stage that `fuse` has removed has no Context of its own; its values are those of the system that replaces it.
    """

    def __init__(self, root: Context, fused: FusedStages | None = None) -> None:
        """Keep the Context.

        Args:
            root: Of the whole diagram.
            fused: What `fuse` returned; None: every stage is a system of the diagram.
        """
        self._root: Any = root
        self._fused = fused

    def output(self, port: OutputPort) -> FloatArray:
        """Value of an output port.

        Raises:
            ParamsError: The port is one of a fused stage, and nothing reads it; or as `context_of`.
        """
        system: Any = port.get_system()
        fused = self._replacing(system)
        if fused is None:
            return np.array(port.Eval(self.context_of(system)))
        return fused.output(self.context_of(fused), port)

    def input(self, system: System, name: str) -> FloatArray:
        """Value of a vector input port.

        Raises:
            ParamsError: The port is one of a fused stage, and is not connected, or the stage does not use it; or as
                `context_of`.
        """
        fused = self._replacing(system)
        if fused is None:
            return np.array(system.GetInputPort(name).Eval(self.context_of(system)))
        return fused.input(self.context_of(fused), system, name)

    def next_state(self, system: System) -> FloatArray:
        """(S,) x[n+1] of a system with one group of discrete state and one periodic update.

        Raises:
            ParamsError: The system is a fused stage without state; or as `context_of`.
        """
        fused = self._replacing(system)
        if fused is None:
            after: Any = system.EvalUniquePeriodicDiscreteUpdate(self.context_of(system))
            return np.array(after.value())
        return fused.next_state(self.context_of(fused), system)

    def set_state(self, system: System, state: FloatArray) -> None:
        """Set the discrete state (S,) of a system with one group of it.

        Raises:
            ParamsError: The system is a fused stage without state, or with one of another size; or as `context_of`.
        """
        fused = self._replacing(system)
        if fused is None:
            self.context_of(system).SetDiscreteState(state)
        else:
            fused.set_state(self.context_of(fused), system, state)

    def context_of(self, system: System) -> Any:
        """The Context of a system that `fuse` leaves as it is.

        Raises:
            ParamsError: The system has none in this diagram.
        """
        any_system: Any = system
        try:  # of a system that was removed from its diagram, Drake returns the root
            found = any_system.GetMyMutableContextFromRoot(self._root)
            any_system.ValidateContext(found)
        except RuntimeError as error:
            raise ParamsError(
                f"{system.get_name()!r} has no Context in this diagram; if `fuse` has removed it, expected the system"
                " that `fuse` returned"
            ) from error
        return found

    def _replacing(self, system: System) -> FusedStages | None:
        """The system in place of a fused one; None for a system of the diagram."""
        return self._fused if self._fused is not None and self._fused.replaces(system) else None
