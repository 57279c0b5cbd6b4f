"""`SeriesElasticControl`: desired spring torques to the voltages of series-elastic joints.

Source: Faraji et al., 2015, section II.B.

`MotorPositionControl`: motors before their springs, held by their own encoders under voltage.
"""

from typing import Any

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from drake_tc.actuation.joint_effects import Models
from drake_tc.array_stage import Arrays, ArrayStage, PortMethods, StageSystem, places
from drake_tc.control.series_elastic.law import Readings, SeriesElasticLaw, SeriesElasticSpec, motor_arrays
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import copying
from drake_tc.types import Call, FloatArray

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
