"""The causes that a rig may lack: how each is put into the simulation, its columns for the oracle, its parameters.

`size` is a number without unit, by which the draw sets how strong a cause is; every other property is in `shape`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from tests.benchmarks.hard.physics import GRAVITY, Array, Joint

Shape = Mapping[str, float]
Generator = np.random.Generator
DRIVEN = ("current", "voltage")
ALL = ("position_servo", *DRIVEN)
LOADS = ("torque", "pendulum", "unknown")


@dataclass(frozen=True)
class SensorErrors:
    """Errors of the sensors that are causes, not tolerances: N m, 1, N m/s, rad."""

    bias: float = 0.0
    gain: float = 0.0
    drift: float = 0.0
    offset: float = 0.0
    sine: float = 0.0
    cosine: float = 0.0


@dataclass(frozen=True)
class Scales:
    """Sizes of a rig, from which causes take theirs: torque [N m], speed, travel, effort, the log's rate [Hz]."""

    torque: float
    speed: float
    travel: float
    effort: float
    rate: float


@dataclass(frozen=True)
class World:
    """The truth of a rig: the joint and its sensors."""

    joint: Joint
    sensors: SensorErrors = SensorErrors()


@dataclass(frozen=True)
class View:
    """The true signals at the rows of all training runs, each (rows,); efforts in the drive's unit.

    `observed_torque` is the load torque as recorded, at the time of the row.
    """

    time: Array
    run: Array
    q: Array
    v: Array
    a: Array
    torque: Array
    observed_torque: Array
    effort: Array
    slide: Array
    soft: Array
    after_gap: Array
    delay_part: Array
    integral: Array
    deadzone_part: Array
    saturation_part: Array
    switched: Array
    lag_part: Array
    celsius: Array
    pressed: Array


@dataclass(frozen=True)
class Cause:
    """One cause.

    Attributes:
        id: Id of the effect.
        drives, loads: Where it can be seen.
        first: Size to begin the calibration with.
        most: Largest size that is physically possible.
        shape: Draws what is not the size.
        apply: Puts a cause of a size into a world.
        columns: (rows, k) in N m, or in the drive's unit if `in_effort`.
        parameters: Truth in the units of the documentation.
    """

    id: str
    first: float
    most: float
    shape: Callable[[Scales, Generator], Shape]
    apply: Callable[[World, Scales, Shape, float], World]
    columns: Callable[[View, World, Shape], Array]
    parameters: Callable[[World, Shape], dict[str, float]]
    drives: tuple[str, ...] = ALL
    loads: tuple[str, ...] = LOADS
    in_effort: bool = False


def _joint(**fields: Callable[[Scales, Shape, float, Joint], float]) -> Callable[[World, Scales, Shape, float], World]:
    """An `apply` that sets fields of the joint."""

    def apply(world: World, scales: Scales, shape: Shape, size: float) -> World:
        values = {name: rule(scales, shape, size, world.joint) for name, rule in fields.items()}
        return replace(world, joint=world.joint._replace(**values))

    return apply


def _sensor(**fields: Callable[[Scales, Shape, float], float]) -> Callable[[World, Scales, Shape, float], World]:
    """An `apply` that sets errors of the sensors."""

    def apply(world: World, scales: Scales, shape: Shape, size: float) -> World:
        return replace(world, sensors=replace(world.sensors, **{n: f(scales, shape, size) for n, f in fields.items()}))

    return apply


def _of_joint(**names: str) -> Callable[[World, Shape], dict[str, float]]:
    """Parameters that are fields of the joint, by documented name."""
    return lambda world, shape: {name: float(getattr(world.joint, field)) for name, field in names.items()}


def _of_sensor(**names: str) -> Callable[[World, Shape], dict[str, float]]:
    return lambda world, shape: {name: float(getattr(world.sensors, field)) for name, field in names.items()}


def _none(scales: Scales, rng: Generator) -> Shape:
    return {}


def _signed(scales: Scales, rng: Generator) -> Shape:
    return {"sign": float(rng.choice([-1.0, 1.0]))}


def stack(*columns: Array) -> Array:
    """Columns side by side."""
    return np.stack(np.broadcast_arrays(*columns), axis=-1).astype(float)


def _wave(least: float, most: float) -> Callable[[Scales, Generator], Shape]:
    """Cycles a turn that the travel shows (0.8 of a period at least) and the log's rate resolves, and a phase."""

    def draw(scales: Scales, rng: Generator) -> Shape:
        low = max(least, 0.8 * np.pi / scales.travel)
        high = max(low, min(most, 2.0 * np.pi * scales.rate / (5.0 * scales.speed)))
        cycles = float(np.round(np.exp(rng.uniform(np.log(low), np.log(high)))))
        return {"cycles": max(cycles, 1.0), "phase": rng.uniform(0.0, 2.0 * np.pi)}

    return draw


def _spring_middle(scales: Scales, rng: Generator) -> Shape:
    return {"middle": scales.travel * rng.uniform(-0.5, 0.5)}


def _warm(view: View, rate: float) -> Array:
    return (1.0 - np.exp(-rate * (view.celsius - 25.0))) / rate


def _delay(scales: Scales, rng: Generator) -> Shape:
    """A delay or a lag is at least 1.6 periods and 3 ms, so that no age within a period is one."""
    return {"least": max(1.6 / scales.rate, 3e-3)}


CAUSES: dict[str, Cause] = {
    cause.id: cause
    for cause in (
        Cause(
            "stribeck",
            0.1,
            1.5,
            lambda s, rng: {
                "velocity": s.speed * rng.uniform(0.03, 0.2),
                "exponent": float(rng.choice([1.0, 1.5, 2.0])),
            },
            _joint(
                stribeck=lambda s, p, x, j: x * j.coulomb,
                stribeck_velocity=lambda s, p, x, j: p["velocity"],
                stribeck_exponent=lambda s, p, x, j: p["exponent"],
            ),
            lambda v, w, p: stack(np.exp(-((np.abs(v.v) / p["velocity"]) ** p["exponent"])) * v.slide),
            _of_joint(
                stribeck="stribeck", stribeck_velocity="stribeck_velocity", stribeck_exponent="stribeck_exponent"
            ),
        ),
        Cause(
            "quadratic_viscous",
            0.05,
            1.0,
            _none,
            _joint(quadratic_viscous=lambda s, p, x, j: x * s.torque / s.speed**2),
            lambda v, w, p: stack(v.v * np.abs(v.v)),
            _of_joint(quadratic_viscous="quadratic_viscous"),
        ),
        Cause(
            "load_dependent_friction",
            0.05,
            0.4,
            _none,
            _joint(load_friction=lambda s, p, x, j: x),
            lambda v, w, p: stack(np.abs(v.pressed) * v.slide),
            _of_joint(load_friction="load_friction"),
            loads=("torque", "pendulum"),
        ),
        Cause(
            "asymmetric_friction",
            0.05,
            0.7,
            lambda s, rng: {"sign": float(rng.choice([-1.0, 1.0])), "viscous": rng.uniform(0.0, 1.0)},
            _joint(
                coulomb_asymmetry=lambda s, p, x, j: x * p["sign"] * j.coulomb,
                viscous_asymmetry=lambda s, p, x, j: x * p["sign"] * p["viscous"] * j.viscous,
            ),
            lambda v, w, p: stack(np.abs(v.slide), np.abs(v.v)),
            _of_joint(coulomb_asymmetry="coulomb_asymmetry", viscous_asymmetry="viscous_asymmetry"),
        ),
        Cause(
            "presliding_hysteresis",
            0.3,
            1.0,
            lambda s, rng: {"travel": s.travel * rng.uniform(0.02, 0.2)},
            _joint(presliding=lambda s, p, x, j: x * j.coulomb, presliding_travel=lambda s, p, x, j: p["travel"]),
            lambda v, w, p: stack(v.soft - v.slide),
            _of_joint(presliding="presliding", presliding_travel="presliding_travel"),
        ),
        Cause(
            "position_dependent_friction",
            0.1,
            0.8,
            _wave(1.0, 12.0),
            _joint(
                friction_cosine=lambda s, p, x, j: x * np.cos(p["phase"]) * j.coulomb,
                friction_sine=lambda s, p, x, j: x * np.sin(p["phase"]) * j.coulomb,
                friction_cycles=lambda s, p, x, j: p["cycles"],
            ),
            lambda v, w, p: stack(np.cos(p["cycles"] * v.q) * v.slide, np.sin(p["cycles"] * v.q) * v.slide),
            _of_joint(
                friction_cosine="friction_cosine", friction_sine="friction_sine", cycles_per_turn="friction_cycles"
            ),
        ),
        Cause(
            "thermal_friction",
            0.01,
            0.025,
            lambda s, rng: {"share": rng.uniform(0.2, 1.0), "rate": rng.uniform(0.005, 0.04)},
            _joint(
                coulomb_per_kelvin=lambda s, p, x, j: -x * p["share"] * j.coulomb,
                viscous_per_kelvin=lambda s, p, x, j: -x * j.viscous,
                thermal_rate=lambda s, p, x, j: p["rate"],
            ),
            lambda v, w, p: stack(_warm(v, p["rate"]) * v.slide, _warm(v, p["rate"]) * v.v),
            _of_joint(
                coulomb_per_kelvin="coulomb_per_kelvin",
                viscous_per_kelvin="viscous_per_kelvin",
                thermal_rate="thermal_rate",
            ),
        ),
        Cause(
            "torque_ripple",
            0.03,
            0.4,
            _wave(4.0, 60.0),
            _joint(
                ripple_cosine=lambda s, p, x, j: x * np.cos(p["phase"]) * s.torque,
                ripple_sine=lambda s, p, x, j: x * np.sin(p["phase"]) * s.torque,
                ripple_cycles=lambda s, p, x, j: p["cycles"],
            ),
            lambda v, w, p: stack(np.cos(p["cycles"] * v.q), np.sin(p["cycles"] * v.q)),
            _of_joint(ripple_cosine="ripple_cosine", ripple_sine="ripple_sine", cycles_per_turn="ripple_cycles"),
        ),
        Cause(
            "cable_spring",
            0.05,
            0.5,
            _spring_middle,
            _joint(
                spring_stiffness=lambda s, p, x, j: x * s.torque / s.travel,
                spring_preload=lambda s, p, x, j: -x * s.torque / s.travel * p["middle"],
            ),
            lambda v, w, p: stack(v.q, np.ones_like(v.q)),
            _of_joint(spring_stiffness="spring_stiffness", spring_preload="spring_preload"),
            loads=("torque", "pendulum"),
        ),
        Cause(
            "backlash",
            0.02,
            0.6,
            _none,
            _joint(backlash=lambda s, p, x, j: x * s.effort),
            lambda v, w, p: stack(v.after_gap),
            _of_joint(backlash="backlash"),
            drives=("position_servo",),
            loads=("torque", "pendulum"),
            in_effort=True,
        ),
        Cause(
            "elasticity",
            0.05,
            0.3,
            _none,
            _joint(compliance=lambda s, p, x, j: x * j.gain),
            lambda v, w, p: stack(v.after_gap),
            _of_joint(compliance="compliance"),
            drives=("position_servo",),
            loads=("torque",),
            in_effort=True,
        ),
        Cause(
            "deadzone",
            0.03,
            0.4,
            _none,
            _joint(deadzone=lambda s, p, x, j: x * s.effort),
            lambda v, w, p: stack(v.deadzone_part),
            _of_joint(deadzone="deadzone"),
            in_effort=True,
        ),
        Cause(
            "saturation",
            0.15,
            0.7,
            _none,
            _joint(limit=lambda s, p, x, j: (1.0 - x) * s.effort),
            lambda v, w, p: stack(v.saturation_part),
            _of_joint(limit="limit"),
            in_effort=True,
        ),
        Cause(
            "servo_integrator",
            0.02,
            8.0,
            _none,
            _joint(integral_rate=lambda s, p, x, j: x),
            lambda v, w, p: stack(v.integral),
            _of_joint(integral_rate="integral_rate"),
            drives=("position_servo",),
            in_effort=True,
        ),
        Cause(
            "velocity_sign_switch",
            0.03,
            0.4,
            _signed,
            _joint(switch=lambda s, p, x, j: x * p["sign"]),
            lambda v, w, p: stack(v.switched),
            _of_joint(switch="switch"),
            in_effort=True,
        ),
        Cause(
            "delay",
            2.0,
            6.0,
            _delay,
            _joint(delay=lambda s, p, x, j: p["least"] * max(x, 1.0)),
            lambda v, w, p: stack(v.delay_part),
            _of_joint(delay="delay"),
            in_effort=True,
        ),
        Cause(
            "current_lag",
            2.0,
            6.0,
            _delay,
            _joint(lag=lambda s, p, x, j: p["least"] * max(x, 1.0)),
            lambda v, w, p: stack(v.lag_part),
            _of_joint(lag="lag"),
            drives=DRIVEN,
            in_effort=True,
        ),
        Cause(
            "payload",
            0.05,
            0.6,
            lambda s, rng: {"arm": rng.uniform(0.4, 1.6)},
            _joint(
                payload_moment=lambda s, p, x, j: x * j.moment,
                payload_inertia=lambda s, p, x, j: x * j.moment / GRAVITY * p["arm"] * (j.link / j.moment * GRAVITY),
            ),
            lambda v, w, p: stack(np.sin(v.q), v.a),
            _of_joint(payload_moment="payload_moment", payload_inertia="payload_inertia"),
            loads=("pendulum",),
        ),
        Cause(
            "torque_sensor_bias",
            0.05,
            0.5,
            _signed,
            _sensor(bias=lambda s, p, x: x * p["sign"] * s.torque),
            lambda v, w, p: stack(np.ones_like(v.q)),
            _of_sensor(bias="bias"),
            loads=("torque",),
        ),
        Cause(
            "torque_sensor_gain",
            0.05,
            0.4,
            _signed,
            _sensor(gain=lambda s, p, x: x * p["sign"]),
            lambda v, w, p: stack(v.torque),
            _of_sensor(gain_error="gain"),
            loads=("torque",),
        ),
        Cause(
            "torque_sensor_drift",
            0.002,
            0.02,
            _signed,
            _sensor(drift=lambda s, p, x: x * p["sign"] * s.torque),
            lambda v, w, p: stack(v.time),
            _of_sensor(drift="drift"),
            loads=("torque",),
        ),
        Cause(
            "encoder_offset",
            0.03,
            0.3,
            _signed,
            _sensor(offset=lambda s, p, x: x * p["sign"]),
            lambda v, w, p: stack(w.joint.moment * np.cos(v.q)),
            _of_sensor(offset="offset"),
            drives=DRIVEN,
            loads=("pendulum",),
        ),
        Cause(
            "encoder_eccentricity",
            0.02,
            0.3,
            lambda s, rng: {"phase": rng.uniform(0.0, 2.0 * np.pi)},
            _sensor(
                sine=lambda s, p, x: x * np.sin(p["phase"]),
                cosine=lambda s, p, x: x * np.cos(p["phase"]),
            ),
            lambda v, w, p: stack(*(w.joint.moment * np.cos(v.q) * wave for wave in (np.sin(v.q), np.cos(v.q)))),
            _of_sensor(eccentricity_sine="sine", eccentricity_cosine="cosine"),
            drives=DRIVEN,
            loads=("pendulum",),
        ),
        Cause(
            "rotor_inertia",
            0.3,
            8.0,
            _none,
            _joint(rotor=lambda s, p, x, j: x * j.link),
            lambda v, w, p: stack(v.a),
            _of_joint(rotor_inertia="rotor"),
            loads=("torque", "pendulum"),
        ),
    )
}
