"""The torque laws of `SeriesElasticSpec` as plain functions of what is read now and what is remembered.

With D the loop delay in ticks, K = Rm/(kt N), F_v = tau_v + ke kt N^2/Rm, J = Jm N^2 (the printed law drops N^2):

    v[k]     = K ( F_v y[k] + tau_f + J theta''_ref + r + kp (r~ - tau[k]) )                           (inverse)
    r        = desired torque, shaped: its cubic `horizon` and half a tick ahead, the middle of the voltage's hold
    theta''_ref = q''_ref + r''/Ks, r'' `spring_time` earlier: the link's, and that of winding a spring with damping
    r~       = (r[k-D] + r[k-D-1])/2
    y[k]     = (1 - a) (y[k-1] + g[k]) + a theta'+,   a = 1 - exp(-speed_bandwidth dt)                 (speed)
    g        = the growth of theta'_ref = q'_ref + r'/Ks in a tick
    theta'+  = theta' + all g under way: of the last D ticks, and of those since the middle of what theta' is taken over

theta'+ is the speed when the voltage arrives: what is measured, and what was asked for since and is still under way.
The printed law has F_v theta'. D ticks late, that takes the motor its own damping by back-EMF and gives it an inertia
of F_v D dt instead (15 ms: several times J): the joint rings on its spring, and neither P nor observer can be closed
around it. So the speed that was asked for is fed forward, and what is measured corrects it slowly.
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
from drake_tc.control.series_elastic.friction import momentum_step, motor_arrays, observer_weights
from drake_tc.control.series_elastic.memory import MEMORY_ROWS, MemoryRow, cubic_weights, padded
from drake_tc.control.series_elastic.spec import WITH_P, SeriesElasticSpec
from drake_tc.types import FloatArray

VOLTAGE, ANGLE, TORQUE, DESIRED, SHAPED, LINK, FASTER, DRY = map(int, MemoryRow)
"""As plain numbers: numpy takes twice as long over an index that is an IntEnum."""


class Readings(NamedTuple):
    """Of one tick, (n,) each: motor angle, torque, desired torque, desired acceleration of the link."""

    angle: FloatArray
    torque: FloatArray
    desired: FloatArray
    acceleration: FloatArray


class Answer(NamedTuple):
    """Of one tick, (n,) each: voltage, friction taken for it, desired torque as shaped; and the next memory."""

    voltage: FloatArray
    friction: FloatArray
    shaped: FloatArray
    kept: FloatArray
    integral: FloatArray
    """(3, n): the law's integral, its last friction, the speed y."""


class SeriesElasticLaw:
    """A law compiled for n motors; holds no changing data."""

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
        self._motor = motor_arrays(self.motors)
        self._observe = observer_weights(self._motor, delay, step, dt, length)
        ahead = 0.5 + spec.horizon / dt if window > 1 else 0.0
        self._shape = padded(cubic_weights(window, ahead, 0, dt), length)
        wound = ahead - spec.spring_time / dt
        self._curve = padded(cubic_weights(window, wound, 2, dt), length)
        slope = cubic_weights(window, wound, 1, dt)
        self._faster = padded(slope, length) - padded(slope, length, 1)
        self._speed = padded(np.array([-1.0, *np.zeros(speed - 1), 1.0]) / (speed * dt), length)
        self._under_way = padded(np.full(delay + back, 1.0), length)
        self._under_way[length - 1 - delay - back] = 1.0 if speed % 2 else 0.5
        self._felt = padded(np.full(step, 1.0 / step), length, delay + 2)
        self._correct = -np.expm1(-spec.speed_bandwidth * dt)
        self._due = slice(length - 2 - delay, length - delay)
        self._plain = window == 1
        self._none = np.zeros(self.size)

    @property
    def size(self) -> int:
        """Joints n."""
        return len(self.motors)

    def at_rest(self, now: Readings) -> FloatArray:
        """Memory (length, MEMORY_ROWS, n) of joints that have stood as they stand now, and desired the same."""
        kept = np.zeros((self.length, MEMORY_ROWS, self.size))
        kept[:, ANGLE], kept[:, TORQUE] = now.angle, now.torque
        kept[:, DESIRED] = kept[:, SHAPED] = now.desired
        return kept

    def step(self, before: FloatArray, integral: FloatArray, now: Readings) -> Answer:
        """One tick.

        Args:
            before: Memory (length, MEMORY_ROWS, n), its last row of the tick before.
            integral: (3, n) as the last Answer left it.
            now: Readings of this tick, all finite.
        """
        kept = np.empty((self.length, MEMORY_ROWS, self.size))
        kept[:-1], last = before[1:], kept[-1]
        last[:] = 0.0
        last[ANGLE], last[TORQUE], last[DESIRED] = now.angle, now.torque, now.desired
        if self.spec.mode == "pi":
            return self._proportional_integral(kept, integral, now)
        last[SHAPED], winding, faster = self._shaped(kept)
        last[LINK] = now.acceleration
        last[FASTER] = faster + 0.5 * self.dt * (now.acceleration + kept[-2, LINK])
        speed = self._speed @ kept[:, ANGLE]
        arriving = speed + self._under_way @ kept[:, FASTER]
        asked = integral[2] + last[FASTER]
        arriving = asked + self._correct * (arriving - asked)
        integral = np.array((integral[0], integral[1], arriving))
        last[DRY] = self._motor.coulomb * np.tanh(arriving / self.spec.friction_speed)
        friction, integral = self._friction(kept, integral, speed)
        motor = self._motor
        torque = motor.damping * arriving + friction + motor.inertia * (now.acceleration + winding) + last[SHAPED]
        if self.spec.mode in WITH_P:
            first, second = kept[self._due, SHAPED]
            torque = torque + self.spec.kp * (0.5 * (first + second) - now.torque)
        last[VOLTAGE] = np.minimum(np.maximum(torque / motor.torque_per_volt, -motor.limit), motor.limit)
        return Answer(last[VOLTAGE], friction, last[SHAPED], kept, integral)

    def _shaped(self, kept: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """R (n,) of the newest tick, and what winding the spring adds to theta''_ref and to g."""
        if self._plain:
            return kept[-1, DESIRED], self._none, self._none
        desired, soft = kept[:, DESIRED], self._motor.compliance
        return self._shape @ desired, soft * (self._curve @ desired), soft * (self._faster @ desired)

    def _friction(self, kept: FloatArray, integral: FloatArray, speed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The dry friction (n,) that the voltage is to overcome, and the law's integral with the observer's in it."""
        spec, motor, dry = self.spec, self._motor, kept[-1, DRY]
        if spec.mode in ("observer", "last_step_friction"):
            seen = np.einsum("lkn,lkn->n", self._observe, kept[:, :3])
            if spec.mode == "last_step_friction":
                return spec.leak * seen, integral
            return dry + spec.leak * (seen - self._felt @ kept[:, DRY]), integral
        if spec.mode == "momentum_observer":
            volts, torque = kept[-2, VOLTAGE], kept[-1, TORQUE]
            found, total = momentum_step(
                motor, spec.momentum_gain, integral[0], volts, (speed, integral[1]), torque, self.dt
            )
            return found, np.stack([total, found, integral[2]])
        return dry, integral

    def _proportional_integral(self, kept: FloatArray, integral: FloatArray, now: Readings) -> Answer:
        error = now.desired - now.torque
        total = integral[0] + self.dt * error
        wish = (self.spec.kp * error + self.spec.ki * total) / self._motor.torque_per_volt
        volts = np.clip(wish, -self._motor.limit, self._motor.limit)
        held = (wish != volts) & (np.sign(wish) == np.sign(error))
        kept[-1, VOLTAGE], kept[-1, SHAPED] = volts, now.desired
        none = np.zeros(self.size)
        return Answer(volts, none, now.desired, kept, np.stack([np.where(held, integral[0], total), none, none]))
