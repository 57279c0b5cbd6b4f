"""`BlindStop`: a joint has lost two of its three sensors for good; torques fade, and the motors brake the fall."""

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_tc.port_methods import PortMethods

BLIND = 0.15
"""How long a flag is up before nothing is believed [s]: of those 0.1 s are the flag's own."""


class BlindStop(PortMethods, LeafSystem):
    """What the controllers get once `lost` has been up for `BLIND`, for good.

    Inputs: state (m) of the robot; torque (n) of the gauges; lost (1).
    Outputs, with feedthrough of the input of that name:
        state (m): NaN then, with which `RobustTsid` fades its torques by exp(-t/fade).
        torque (n): faded likewise then, so that torque control sees neither torque nor speed, and asks for no voltage:
            a motor without voltage brakes its joint by its back-EMF.
    State: ticks c since `lost` is up, c[n+1] = c[n] + 1 where it is up or c[n] has reached the limit, else 0.
    """

    def __init__(self, size: int, joints: int, fade: float, dt: float) -> None:
        """Declare ports, state and the periodic update.

        Args:
            size: m.
            joints: n.
            fade: Of the torques [s].
            dt: Period [s].
        """
        super().__init__()
        self._limit, self._nothing = float(np.ceil(BLIND / dt)), np.full(size, np.nan)
        self._rate = dt / fade
        self._known: Any = self.DeclareVectorInputPort("state", size)
        self._torque: Any = self.DeclareVectorInputPort("torque", joints)
        self._lost: Any = self.DeclareVectorInputPort("lost", 1)
        state = self.DeclareDiscreteState(1)
        self._ticks = int(state)
        own = {self.discrete_state_ticket(state)}
        self.DeclareVectorOutputPort("state", size, self._write, own | {self._known.ticket()})
        self.DeclareVectorOutputPort("torque", joints, self._write_torque, own | {self._torque.ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)

    def _write(self, context: Context, vector: Any) -> None:
        blind = context.get_discrete_state(self._ticks).GetAtIndex(0) >= self._limit
        vector.set_value(self._nothing if blind else self._known.Eval(context))

    def _write_torque(self, context: Context, vector: Any) -> None:
        blind, torque = context.get_discrete_state(self._ticks).GetAtIndex(0) - self._limit, self._torque.Eval(context)
        vector.set_value(torque if blind <= 0.0 else np.exp(-self._rate * blind) * torque)

    def _update(self, context: Context, values: DiscreteValues) -> None:
        ticks = context.get_discrete_state(self._ticks).GetAtIndex(0)
        up = ticks >= self._limit or self._lost.Eval(context)[0] > 0.0
        if ticks or up:
            values.get_mutable_vector(self._ticks).SetAtIndex(0, ticks + 1.0 if up else 0.0)
