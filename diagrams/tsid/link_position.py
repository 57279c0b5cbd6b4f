"""`LinkPosition`: where links behind series springs are, by the encoders and gauges before them."""

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_tc.actuation.gear import CONTACT_DAMPING
from drake_tc.types import FloatArray


def spring_times(compliance: FloatArray, motor_inertia: FloatArray, link_inertia: FloatArray) -> FloatArray:
    """(n,) damping over stiffness of springs [s] whose damping ratio between two inertias is the `elasticity` effect's.

    t_d = 2 zeta sqrt(c J M/(J + M))

    Args:
        compliance: (n,) c [rad/(N m)].
        motor_inertia: (n,) J [kg m^2].
        link_inertia: (n,) M [kg m^2].
    """
    reduced = motor_inertia * link_inertia / (motor_inertia + link_inertia)
    times: FloatArray = 2.0 * CONTACT_DAMPING * np.sqrt(compliance * reduced)
    return times


class LinkPosition(LeafSystem):  # type: ignore[misc, unused-ignore]
    """Positions of n links behind springs with damping, tau = (d + t_d d')/c of the deflection d = theta - q.

    Inputs (n each):
        motor_angle: theta, before the spring [rad].
        torque: tau of the spring, as measured [N m].
    Output, with direct feedthrough of both:
        position (n): q [rad].
    State x: d of the last tick (n), whether there was one (1). With s = dt/(dt + t_d),

        d[n+1] = d[n] + s (c tau[n] - d[n]),   y[n] = theta[n] - d[n+1];   d[1] = c tau[0]

    so t_d = 0 gives y = theta - c tau. What is not finite goes through and is not remembered.
    """

    def __init__(self, compliance: FloatArray, spring_time: FloatArray, dt: float) -> None:
        """Declare ports, state and the periodic update.

        Args:
            compliance: (n,) c [rad/(N m)].
            spring_time: (n,) t_d [s].
            dt: Period [s].
        """
        super().__init__()
        n = len(compliance)
        self._compliance = np.array(compliance, dtype=float)
        self._share = dt / (dt + np.asarray(spring_time, dtype=float))
        self._motor: Any = self.DeclareVectorInputPort("motor_angle", n)
        self._torque: Any = self.DeclareVectorInputPort("torque", n)
        state = self.DeclareDiscreteState(n + 1)
        self._state = int(state)
        self.DeclareVectorOutputPort(
            "position",
            n,
            self._write,
            {self.discrete_state_ticket(state), self._motor.ticket(), self._torque.ticket()},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)

    def _deflection(self, context: Context) -> FloatArray:
        held = context.get_discrete_state(self._state).value()
        stretched: FloatArray = self._compliance * self._torque.Eval(context)
        if not held[-1]:
            return stretched
        return np.asarray(held[:-1] + self._share * (stretched - held[:-1]))

    def _write(self, context: Context, vector: Any) -> None:
        vector.set_value(self._motor.Eval(context) - self._deflection(context))

    def _update(self, context: Context, values: DiscreteValues) -> None:
        found, held = self._deflection(context), context.get_discrete_state(self._state).value()
        after: Any = np.append(np.where(np.isfinite(found), found, held[:-1]), 1.0)
        values.set_value(self._state, after)
