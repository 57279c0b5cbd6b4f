"""Columns of ids that a rig does not lack; one that explains a log as well as the truth is as right an answer."""

from collections.abc import Mapping, Sequence

import numba
import numpy as np

from tests.benchmarks.hard.causes import View, World, stack
from tests.benchmarks.hard.physics import Array
from tests.benchmarks.hard.rig import Rig


def alternatives(rig: Rig, world: World, view: View) -> Mapping[str, Sequence[Array]]:
    """Id to the forms that are tried for it, each (rows, k)."""
    v, q, s, one = view.v, view.q, view.slide, np.ones_like(view.q)
    fast = float(np.abs(v).max())
    load = view.torque
    rate = _rate(_acting(view, world), view)
    forms: dict[str, list[Array]] = {
        "stribeck": [stack(np.exp(-np.abs(v) / (fast * x)) * s) for x in (0.01, 0.03, 0.1, 0.3)],
        "static_friction": [stack(np.exp(-np.abs(v) / (fast * x)) * s) for x in (0.003, 0.01)],
        "viscous_power": [stack(np.abs(v) ** p * s) for p in (0.3, 0.6)],
        "quadratic_viscous": [stack(v * np.abs(v))],
        "load_dependent_friction": [stack(np.abs(load) * s)],
        "directional_efficiency": [stack(np.maximum(load * s, 0.0) * s, np.minimum(load * s, 0.0) * s)],
        "load_stribeck": [stack(np.abs(load) * s * np.exp(-np.abs(v) / (fast * x))) for x in (0.03, 0.2)],
        "asymmetric_friction": [stack(np.abs(s)), stack(np.abs(s), np.abs(v))],
        "presliding_hysteresis": [stack(_soft(q, view.run, x) - s) for x in (0.003, 0.01, 0.03, 0.1)],
        "position_dependent_friction": [
            *(stack(np.cos(n * q) * s, np.sin(n * q) * s) for n in (1.0, 2.0, 3.0, 5.0, 8.0)),
            stack(q * s),
        ],
        "thermal_friction": [stack((view.celsius - 25.0) * s, (view.celsius - 25.0) * v)],
        "cable_spring": [stack(q, one)],
        "position_dependent_load": [stack(*(q**n for n in range(6)))],
        "velocity_sign_switch": [stack(np.tanh(v / 2e-3) * _acting(view, world))],
        "deadzone": [stack(np.clip(_acting(view, world), -w, w)) for w in _levels(_acting(view, world))],
        "drive_compression": [stack(_acting(view, world) * np.abs(_acting(view, world)))],
        "delay": [stack(rate), stack(_rate(view.torque, view)), stack(v)],
        "current_lag": [stack(rate)],
    }
    forms |= _of_drive(rig, view, world) | _of_load(rig, view, world)
    return {name: columns for name, columns in forms.items() if name not in rig.causes}


def _acting(view: View, world: World) -> Array:
    """Effort of the true torque, without noise."""
    joint = world.joint
    return joint.gain * (view.torque + joint.rotor * view.a + joint.coulomb * view.slide + joint.viscous * view.v)


def _of_drive(rig: Rig, view: View, world: World) -> dict[str, list[Array]]:
    acting, one = _acting(view, world), np.ones_like(view.q)
    forms: dict[str, list[Array]] = {}
    if rig.gain_held:
        forms["servo_gain"] = [stack(acting)]
    if rig.drive == "position_servo":
        forms["servo_integrator"] = [stack(_integral(acting, view))]
        forms["elasticity"] = [stack(_rate(view.torque, view)), stack(view.torque, _rate(view.torque, view))]
        forms["backlash"] = [stack(np.tanh(view.torque / (0.02 * np.std(view.torque))))]
        forms["encoder_eccentricity"] = [stack(np.sin(view.q), np.cos(view.q))]
        forms["encoder_offset"] = [stack(one)]
    else:
        forms["effort_bias"] = [stack(one)]
    return forms


def _of_load(rig: Rig, view: View, world: World) -> dict[str, list[Array]]:
    one = np.ones_like(view.q)
    forms: dict[str, list[Array]] = {}
    if "rotor_inertia" in rig.causes:
        forms["payload"] = [stack(np.sin(view.q)), stack(np.sin(view.q), view.a)]
        forms["torque_sensor_gain"] = [stack(view.a)]
        return {name: form for name, form in forms.items() if name == "payload" or rig.load == "torque"}
    if rig.load == "torque":
        forms["torque_sensor_bias"] = [stack(one)]
        forms["torque_sensor_gain"] = [stack(view.torque)]
        forms["torque_sensor_drift"] = [stack(view.time)]
        forms["payload"] = [stack(np.sin(view.q), view.a)]
    if rig.load == "pendulum":
        forms["payload"] = [stack(np.sin(view.q)), stack(np.sin(view.q), view.a)]
        forms["load_tilt"] = [stack(np.cos(view.q))]
        forms["encoder_offset"] = [stack(np.cos(view.q))]
        waves = (np.cos(view.q) * np.sin(view.q), np.cos(view.q) ** 2)
        forms["encoder_eccentricity"] = [stack(*waves)]
    return forms


def _levels(effort: Array) -> list[float]:
    return [float(x) for x in np.quantile(np.abs(effort), [0.1, 0.3])]


def _rate(signal: Array, view: View) -> Array:
    """Rate of change within each run."""
    rate = np.gradient(signal) / np.maximum(np.gradient(view.time), 1e-9)
    ends = np.flatnonzero(np.diff(view.run) != 0)
    rate[np.concatenate([ends, ends + 1])] = 0.0
    return rate


def _integral(signal: Array, view: View) -> Array:
    """Integral from the start of each run."""
    total = np.zeros_like(signal)
    for number in np.unique(view.run):
        here = view.run == number
        total[here] = np.cumsum(signal[here] * np.gradient(view.time[here]))
    return total


@numba.njit(cache=True)
def _soft(q: Array, run: Array, travel: float) -> Array:
    z = np.zeros_like(q)
    for k in range(1, q.size):
        if run[k] == run[k - 1]:
            way = np.sign(q[k] - q[k - 1])
            z[k] = way + (z[k - 1] - way) * np.exp(-abs(q[k] - q[k - 1]) / travel)
    return z
