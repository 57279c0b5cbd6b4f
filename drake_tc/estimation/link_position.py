"""`LinkPosition`: where links behind series springs are, by the encoders and gauges before them."""

import numpy as np

from drake_tc.actuation.joint_effects import CONTACT_DAMPING
from drake_tc.array_stage import Arrays, ArrayStage, StageSystem, places
from drake_tc.types import BoolArray, Call, FloatArray

LARGEST = 1e9
"""No reading in SI units is as large; one that is counts as not finite."""


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


class LinkPosition(StageSystem):
    """Positions of n links behind springs with damping, tau = (d + t_d d')/c of the deflection d = theta - q.

    Inputs (n each):
        motor_angle: theta, before the spring [rad].
        torque: tau of the spring, as measured [N m].
    Outputs, with direct feedthrough of both:
        position (n): q [rad], always finite.
        fault (n): 1 where an input is not finite (or beyond `LARGEST`): the last position stands in, 0 before any.
    State x: d of the last tick (n), its position (n), whether there was one (1). With s = dt/(dt + t_d),

        d[n+1] = d[n] + s (c tau[n] - d[n]),   y[n] = theta[n] - d[n+1];   d[1] = c tau[0]

    so t_d = 0 gives y = theta - c tau; while tau is lost, d stays.
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
        self._n, self._dt = n, dt
        self._declare({"motor_angle": n, "torque": n})

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        n = self._n

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            held, after, given, out = arrays.before, arrays.after, arrays.inputs, arrays.out
            motor, torque, deflection = given["motor_angle"], given["torque"], np.zeros(n)

            def outputs(time: float) -> None:
                lost = _lost(motor, torque)
                deflection[:], out[:n] = self._solve(held, motor, torque, lost)
                out[n:] = lost

            def update(time: float) -> None:
                after[:n], after[n:-1], after[-1] = deflection, out[:n], 1.0

            return outputs, update

        ports, reads = places({"position": slice(n), "fault": slice(n, 2 * n)}), frozenset({"motor_angle", "torque"})
        return ArrayStage(2 * n, ports, bind, reads, start=np.zeros(2 * n + 1), period=self._dt)

    def _solve(
        self, held: FloatArray, motor: FloatArray, torque: FloatArray, lost: BoolArray
    ) -> tuple[FloatArray, FloatArray]:
        """(n,) d and (n,) position of this tick, from the state of the tick before."""
        n, told = self._n, np.abs(torque) < LARGEST
        deflection = self._compliance * np.where(told, torque, 0.0)
        if held[-1]:
            deflection = np.where(told, held[:n] + self._share * (deflection - held[:n]), held[:n])
        return deflection, np.where(lost, held[n:-1], np.where(lost, 0.0, motor) - deflection)


def _lost(motor: FloatArray, torque: FloatArray) -> BoolArray:
    """(n,) where an input is not finite."""
    return ~((np.abs(motor) < LARGEST) & (np.abs(torque) < LARGEST))
