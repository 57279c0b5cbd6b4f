"""The motors as the torque laws take them, and the weights with which they observe friction in one step."""

from dataclasses import dataclass

import numpy as np

from drake_tc.actuation.joint_values import Models, model_list
from drake_tc.control.series_elastic.memory import MemoryRow, padded
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray


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
