"""The list of rigs: every effect alone at three strengths, pairs, nulls of many kinds, and outside causes."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from drake_tc.joint_simulator.amplitudes import draw_cause
from drake_tc.joint_simulator.spec import BlindError, Drive, FileFormat, RigSpec, Sensors
from tests.benchmarks.blind.calibrate import with_cause
from tests.benchmarks.blind.joints import draw_joint, draw_pendulum
from tests.benchmarks.blind.nulls import FULL_NULLS, SMOKE_NULLS, null_rig
from tests.benchmarks.blind.verdicts import OUTSIDE

Scale = Literal["smoke", "full"]
STRENGTHS = {"weak": 1.0 / 3.0, "middle": 1.0, "strong": 3.0}
FORMATS: tuple[FileFormat, ...] = ("csv", "csv.gz", "parquet")
SERVO: Drive = "position_servo"
VOLTAGE: Drive = "voltage"
CURRENT: Drive = "current"


@dataclass(frozen=True)
class Setting:
    """On which rigs an effect is shown: seed k takes the k-th drive and load, cyclically.

    Attributes:
        drives: Kinds of drive.
        pendulum: Which of them carry a pendulum instead of a torque sensor.
    """

    drives: tuple[Drive, ...]
    pendulum: tuple[bool, ...] = (False, False, False)


_ANY = Setting((SERVO, VOLTAGE, CURRENT))
_ANY_HUNG = Setting((SERVO, VOLTAGE, SERVO), (False, False, True))
_SERVO = Setting((SERVO, SERVO, SERVO))

SETTINGS: dict[str, Setting] = {
    "rotor_inertia": _ANY_HUNG,
    "stribeck": _ANY_HUNG,
    "quadratic_viscous": _ANY,
    "load_dependent_friction": _ANY,
    "asymmetric_friction": _ANY,
    "presliding_hysteresis": _ANY,
    "position_dependent_friction": _ANY_HUNG,
    "thermal_friction": _ANY,
    "torque_ripple": _ANY_HUNG,
    "cable_spring": _ANY_HUNG,
    "backlash": _SERVO,
    "elasticity": _SERVO,
    "deadzone": Setting((SERVO, SERVO, VOLTAGE)),
    "saturation": Setting((SERVO, VOLTAGE, CURRENT)),
    "servo_integrator": _SERVO,
    "velocity_sign_switch": _ANY,
    "delay": Setting((SERVO, VOLTAGE, CURRENT)),
    "current_lag": Setting((SERVO, VOLTAGE, CURRENT)),
    "payload": Setting((SERVO, VOLTAGE, SERVO), (False, False, True)),
    "torque_sensor_bias": _ANY,
    "torque_sensor_gain": _ANY,
    "torque_sensor_drift": _ANY,
    "encoder_offset": Setting((SERVO, SERVO, SERVO), (True, True, True)),
    "encoder_eccentricity": Setting((SERVO, SERVO, SERVO), (False, False, True)),
}

PAIRS: tuple[tuple[str, str], ...] = (
    ("stribeck", "torque_sensor_bias"),
    ("load_dependent_friction", "thermal_friction"),
    ("torque_ripple", "asymmetric_friction"),
    ("cable_spring", "stribeck"),
    ("quadratic_viscous", "position_dependent_friction"),
    ("deadzone", "load_dependent_friction"),
    ("presliding_hysteresis", "cable_spring"),
    ("current_lag", "torque_ripple"),
    ("velocity_sign_switch", "payload"),
    ("torque_sensor_drift", "load_dependent_friction"),
    ("servo_integrator", "torque_ripple"),
    ("rotor_inertia", "stribeck"),
    ("backlash", "cable_spring"),
    ("delay", "position_dependent_friction"),
)
_SMOKE_SINGLES = (
    "stribeck",
    "load_dependent_friction",
    "torque_ripple",
    "cable_spring",
    "deadzone",
    "delay",
    "payload",
    "torque_sensor_bias",
    "thermal_friction",
    "backlash",
    "rotor_inertia",
    "presliding_hysteresis",
    "position_dependent_friction",
    "servo_integrator",
    "encoder_offset",
)
_SMOKE_OUTSIDE = (
    "touch",
    "unrecorded_supply_sag",
    "random_disturbance",
    "wandering_sensor",
    "end_stop",
    "friction_jump",
)


def catalogue(scale: Scale = "smoke", seed: int = 0) -> list[RigSpec]:
    """All rigs of a benchmark, in a random but seeded order of names, amplitudes not yet calibrated.

    Args:
        scale: `smoke`, about 30 rigs, or `full`, about 300.
        seed: Of everything.

    Raises:
        BlindError: An unknown scale.
    """
    if scale not in ("smoke", "full"):
        raise BlindError(f"no scale {scale!r}; scales are smoke, full")
    specs = list(_smoke(seed) if scale == "smoke" else _full(seed))
    order = np.random.default_rng([seed, 7]).permutation(len(specs))
    return [replace(specs[j], name=f"rig_{i:03d}", file_format=FORMATS[i % 3]) for i, j in enumerate(order)]


def _smoke(seed: int) -> Iterator[RigSpec]:
    for k, effect in enumerate(_SMOKE_SINGLES):
        yield caused_rig((effect,), "single", "middle", k, seed)
    for k, pair in enumerate(PAIRS[:4]):
        yield caused_rig(pair, "pair", "middle", k, seed)
    for k, kind in enumerate(SMOKE_NULLS):
        yield null_rig(kind, k, seed)
    for k, cause in enumerate(_SMOKE_OUTSIDE):
        yield caused_rig((cause,), "outside", "outside", k, seed)


def _full(seed: int) -> Iterator[RigSpec]:
    for effect in SETTINGS:
        for strength in STRENGTHS:
            for k in range(3):
                yield caused_rig((effect,), "single", strength, k, seed)
    for pair in PAIRS:
        for k in range(2):
            yield caused_rig(pair, "pair", "middle", k, seed)
    for kind, count in FULL_NULLS.items():
        for k in range(count):
            yield null_rig(kind, k, seed)
    for cause in OUTSIDE:
        for k in range(3):
            yield caused_rig((cause,), "outside", "outside", k, seed)


def caused_rig(causes: tuple[str, ...], group: str, strength: str, k: int, seed: int) -> RigSpec:
    """The k-th rig that has `causes`, all at `strength`; an outside cause has 1.2 to 2 N m RMS."""
    kind = "+".join(causes)
    rng = np.random.default_rng([seed, 1, k, *strength.encode(), *kind.encode()])
    drive, hung = _common_setting(causes, k)
    pendulum = draw_pendulum(rng) if hung else None
    soft = bool({"current_lag", "delay"} & set(causes))
    joint = draw_joint(rng, drive, soft=soft, pendulum=pendulum)
    spec = RigSpec(
        name="", group=group, kind=kind, strength=strength, joint=joint, seed=int(rng.integers(2**31)),
        pendulum=pendulum, motor_position="backlash" in causes or "elasticity" in causes,
        sensors=Sensors(torque_noise=float(rng.uniform(0.2, 0.3))),
    )  # fmt: skip
    if spec.motor_position and k % 2 == 0:
        spec = replace(spec, motor_position=False)
    targets = {}
    for cause in causes:
        spec = with_cause(spec, cause, draw_cause(cause, rng, joint))
        middle = rng.uniform(1.2, 2.0) if group == "outside" else rng.uniform(0.6, 1.2)
        targets[cause] = float(middle * STRENGTHS.get(strength, 1.0))
    return _reaching_limits(replace(spec, targets=targets), k)


def _common_setting(causes: tuple[str, ...], k: int) -> tuple[Drive, bool]:
    """Drive and load that suit all causes: the first one's k-th, or the first that both can have."""
    settings = [SETTINGS.get(cause, _ANY) for cause in causes]
    drive, hung = settings[0].drives[k % 3], settings[0].pendulum[k % 3]
    if len(causes) > 1:
        hung = False
        drive = next((d for d in (drive, SERVO, VOLTAGE) if all(d in s.drives for s in settings)), SERVO)
    return drive, hung


def _reaching_limits(spec: RigSpec, k: int) -> RigSpec:
    """Two of three saturated rigs with a training run that asks for as much effort as the held-out one.

    Otherwise the limit, which is set so that it acts in the moving runs together, is reached in the held-out run alone
    (as it stays in the third rig). The hand pushes with a fifth of its usual force, so that it does not overpower the
    drive.
    """
    if spec.kind != "saturation" or (k + list(STRENGTHS).index(spec.strength)) % 3 == 2:
        return spec
    return replace(spec, sine_pace=2.0, hand=0.2)
