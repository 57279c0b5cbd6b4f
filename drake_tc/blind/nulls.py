"""Rigs that lack nothing: the declared model is the true one, and only sensors and drives differ."""

from dataclasses import replace

import numpy as np

from drake_tc.blind.joints import draw_joint, draw_pendulum
from drake_tc.blind.spec import BlindError, Drive, RigSpec, Sensors

FULL_NULLS = {
    "plain": 5,
    "coarse_encoder": 6,
    "jitter_and_lost_rows": 6,
    "coloured_noise": 5,
    "drifting_noise": 5,
    "stiction": 6,
    "low_rate": 5,
    "small_servo_scale": 4,
    "other_drive": 4,
    "pendulum": 3,
}
SMOKE_NULLS = (
    "plain",
    "coarse_encoder",
    "jitter_and_lost_rows",
    "coloured_noise",
    "drifting_noise",
    "stiction",
    "low_rate",
    "pendulum",
)
_DRIVES: tuple[Drive, ...] = ("position_servo", "voltage", "current")


def null_rig(kind: str, k: int, seed: int) -> RigSpec:
    """The k-th null rig of a kind.

    Raises:
        BlindError: An unknown kind.
    """
    if kind not in FULL_NULLS:
        raise BlindError(f"no null kind {kind!r}; kinds are {', '.join(FULL_NULLS)}")
    rng = np.random.default_rng([seed, 2, k, *kind.encode()])
    drive: Drive = _DRIVES[1 + k % 2] if kind == "other_drive" else _DRIVES[k % 3]
    if kind in ("pendulum", "small_servo_scale", "plain"):
        drive = "position_servo"
    pendulum = draw_pendulum(rng) if kind == "pendulum" else None
    joint = draw_joint(rng, drive, pendulum=pendulum)
    if kind == "small_servo_scale":
        joint = replace(joint, gain=float(rng.uniform(2.5e-5, 6e-5)))
    spec = RigSpec(
        name="", group="null", kind=kind, strength="", joint=joint, seed=int(rng.integers(2**31)),
        pendulum=pendulum, sensors=_sensors(kind, k, rng),
    )  # fmt: skip
    if kind == "stiction":
        excess = joint.coulomb * float(rng.uniform(0.3, 0.6))
        speed = float(rng.uniform(0.0015, 0.003))
        spec = replace(spec, causes={"stribeck": {"excess": excess, "speed": speed, "exponent": 2.0}})
    return spec


def _sensors(kind: str, k: int, rng: np.random.Generator) -> Sensors:
    """The sensors of a null kind."""
    plain = Sensors(torque_noise=float(rng.uniform(0.2, 0.3)))
    if kind == "coarse_encoder":
        return replace(plain, encoder_step=2 * np.pi / 2 ** (12 + k % 3))
    if kind == "jitter_and_lost_rows":
        return replace(plain, jitter=float(rng.uniform(0.1, 0.35)), lost=float(rng.uniform(0.005, 0.03)))
    if kind == "coloured_noise":
        rms, correlation = float(rng.uniform(0.2, 0.4)), float(rng.uniform(0.005, 0.05))
        return replace(plain, torque_noise=rms, torque_noise_time=correlation)
    if kind == "drifting_noise":
        return replace(plain, torque_walk=float(rng.uniform(0.2, 0.5)))
    if kind == "low_rate":
        return replace(plain, rate_hz=(100, 125, 200, 250)[k % 4])
    return plain
