"""`StageValues`: outputs and states of stages in a Context, whether they are systems of their own or fused."""

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, OutputPort, System

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
            ParamsError: The port is one of a fused stage, and nothing reads it.
        """
        system: Any = port.get_system()
        if self._fused is None or not self._fused.replaces(system):
            return np.array(port.Eval(system.GetMyContextFromRoot(self._root)))
        return self._fused.output(self._own(self._fused), port)

    def input(self, system: System, name: str) -> FloatArray:
        """Value of a vector input port.

        Raises:
            ParamsError: The port is one of a fused stage, and is not connected, or the stage does not use it.
        """
        if self._fused is None or not self._fused.replaces(system):
            return np.array(system.GetInputPort(name).Eval(system.GetMyContextFromRoot(self._root)))
        return self._fused.input(self._own(self._fused), system, name)

    def next_state(self, system: System) -> FloatArray:
        """(S,) x[n+1] of a system with one group of discrete state and one periodic update."""
        if self._fused is None or not self._fused.replaces(system):
            after: Any = system.EvalUniquePeriodicDiscreteUpdate(system.GetMyContextFromRoot(self._root))
            return np.array(after.value())
        return self._fused.next_state(self._own(self._fused), system)

    def set_state(self, system: System, state: FloatArray) -> None:
        """Set the discrete state (S,) of a system with one group of it."""
        values: Any = state
        if self._fused is None or not self._fused.replaces(system):
            system.GetMyMutableContextFromRoot(self._root).SetDiscreteState(values)
        else:
            self._fused.set_state(self._own(self._fused), system, state)

    def context_of(self, system: System) -> Any:
        """The Context of a system that `fuse` leaves as it is."""
        return system.GetMyMutableContextFromRoot(self._root)

    def _own(self, fused: FusedStages) -> Any:
        return self.context_of(fused)
