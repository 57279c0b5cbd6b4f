"""`PositionReference`: the baseline, a reference position handed straight to the drives' own position servos."""

from typing import Any

from pydrake.systems.framework import BasicVector, Context, LeafSystem

from drake_tc.errors import ParamsError


class PositionReference(LeafSystem):
    """command = q_d: what a position-controlled robot does; to be sent through the same CommandGuard.

    Input:
        reference (3n): [q_d; qdot_d; qddot_d].
    Output, with direct feedthrough, no state:
        command (n): q_d [rad].
    """

    def __init__(self, size: int) -> None:
        """Declare ports.

        Args:
            size: Joints n, all driven by position servos.

        Raises:
            ParamsError: a size below 1.
        """
        super().__init__()
        if size < 1:
            raise ParamsError(f"PositionReference: wanted at least one joint; got {size}")
        self._size = size
        self._reference: Any = self.DeclareVectorInputPort("reference", 3 * size)
        self.DeclareVectorOutputPort("command", size, self._write, {self._reference.ticket()})

    def _write(self, context: Context, vector: BasicVector) -> None:
        vector.SetFromVector(self._reference.Eval(context)[: self._size])
