"""A wrong scale of the torque sensor, and how effects that scale the load torque act where the drive gain is declared.

A torque sensor that reads tau_meas = (1 + g) tau leaves of the balance y/K = tau + J qddot + tau_f

    tau_meas + J qddot = (1 + g) y/K - g J qddot - (1 + g) tau_f
    tau_meas + J qddot = y/K - tau_f + s tau_meas,                    s = g/(1 + g)

A fit with a free drive gain takes (1 + g)/K for 1/K, and g shows in the column J qddot alone. A fit that holds the
drive at the declared gain K_0 = K leaves (1 + g) y/K no place: the coefficient is s, and its column -tau_meas. The
effort is in neither, so that both hold for whatever delays and limits the drive has.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_tc.effects.base import JointNumbers, Parameter, Plausible, SensorEffect, Shape, Signals, Signature
from drake_tc.effects.context import NO_INERTIA, Context
from drake_tc.types import FloatArray

HELD_GAIN = "held_gain"
"""Entry of the shape of such an effect: the gain K_0 that fits hold [effort/(N m)], or 0. It is no parameter."""


def held_gain(context: Context) -> dict[str, float]:
    """The shape of an effect that scales the balance: the gain that fits hold, or 0.

    An unknown load and fitted links take the scale themselves, so that no gain is held against them.
    """
    declared = context.declared.get("drive_gain") or 0.0
    return {HELD_GAIN: 0.0 if context.load in ("links", "unknown") else float(declared)}


def scale_column(signals: Signals, shape: Mapping[str, float]) -> FloatArray:
    """(T,) torque per unit of g or s [N m]: J qddot, or -tau where the drive is held at K_0."""
    if is_held(shape):
        return np.asarray(-signals.load_torque)
    return signals.rotor_inertia * signals.acceleration


def is_held(shape: Mapping[str, float]) -> bool:
    """Whether the drive is held at a gain."""
    return shape.get(HELD_GAIN, 0.0) > 0.0


GAIN_ERROR_RANGE = Plausible(
    -0.5,
    1.0,
    "a strain-gauge amplifier that is set to half or to twice its gain is the largest error of scale met "
    "in practice (data sheets: below 2 %)",
)


class TorqueSensorGain(SensorEffect):
    """tau_meas = (1 + g) tau [N m].

    Where the drive gain is free, a wrong scale shows only against a torque that is known without the sensor: the
    declared inertia. (tau + g tau) + (1 + g) J qddot = (1 + g)(...), hence the column J qddot. A declared drive gain is
    held, and the scale shows against it: the coefficient is then s = g/(1 + g) (`held_gain`).
    """

    id = "torque_sensor_gain"
    title = "torque sensor gain"
    equation = "tau_meas = (1 + gain_error) * tau"
    kind = "sensor"
    linear = True
    coefficients = (
        Parameter("gain_error", "-", -0.9, 10.0, description="gain of the sensor, minus 1", plausible=GAIN_ERROR_RANGE),
    )
    signature = Signature(
        x="acceleration", split="", look_for="a line over the acceleration although the inertia is declared"
    )

    def obstacle(self, context: Context) -> str:
        """Empty when the logs can show the effect."""
        if context.load != "torque":
            return "there is no torque sensor"
        if "rotor_inertia" not in context.declared or context.declared["rotor_inertia"] == 0.0:
            return NO_INERTIA
        return super().obstacle(context)

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """The gain that fits hold."""
        return [held_gain(context)]

    def balance_inertia(self, theta: FloatArray, shape: Shape, rotor_inertia: float) -> float:
        """J g, where the drive gain is free."""
        return 0.0 if is_held(shape) else rotor_inertia * float(theta[0])

    def physical(self, theta: FloatArray, shape: Shape, gain: float) -> dict[str, float]:
        """The coefficient g, or s/(1 - s)."""
        own = float(theta[0])
        return {"gain_error": own / max(1.0 - own, 1e-9) if is_held(shape) else own}

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 1): see the class."""
        return scale_column(signals, shape)[:, None]

    def torque_scale(self, theta: FloatArray, shape: Shape) -> float:
        """1 + g where the drive gain is free: the fit lives on the sensor's scale."""
        return 1.0 if is_held(shape) else 1.0 + float(theta[0])

    def corrupt(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Scale the torque."""
        return replace(signals, load_torque=signals.load_torque * (1.0 + parameters["gain_error"]))

    def restore(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Scale the torque back."""
        return replace(signals, load_torque=signals.load_torque / (1.0 + parameters["gain_error"]))

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 0.1
