"""For each cause: the parameter that sets its strength, its plausible range, and draws for all the others."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from drake_tc.joint_simulator.spec import BlindError, Joint

Draw = Callable[[np.random.Generator, Joint], dict[str, float]]


@dataclass(frozen=True)
class Amplitude:
    """Which parameter grows (or, with a negative power, shrinks) with a cause's strength.

    Attributes:
        name: The parameter.
        guess: Its value before calibration, for about 0.8 N m.
        lower, upper: The plausible range; calibration stops there.
        power: Rough exponent of strength against the parameter.
        others: Draws the cause's other parameters.
    """

    name: str
    guess: float
    lower: float
    upper: float
    power: float = 1.0
    others: Draw = lambda rng, joint: {}


def _phase(rng: np.random.Generator) -> float:
    return float(rng.uniform(0.0, 2 * np.pi))


def _touch(start: tuple[float, float], length: tuple[float, float]) -> Draw:
    """A touch in one of two runs: ranges of its start and its length [s]."""
    return lambda r, j: {
        "start": float(r.uniform(*start)),
        "length": float(r.uniform(*length)),
        "only_run": float(r.choice([1.0, 2.0])),
    }


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _seed(rng: np.random.Generator) -> float:
    return float(rng.integers(2**31))


AMPLITUDES: Mapping[str, Amplitude] = {
    "rotor_inertia": Amplitude("inertia", 0.35, 0.03, 1.5),
    "stribeck": Amplitude(
        "excess",
        3.0,
        0.3,
        12.0,
        others=lambda r, j: {
            "speed": float(np.exp(r.uniform(np.log(0.05), np.log(0.35)))),
            "exponent": float(r.choice([1.0, 2.0])),
        },
    ),
    "quadratic_viscous": Amplitude("b2", 2.0, 0.1, 20.0),
    "load_dependent_friction": Amplitude("mu", 0.15, 0.02, 0.7),
    "asymmetric_friction": Amplitude(
        "delta", 0.2, 0.02, 0.9, others=lambda r, j: {"share": float(r.uniform(0.4, 1.0))}
    ),
    "presliding_hysteresis": Amplitude(
        "share", 0.5, 0.03, 1.0, others=lambda r, j: {"length": float(np.exp(r.uniform(np.log(0.005), np.log(0.05))))}
    ),
    "position_dependent_friction": Amplitude(
        "alpha", 0.3, 0.03, 0.95, others=lambda r, j: {"cycles": float(r.uniform(3.0, 9.0)), "phase": _phase(r)}
    ),
    "thermal_friction": Amplitude(
        "rate",
        0.02,
        0.002,
        0.2,
        others=lambda r, j: {
            "coulomb_share": float(r.uniform(0.2, 1.0)),
            "viscous_share": float(r.uniform(0.5, 1.0)),
        },
    ),
    "torque_ripple": Amplitude(
        "amplitude",
        1.1,
        0.1,
        8.0,
        others=lambda r, j: {"count": float(np.round(np.exp(r.uniform(np.log(20), np.log(200))))), "phase": _phase(r)},
    ),
    "cable_spring": Amplitude("stiffness", 2.5, 0.2, 25.0, others=lambda r, j: {"rest": float(r.uniform(-0.3, 0.3))}),
    "backlash": Amplitude("half_gap", 2e-4, 1e-5, 0.02),
    "elasticity": Amplitude("compliance", 2e-5, 2e-6, 4e-4),
    "deadzone": Amplitude("width", 2.0, 0.2, 12.0),
    "saturation": Amplitude("limit", 30.0, 4.0, 250.0, power=-3.0),
    "servo_integrator": Amplitude("rate", 0.1, 0.005, 15.0),
    "velocity_sign_switch": Amplitude("delta", 0.06, 0.005, 0.5),
    "delay": Amplitude("delay", 4e-3, 1e-3, 10e-3),
    "current_lag": Amplitude("time", 5e-3, 1.5e-3, 15e-3),
    "payload": Amplitude("mass", 0.7, 0.05, 8.0, others=lambda r, j: {"arm": float(r.uniform(0.25, 0.45))}),
    "torque_sensor_bias": Amplitude("bias", 0.8, 0.1, 6.0),
    "torque_sensor_gain": Amplitude("error", 0.12, 0.05, 0.25),
    "torque_sensor_drift": Amplitude("rate", 0.07, 0.005, 0.5),
    "encoder_offset": Amplitude("offset", 2e-4, 1e-5, 5e-3),
    "encoder_eccentricity": Amplitude("amplitude", 3e-4, 1e-5, 1e-2, others=lambda r, j: {"phase": _phase(r)}),
    "touch": Amplitude(
        "amplitude",
        8.0,
        0.5,
        60.0,
        others=_touch((5.0, 22.0), (1.5, 2.5)),
    ),
    "periodic_disturbance": Amplitude(
        "amplitude",
        2.0,
        0.1,
        20.0,
        others=lambda r, j: {"frequency_hz": float(r.uniform(3.0, 9.0)), "phase": _phase(r)},
    ),
    "unrecorded_supply_sag": Amplitude(
        "share", 0.15, 0.03, 0.5, others=lambda r, j: {"start": float(r.uniform(9.0, 16.0))}
    ),
    "position_velocity_friction": Amplitude("slope", 4.0, 0.2, 30.0),
    "detent": Amplitude(
        "amplitude",
        3.0,
        0.2,
        30.0,
        others=lambda r, j: {"centre": _sign(r) * float(r.uniform(0.15, 0.4)), "width": float(r.uniform(0.02, 0.06))},
    ),
    "ageing": Amplitude("gain", 2.0, 0.1, 20.0, others=lambda r, j: {"memory": float(r.uniform(0.3, 1.0))}),
    "triangular_cam": Amplitude(
        "amplitude", 1.5, 0.1, 15.0, others=lambda r, j: {"count": float(r.integers(5, 12)), "phase": _phase(r)}
    ),
    "random_disturbance": Amplitude("amplitude", 1.0, 0.1, 10.0, others=lambda r, j: {"noise_seed": _seed(r)}),
    "long_touch": Amplitude(
        "amplitude",
        3.0,
        0.3,
        40.0,
        others=_touch((4.0, 18.0), (7.0, 9.0)),
    ),
    "wandering_sensor": Amplitude("walk", 2.0, 0.2, 40.0, others=lambda r, j: {"noise_seed": _seed(r)}),
    "end_stop": Amplitude(
        "stiffness",
        40.0,
        2.0,
        600.0,
        others=lambda r, j: {
            "side": _sign(r),
            "stop": float(r.uniform(0.3, 0.45)),
            "time": float(r.uniform(0.1, 0.2)),
        },
    ),
    "load_times_speed": Amplitude("slope", 0.25, 0.02, 3.0),
    "drive_dropout": Amplitude(
        "share",
        0.25,
        0.03,
        1.0,
        others=lambda r, j: {"noise_seed": _seed(r), "length": float(r.uniform(0.08, 0.25))},
    ),
    "friction_jump": Amplitude("share", 0.6, 0.05, 0.95, others=lambda r, j: {"start": float(r.uniform(8.0, 15.0))}),
}
SIGNED = frozenset({"asymmetric_friction", "velocity_sign_switch", "torque_sensor_bias", "torque_sensor_gain",
                    "torque_sensor_drift", "encoder_offset", "long_touch"})  # fmt: skip


def draw_cause(cause: str, rng: np.random.Generator, joint: Joint) -> dict[str, float]:
    """Parameters of a cause, its amplitude at the guess (with a random sign where either sign is physical).

    Raises:
        BlindError: An unknown cause.
    """
    if cause not in AMPLITUDES:
        raise BlindError(f"no cause {cause!r}; causes are {', '.join(sorted(AMPLITUDES))}")
    amplitude = AMPLITUDES[cause]
    guess = amplitude.guess * (_sign(rng) if cause in SIGNED else 1.0)
    return {amplitude.name: guess} | amplitude.others(rng, joint)
