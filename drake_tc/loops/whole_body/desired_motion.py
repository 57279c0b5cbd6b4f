"""How the joints will move if the controller has its way: what the drives' friction is compensated for."""

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, LeafSystem

from drake_tc.array_stage import Arrays, ArrayStage, places
from drake_tc.tsid.model import TsidModel
from drake_tc.types import Call, FloatArray


class DesiredMotion(LeafSystem):
    """The motion of the joints that the controller's accelerations lead to, half a period ahead.

    Inputs:
        estimated_state (nq + nv): [q; v] as the controller knows it.
        acceleration (nv): of the controller.
    Output:
        reference (3n): [q; qdot + qddot period/2; qddot] in the robot's order; follows both inputs at once, no state.
    """

    def __init__(self, model: TsidModel, period: float) -> None:
        """Declare the ports.

        Args:
            model: Of the controller.
            period: Of the controller [s].
        """
        super().__init__()
        self._model, self._ahead = model, 0.5 * period
        self._state: Any = self.DeclareVectorInputPort("estimated_state", model.nq + model.nv)
        self._acceleration: Any = self.DeclareVectorInputPort("acceleration", model.nv)
        tickets = {self._state.ticket(), self._acceleration.ticket()}
        self.DeclareVectorOutputPort("reference", 3 * model.n, self._write, tickets)

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        names = ("estimated_state", "acceleration")

        def bind(arrays: Arrays) -> tuple[Call, None]:
            (state, acceleration), out = (arrays.inputs[name] for name in names), arrays.out

            def outputs(time: float) -> None:
                out[:] = self._reference(state, acceleration)

            return outputs, None

        ports = places({"reference": slice(3 * self._model.n)})
        return ArrayStage(3 * self._model.n, ports, bind, frozenset(names))

    def _reference(self, state: FloatArray, acceleration: FloatArray) -> FloatArray:
        """(3n,) the output."""
        model = self._model
        own = acceleration[model.actuated]
        velocity = state[model.nq + model.actuated] + self._ahead * own
        return np.concatenate((state[model.positions], velocity, own))

    def _write(self, context: Context, vector: Any) -> None:
        vector.set_value(self._reference(self._state.Eval(context), self._acceleration.Eval(context)))
