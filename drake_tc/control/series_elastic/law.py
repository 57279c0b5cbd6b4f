"""The torque laws of `SeriesElasticSpec` as a function of what is read now and what is remembered.

With D the loop delay in ticks, K = Rm/(kt N), F_v = tau_v + ke kt N^2/Rm, J = Jm N^2 (the printed law drops N^2):

    v[k]     = K ( F_v y[k] + tau_f + J theta''_ref + r + kp (r~ - tau[k]) )                           (inverse)
    r        = desired torque, shaped: its cubic `horizon` and half a tick ahead, the middle of the voltage's hold
    theta''_ref = q''_ref + r''/Ks, r'' `spring_time` earlier: the link's, and that of winding a spring with damping
    r~       = (r[k-D] + r[k-D-1])/2
    y[k]     = (1 - a) (y[k-1] + g[k]) + a theta'+,   a = 1 - exp(-speed_bandwidth dt)                 (speed)
    g        = the growth of theta'_ref = q'_ref + r'/Ks in a tick
    theta'+  = theta' + all g under way: of the last D ticks, and of those since the middle of what theta' is taken over

theta'+ is the speed when the voltage arrives: the measured speed, and the commanded changes that are still under way.
The printed law has F_v theta'. D ticks late, that takes the motor its own damping by back-EMF and gives it an inertia
of F_v D dt instead (15 ms: several times J): the joint rings on its spring, and neither P nor observer can be closed
around it. So the desired speed is fed forward, and the measured speed corrects it slowly.
r~ is what the torque should be *now*: P then corrects errors of the model and leaves the delay alone; against r it
would fight the delay.

    tau_f:  s[k] + leak (tau_co - s at the step observed),  s = tau_co0 tanh(y/v_s)     `observer`
            leak tau_co                                                              `last_step_friction`
            of the momentum observer, or s                                           the others
            with tau_co the friction observed over the last step, tau_co0 the motor model's: while the joint keeps its
            direction the first two are one; where it turns round on its way, the first knows it before it is observed
    pi:     v = K ( kp (tau_ref - tau) + ki int (tau_ref - tau) ), the integral held where v is at its limit
"""

from typing import NamedTuple

import numpy as np

from drake_tc.actuation.joint_values import Models, model_list
from drake_tc.control.series_elastic.friction import motor_arrays, observer_weights
from drake_tc.control.series_elastic.memory import MEMORY_ROWS, cubic_weights, padded
from drake_tc.control.series_elastic.spec import WITH_P, SeriesElasticSpec
from drake_tc.kernels.calls import SPRING_LAW, KernelCall
from drake_tc.kernels.lazy import Kernel
from drake_tc.types import FloatArray

_LAW = Kernel("series_elastic", "law")
_FRICTION = ("pi", "observer", "last_step_friction", "momentum_observer")
"""Laws in the order of `drake_tc.kernels.series_elastic`; others take friction from the parameters."""


class Readings(NamedTuple):
    """Of one tick, (n,) each: motor angle, torque, desired torque, desired acceleration of the link."""

    angle: FloatArray
    torque: FloatArray
    desired: FloatArray
    acceleration: FloatArray


class SeriesElasticLaw:
    """A law compiled for n motors; holds no changing data.

    Attributes:
        spec, motors, dt: What it was built of.
        length: Ticks of the memory.
        state_size: Of the state: memory (length, 8, n) of `MemoryRow`, then (3, n) the law's integral, its last
            friction and the speed y, then 1 once there was a tick.
    """

    def __init__(self, spec: SeriesElasticSpec, motors: Models, dt: float) -> None:
        """Compile.

        Args:
            spec: Which law.
            motors: What it takes the motors for, one a joint.
            dt: Period [s].

        Raises:
            ParamsError: no motor, or times that are no whole number of periods.
        """
        self.spec, self.motors, self.dt = spec, model_list(motors), dt
        delay, step, speed = (spec.ticks(name, dt) for name in ("delay", "step", "speed_step"))
        window = spec.ticks("reference_window", dt) + 1
        back = speed // 2
        self.length = length = max(delay + step + 2, delay + back + 1, step + 3, window + 1, speed + 1)
        motor = motor_arrays(self.motors)
        ahead = 0.5 + spec.horizon / dt if window > 1 else 0.0
        wound = ahead - spec.spring_time / dt
        slope = cubic_weights(window, wound, 1, dt)
        under_way = padded(np.full(delay + back, 1.0), length)
        under_way[length - 1 - delay - back] = 1.0 if speed % 2 else 0.5
        taps = (
            padded(cubic_weights(window, ahead, 0, dt), length),
            padded(cubic_weights(window, wound, 2, dt), length),
            padded(slope, length) - padded(slope, length, 1),
            padded(np.array([-1.0, *np.zeros(speed - 1), 1.0]) / (speed * dt), length),
            under_way,
            padded(np.full(step, 1.0 / step), length, delay + 2),
        )
        friction = _FRICTION.index(spec.mode) if spec.mode in _FRICTION else len(_FRICTION)
        correct = -np.expm1(-spec.speed_bandwidth * dt)
        options = (dt, spec.kp, spec.ki, spec.leak, correct, spec.friction_speed, spec.momentum_gain)
        rows = (motor.torque_per_volt, motor.damping, motor.inertia, motor.coulomb, motor.compliance, motor.limit)
        self._tables = (
            np.array([length, delay, friction, spec.mode in WITH_P, window == 1], dtype=np.int64),
            np.array(taps),
            observer_weights(motor, delay, step, dt, length).reshape(length, -1),
            np.array(rows),
            np.array(options),
        )
        self.state_size = (length * MEMORY_ROWS + 3) * self.size + 1

    @property
    def size(self) -> int:
        """Joints n."""
        return len(self.motors)

    def step(self, state: FloatArray, now: Readings, after: FloatArray, rows: FloatArray) -> None:
        """One tick.

        Args:
            state: (`state_size`,); zeros at the first tick, which takes joints to have stood as they stand.
            now: Readings of this tick; the last good value, or 0, stands in for what is not finite.
            after: (`state_size`,) written.
            rows: (4, n) voltage, friction taken for it, desired torque as shaped, and 1 where a reading is not finite;
                written.
        """
        _LAW(*now, state, *self._tables, after, rows)

    def bind(self, state: FloatArray, now: Readings, after: FloatArray, rows: FloatArray) -> KernelCall:
        """`step` on arrays that stay the same objects."""

        def step(time: float) -> None:
            self.step(state, now, after, rows)

        return KernelCall(SPRING_LAW, step, *now, state, *self._tables, after, rows)
