"""What a simulated joint adds to the load: the torque of its drive for a given motion, by equations of its own.

    tau_drive = tau_link + J qddot + F_v qdot + F_c s(qdot) + (one effect),    s(v) = tanh(v/1 mrad/s)

The effort is y = K tau_drive, changed by an error of the drive. Nothing here comes from `drake_tc.effects`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from drake_tc.types import FloatArray

SMOOTH = 1e-3
"""Speed at which Coulomb friction has turned over [rad/s]."""
REFERENCE_CELSIUS = 25.0


@dataclass(frozen=True)
class JointMotion:
    """One joint's motion on a fine clock, arrays (T,).

    Attributes:
        time: [s]. q, v, a: [rad, rad/s, rad/s^2]. load: Link-side torque [N m]. temperature: [°C].
    """

    time: FloatArray
    q: FloatArray
    v: FloatArray
    a: FloatArray
    load: FloatArray
    temperature: FloatArray

    @property
    def sign(self) -> FloatArray:
        """s(qdot)."""
        return np.tanh(self.v / SMOOTH)


@dataclass(frozen=True)
class JointTruth:
    """One simulated joint.

    Attributes:
        viscous, coulomb: [N m s/rad], [N m]. rotor_inertia: [kg m^2]. gain: K [effort/N m].
        effect: What no file says; empty for nothing. numbers: Its parameters.
    """

    viscous: float
    coulomb: float
    rotor_inertia: float
    gain: float
    effect: str = ""
    numbers: Mapping[str, float] | None = None


def _thermal(m: JointMotion, p: Mapping[str, float]) -> FloatArray:
    warm = m.temperature - REFERENCE_CELSIUS
    return np.asarray((p["coulomb_per_kelvin"] * m.sign + p["viscous_per_kelvin"] * m.v) * warm)


def _stribeck(m: JointMotion, p: Mapping[str, float]) -> FloatArray:
    rest = np.exp(-((np.abs(m.v) / p["stribeck_velocity"]) ** p["stribeck_exponent"]))
    return np.asarray(p["stribeck"] * rest * m.sign)


def _ripple(m: JointMotion, p: Mapping[str, float]) -> FloatArray:
    phase = p["cycles_per_turn"] * m.q
    return np.asarray(p["ripple_cosine"] * np.cos(phase) + p["ripple_sine"] * np.sin(phase))


def _position_friction(m: JointMotion, p: Mapping[str, float]) -> FloatArray:
    phase = p["cycles_per_turn"] * m.q
    return np.asarray((p["friction_cosine"] * np.cos(phase) + p["friction_sine"] * np.sin(phase)) * m.sign)


TORQUES: Mapping[str, Callable[[JointMotion, Mapping[str, float]], FloatArray]] = {
    "load_dependent_friction": lambda m, p: p["load_friction"] * np.abs(m.load) * m.sign,
    "stribeck": _stribeck,
    "quadratic_viscous": lambda m, p: p["quadratic_viscous"] * m.v * np.abs(m.v),
    "viscous_power": lambda m, p: p["viscous_power"] * np.abs(m.v) ** p["viscous_exponent"] * np.sign(m.v),
    "torque_ripple": _ripple,
    "asymmetric_friction": lambda m, p: p["coulomb_asymmetry"] * m.sign**2,
    "current_offset": lambda m, p: np.full(m.q.size, p["offset"]),
    "cable_spring": lambda m, p: p["spring_stiffness"] * m.q + p["spring_preload"],
    "thermal_friction": _thermal,
    "position_dependent_friction": _position_friction,
}
"""Torques [N m] that an effect adds to what the drive must bear."""


def lead(values: FloatArray, time: FloatArray, seconds: float) -> FloatArray:
    """values(t + d), the last value after the end."""
    return np.asarray(np.interp(time + seconds, time, values))


def effort(joint: JointTruth, motion: JointMotion) -> FloatArray:
    """Effort y (T,) that makes this joint follow the motion.

    A dead zone: y = K tau + w sign(tau). A lag: y = K (tau + T dtau/dt). A delay: y(t) = K tau(t + d).
    """
    p = joint.numbers or {}
    torque = motion.load + joint.rotor_inertia * motion.a + joint.viscous * motion.v + joint.coulomb * motion.sign
    if joint.effect in TORQUES:
        torque = torque + TORQUES[joint.effect](motion, p)
    if joint.effect == "current_lag":
        torque = torque + p["lag"] * np.gradient(torque, motion.time)
    if joint.effect == "delay":
        torque = lead(torque, motion.time, p["delay"])
    y = joint.gain * torque
    return np.asarray(y + p["deadzone"] * np.sign(y) if joint.effect == "deadzone" else y)
