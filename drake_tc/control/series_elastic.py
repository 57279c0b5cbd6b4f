"""`SeriesElasticSpec`: which torque law a series-elastic joint runs, and its numbers.

The torque laws of `SeriesElasticSpec` as a function of what is read now and what is remembered.

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

What a torque law remembers: the last ticks of a few signals, all joints, newest row last.

The motors as the torque laws take them, and the weights with which they observe friction in one step.

`SeriesElasticControl`: desired spring torques to the voltages of series-elastic joints.

Source: Faraji et al., 2015, section II.B.

`MotorPositionControl`: motors before their springs, held by their own encoders under voltage.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from drake_tc.actuation.joint_effects import Models, model_list
from drake_tc.array_stage import Arrays, ArrayStage, PortMethods, StageSystem, places
from drake_tc.config.records import Checked, FromZero, Positive, Range
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import SPRING_LAW, Kernel, KernelCall, copying
from drake_tc.types import Call, FloatArray

Mode = Literal["observer", "last_step_friction", "feedforward", "feedforward_p", "pi", "momentum_observer"]
MOST_TICKS = 10_000
"""Longest time of a spec [control periods]."""
WITH_P: tuple[Mode, ...] = ("observer", "last_step_friction", "feedforward_p", "pi", "momentum_observer")
"""Laws that feed the torque error back in proportion."""


@dataclass(frozen=True)
class SeriesElasticSpec(Checked):
    """One torque law (Faraji et al., 2015, section II.B); the same interface for the paper's and for those it is
    compared with.

    Attributes:
        mode: `observer`: inverse motor model, one-step friction observer that knows reversals in advance, P.
            `last_step_friction`: the last step's friction as it was. `feedforward`: inverse motor model with the
            friction of its parameters. `feedforward_p`: the same with P. `pi`: P and I of the torque error alone.
            `momentum_observer`: as `observer`, with the generalized-momentum observer of friction.
        kp: Motor torque for a torque error [N m/(N m)]: P = kp Rm/(kt N); not used by `feedforward`.
        ki: Integral gain of `pi` [1/s].
        leak: Factor a little below 1 on the observed friction [-]; of the two one-step observers.
        step: Length of the step whose friction they take for the next [s].
        momentum_gain: K of `momentum_observer` [rad/s].
        delay: Time from a voltage being computed to it reaching the motor, plus the age of the readings [s].
        horizon: Time by which the desired torque is extrapolated [s]; 0: to the middle of the tick, for which a voltage
            is held.
        spring_time: Assumed damping of the spring over its stiffness [s].
        reference_window: Length of the stretch of the desired torque to which a cubic is fitted for its derivatives
            [s]; 0: no derivatives, for a torque that contains noisy feedback.
        speed_step: Time over which the travel of the motor gives its speed [s].
        speed_bandwidth: Bandwidth with which the measured speed corrects the desired one [rad/s].
        friction_speed: v_s [rad/s] of tanh(v/v_s) where friction is taken from the parameters.

    Raises:
        ParamsError: a value that is not possible.
    """

    mode: Mode = "observer"
    kp: FromZero = 0.3
    ki: FromZero = 0.0
    leak: Annotated[float, Range("a factor from 0 to 1", 0.0, 1.0)] = 0.98
    step: Positive = 0.005
    momentum_gain: Positive = 30.0
    delay: FromZero = 0.015
    horizon: FromZero = 0.0
    spring_time: FromZero = 0.0
    reference_window: FromZero = 0.01
    speed_step: Positive = 0.004
    speed_bandwidth: Positive = 20.0
    friction_speed: Positive = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.horizon > 0.0 and self.reference_window == 0.0:
            raise ParamsError("control.horizon: expected a reference_window > 0 to extrapolate from")

    def ticks(self, name: str, dt: float) -> int:
        """A time of the spec in control periods, one at least but for delay and window.

        Raises:
            ParamsError: it is no whole number of periods, within 1e-6 of one.
        """
        ticks: float = getattr(self, name) / dt
        if not abs(ticks) <= MOST_TICKS:
            raise ParamsError(
                f"control.{name}: expected at most {MOST_TICKS} periods of {dt:g} s; got {getattr(self, name):g} s"
            )
        if abs(ticks - round(ticks)) > 1e-6 or (round(ticks) < 1 and name not in ("delay", "reference_window")):
            raise ParamsError(
                f"control.{name}: expected a multiple of the period {dt:g} s, got {getattr(self, name):g} s"
            )
        return round(ticks)


class MemoryRow(IntEnum):
    """Rows of one tick: what was sent, read, desired."""

    VOLTAGE = 0
    ANGLE = 1
    TORQUE = 2
    DESIRED = 3
    SHAPED = 4
    LINK = 5
    FASTER = 6
    DRY = 7
    """Voltage sent [V]; motor angle [rad] and torque [N m] as read; desired torque [N m]; the same after shaping, for
    the motor; the link's desired acceleration [rad/s^2]; growth of the motor's desired speed in a tick [rad/s]; its dry
    friction by the model, in the direction in which it will move [N m]."""


MEMORY_ROWS = len(MemoryRow)


def cubic_weights(window: int, ahead: float, derivative: int, dt: float) -> FloatArray:
    """Weights (window,), oldest first, of d^k/dt^k of the least-squares cubic through the samples, at `ahead` ticks.

    A shorter window lowers the order. ahead = 0 is the newest sample; beyond it the cubic is extrapolated, which no
    filter can do for a reference that jumps.

    Args:
        window: Samples N.
        ahead: Where, in ticks after the newest sample.
        derivative: k.
        dt: Period [s].
    """
    order = min(3, window - 1)
    if derivative > order:
        return np.zeros(window)
    powers = np.vander((np.arange(window) - (window - 1.0)), order + 1, increasing=True)
    inverse = np.linalg.pinv(powers)
    factors = [
        0.0 if p < derivative else float(np.prod(np.arange(p, p - derivative, -1))) * ahead ** (p - derivative)
        for p in range(order + 1)
    ]
    return np.asarray(np.array(factors) @ inverse / dt**derivative)


def padded(weights: FloatArray, length: int, newest: int = 0) -> FloatArray:
    """Weights as (length,) on a memory whose last row they miss by `newest` rows."""
    out = np.zeros(length)
    end = length - newest
    out[end - weights.size : end] = weights
    return out


@dataclass(frozen=True, eq=False)
class MotorArrays:
    """Motors of n joints, (n,) each.

    Attributes:
        torque_per_volt: 1/K = kt N/Rm [N m/V].
        damping: F_v, friction and back-EMF [N m s/rad].
        inertia: J = Jm N^2 [kg m^2].
        coulomb: tau_co0 [N m].
        compliance: 1/Ks [rad/(N m)].
        limit: Of the voltage [V]; infinite for none.
    """

    torque_per_volt: FloatArray
    damping: FloatArray
    inertia: FloatArray
    coulomb: FloatArray
    compliance: FloatArray
    limit: FloatArray


def motor_arrays(models: Models) -> MotorArrays:
    """What the laws need of actuator models; other effects than these five are what the observer is for.

    Raises:
        ParamsError: a drive that takes no voltage, or a model without rotor inertia.
    """
    rows = []
    for model in model_list(models):
        if model.drive.kind != "voltage":
            raise ParamsError(f"joint {model.joint!r}: expected a voltage drive, got {model.drive.kind}")
        if not model.inertia > 0.0:
            raise ParamsError(f"joint {model.joint!r}: expected rotor_inertia > 0 in the model")
        known = {value.key: value.parameters for value in model.effects}
        damping = known.get("viscous", {}).get("viscous", 0.0)
        dry = known.get("coulomb", {}).get("coulomb", 0.0)
        soft = known.get("elasticity", {}).get("compliance", 0.0)
        limit = known.get("saturation", {}).get("limit", np.inf)
        rows.append((1.0 / model.drive.gain, damping, model.inertia, dry, soft, limit))
    return MotorArrays(*np.array(rows).T)


def observer_weights(motor: MotorArrays, delay: int, step: int, dt: float, length: int) -> FloatArray:
    """Weights (length, 3, n) on [voltage, angle, torque] whose sum is the Coulomb friction over the last step.

    Faraji et al. (2015), eq. 3, inverted for the friction, each term its mean over the same `step` ticks, so that
    nothing in it is older than the rest: with u[j] = v[j - D] what the motor felt after tick j, w[j] = (theta[j] -
    theta[j-1])/dt,

        tau_co = 1/n sum_j { u[j-1]/K - F_v w[j] - J (w[j+1] - w[j-1])/(2 dt) - (tau[j] + tau[j-1])/2 },
        j = k - n ... k - 1     (the difference for theta'' needs the sample after)

    Args:
        motor: The model; F_v holds the back-EMF.
        delay: D, ticks.
        step: n, ticks.
        dt: Period [s].
        length: Rows of the memory, its last one of tick k.
    """
    box = np.full(step, 1.0 / step)
    speed = (padded(box, length, 1) - padded(box, length, 2)) / dt
    ahead, behind = padded(box, length), padded(box, length, 2)
    shifted = (padded(box, length, 1) - padded(box, length, 3)) / dt
    rate = ((ahead - behind) / dt - shifted) / (2.0 * dt)
    torque = 0.5 * (padded(box, length, 1) + padded(box, length, 2))
    volts = padded(box, length, delay + 2)
    out = np.zeros((length, 3, motor.inertia.size))
    out[:, MemoryRow.VOLTAGE] = volts[:, None] * motor.torque_per_volt
    out[:, MemoryRow.ANGLE] = -speed[:, None] * motor.damping - rate[:, None] * motor.inertia
    out[:, MemoryRow.TORQUE] = -torque[:, None]
    return out


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
        _LAW(tuple(now), state, self._tables, after, rows)

    def bind(self, state: FloatArray, now: Readings, after: FloatArray, rows: FloatArray) -> KernelCall:
        """`step` on arrays that stay the same objects."""

        def step(time: float) -> None:
            self.step(state, now, after, rows)

        return KernelCall(SPRING_LAW, step, *now, state, *self._tables, after, rows)


_INPUTS = ("motor_angle", "torque", "reference_torque", "reference_acceleration")
_ROWS = ("voltage", "friction", "shaped_reference", "fault")


class SeriesElasticControl(StageSystem):
    """Torque control of n series-elastic joints, sampled every dt. See `law` for the equations.

    Inputs (n each):
        motor_angle: theta over the gear ratio, before the spring [rad].
        torque: of the springs, as measured [N m].
        reference_torque: tau_ref [N m].
        reference_acceleration: q''_ref of the links [rad/s^2]; 0 when not connected, as for a joint that is held.
    Outputs (n each), with direct feedthrough of every input:
        voltage: v [V], within the motors' limits.
        friction: the friction that it overcomes [N m].
        shaped_reference: r, the desired torque after shaping, which the motor gets [N m].
        fault: 1 where an input is not finite (or beyond 1e9): its last good value stands in.

    State x: that of the law (`SeriesElasticLaw`). With L the law,
        x[n+1], y[n] = L(x[n], u[n]);
    at the first tick x is that of joints that have stood as they stand. Nothing is raised in the loop.
    """

    def __init__(self, spec: SeriesElasticSpec, motors: Models, dt: float = 1e-3) -> None:
        """Declare the ports and compile the law.

        Args:
            spec: Which law.
            motors: What it takes the motors for, one a joint.
            dt: Period [s].

        Raises:
            ParamsError: no motor, or times that are no whole number of periods.
        """
        super().__init__()
        self._law = law = SeriesElasticLaw(spec, motors, dt)
        self._dt = dt
        self._declare(dict.fromkeys(_INPUTS, law.size))

    @property
    def law(self) -> SeriesElasticLaw:
        """The law itself."""
        return self._law

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        n = self._law.size

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            now = Readings(*(arrays.inputs.get(name, np.zeros(n)) for name in _INPUTS))
            before, rows, reached = arrays.before, arrays.out.reshape(len(_ROWS), n), np.zeros(self._law.state_size)

            return self._law.bind(before, now, reached, rows), copying(reached, arrays.after)

        parts = {name: slice(row * n, (row + 1) * n) for row, name in enumerate(_ROWS)}
        start = np.zeros(self._law.state_size)
        return ArrayStage(len(_ROWS) * n, places(parts), bind, frozenset(_INPUTS), start=start, period=self._dt)


class MotorPositionControl(PortMethods, LeafSystem):
    """Position loops of n motors before their springs, as on a drive's own board.

    Inputs (n each):
        motor_angle: theta over the gear ratio, before the spring [rad].
        reference_angle: theta_ref, where the motor would be without load [rad].
    Output (n), with direct feedthrough of both; no state:
        voltage: y = sat(K kp (theta_ref - theta)) [V], K = Rm/(kt N); 0 where an input is not finite: the motor then
            is slowed by its back-EMF alone.

    No rate is fed back: the back-EMF is a damping of F_v, so that the loop is of first order at kp/F_v below F_v/J.
    Under a torque tau the motor rests tau/kp short of theta_ref.
    """

    def __init__(self, gain: float, motors: Models) -> None:
        """Declare the ports.

        Args:
            gain: kp [N m/rad].
            motors: What it takes the motors for, one a joint: their K and the limits of their voltages.

        Raises:
            ParamsError: a gain that is not positive, or motors without a voltage drive.
        """
        super().__init__()
        if not 0.0 < gain < np.inf:
            raise ParamsError(f"position_gain: expected a positive number [N m/rad], got {gain:g}")
        arrays = motor_arrays(motors)
        n = len(arrays.limit)
        self._gain: FloatArray = gain / arrays.torque_per_volt
        self._limit = arrays.limit
        self._angle: Any = self.DeclareVectorInputPort("motor_angle", n)
        self._desired: Any = self.DeclareVectorInputPort("reference_angle", n)
        self.DeclareVectorOutputPort("voltage", n, self._write, {self._angle.ticket(), self._desired.ticket()})

    def _write(self, context: Context, vector: BasicVector) -> None:
        short = np.asarray(self._desired.Eval(context) - self._angle.Eval(context))
        volts = np.clip(self._gain * short, -self._limit, self._limit)
        sound: Any = np.where(np.isfinite(volts), volts, 0.0)
        vector.SetFromVector(sound)
