"""`MotorPositionControl`: motors before their springs, held by their own encoders under voltage."""

from typing import Any

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from drake_tc.actuation.joint_values import Models
from drake_tc.control.series_elastic.friction import motor_arrays
from drake_tc.errors import ParamsError
from drake_tc.port_methods import PortMethods
from drake_tc.types import FloatArray


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
