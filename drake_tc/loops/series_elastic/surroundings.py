"""What acts on the joint from outside: the hand, and the reference."""

from typing import Any

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.actuation.recorded_run import Link
from drake_tc.loops.series_elastic.scenario import HandSpec, ReferenceSpec
from drake_tc.types import FloatArray


class Hand(LeafSystem):
    """torque = k (q_h - q) + d (q'_h - q'), on the link.

    Inputs: state (2): [q; q'] of the link; motion (2): [q_h; q'_h].
    Output, with direct feedthrough, no state: torque (1) [N m].
    """

    def __init__(self, stiffness: float, damping: float) -> None:
        """Declare ports; [N m/rad], [N m s/rad]."""
        super().__init__()
        self._gains = np.array([stiffness, damping])
        self._state: Any = self.DeclareVectorInputPort("state", 2)
        self._motion: Any = self.DeclareVectorInputPort("motion", 2)
        self.DeclareVectorOutputPort("torque", 1, self._write, {self._state.ticket(), self._motion.ticket()})

    def _write(self, context: Context, vector: BasicVector) -> None:
        vector.SetAtIndex(0, float(self._gains @ (self._motion.Eval(context) - self._state.Eval(context))))


class PositionLoop(LeafSystem):
    """tau_ref = M q''_d + m g l sin q_d + k (q_d - q) + d (q'_d - q'), of one link.

    Inputs: state (2): [q; q'] of the link, as known; motion (3): [q_d; q'_d; q''_d].
    Output, with direct feedthrough, no state: torque (1) [N m].
    """

    def __init__(self, link: Link, stiffness: float, damping: float) -> None:
        """Declare ports; gains [N m/rad], [N m s/rad]."""
        super().__init__()
        self._link, self._gains = link, np.array([stiffness, damping])
        self._state: Any = self.DeclareVectorInputPort("state", 2)
        self._motion: Any = self.DeclareVectorInputPort("motion", 3)
        self.DeclareVectorOutputPort("torque", 1, self._write, {self._state.ticket(), self._motion.ticket()})

    def _write(self, context: Context, vector: BasicVector) -> None:
        motion = self._motion.Eval(context)
        carried = self._link.inertia * motion[2] + self._link.gravity_moment * np.sin(motion[0])
        vector.SetAtIndex(0, float(carried + self._gains @ (motion[:2] - self._state.Eval(context))))


class LinkState(LeafSystem):
    """The link behind the spring as the fine encoder and the gauge tell it, every dt.

        y = theta - c tau,   v[n+1] = v[n] + SHARE (z[n] - v[n]),   z[n] = (y[n] - y[n-1])/dt

    Inputs: motor_angle (1) [rad]; torque (1) [N m].
    Output: state (2): [y; v'], v' the speed with this tick's z in it; feeds through.
    State: y, v of the last tick, and whether there was one.
    """

    SHARE = 0.2

    def __init__(self, compliance: float, dt: float) -> None:
        """Declare ports and state; c of the spring [rad/(N m)], period [s]."""
        super().__init__()
        self._compliance, self._dt = compliance, dt
        self._angle: Any = self.DeclareVectorInputPort("motor_angle", 1)
        self._torque: Any = self.DeclareVectorInputPort("torque", 1)
        index = self.DeclareDiscreteState(3)
        self._last = int(index)
        tickets = {self._angle.ticket(), self._torque.ticket(), self.discrete_state_ticket(index)}
        self.DeclareVectorOutputPort("state", 2, self._write, tickets)
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)

    def _now(self, context: Any) -> tuple[float, float]:
        y = float(self._angle.Eval(context)[0] - self._compliance * self._torque.Eval(context)[0])
        last, speed, started = context.get_discrete_state(self._last).value().tolist()
        return y, speed + self.SHARE * ((y - last) / self._dt - speed) if started > 0.5 else 0.0

    def _write(self, context: Context, vector: BasicVector) -> None:
        now: Any = np.array(self._now(context))
        vector.SetFromVector(now)

    def _update(self, context: Context, values: Any) -> None:
        values.set_value(self._last, np.array([*self._now(context), 1.0]))


def reference_path(spec: ReferenceSpec, duration: float, dt: float) -> PiecewisePolynomial:
    """The reference torque or angle (1), exact at the ticks, with two derivatives."""
    time = np.arange(round(duration / dt) + 3, dtype=np.float64) * dt
    rise = smooth_step((time - spec.begin) / spec.ramp)
    phase = 2.0 * np.pi * spec.frequency_hz * (time - spec.begin)
    values = rise * (spec.offset + spec.amplitude * np.sin(phase))
    make: Any = PiecewisePolynomial.CubicWithContinuousSecondDerivatives
    path: PiecewisePolynomial = make(time, values[None, :], np.zeros(1), np.zeros(1))
    return path


def hand_path(spec: HandSpec, duration: float, dt: float) -> PiecewisePolynomial:
    """(2) [q_h; q'_h]: straight lines whose corners are rounded by a running mean over `rounding`."""
    time = np.arange(round(duration / dt) + 3, dtype=np.float64) * dt
    if not spec.times:
        return _path(PiecewisePolynomial.ZeroOrderHold, np.array([0.0, duration + 1.0]), np.zeros((2, 2)))
    fine = np.linspace(-0.5, 0.5, 41) * spec.rounding
    values = np.mean([np.interp(time + shift, spec.times, spec.knots) for shift in fine], axis=0)
    both: Any = np.stack([values, np.gradient(values, dt)])
    return _path(PiecewisePolynomial.FirstOrderHold, time, both)


def _path(make: Any, time: Any, values: Any) -> PiecewisePolynomial:
    path: PiecewisePolynomial = make(time, values)
    return path


def smooth_step(x: FloatArray) -> FloatArray:
    """0 before 0, 1 after 1, 10 x^3 - 15 x^4 + 6 x^5 between: two continuous derivatives."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * x**2))
