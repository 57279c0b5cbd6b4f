"""Rigs that lack nothing: the declared model is the true one, and only sensors, drives and motions differ."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from drake_tc.joint_simulator.spec import BlindError, Drive, Joint, RigSpec, Sensors
from tests.benchmarks.blind.joints import draw_joint, draw_pendulum
from tests.benchmarks.blind.noise import torque_left_by_noise, torque_of_position

FULL_NULLS = {
    "plain": 3,
    "coarse_encoder": 3,
    "coarse_encoder_jitter": 4,
    "jitter_and_lost_rows": 3,
    "coloured_noise": 3,
    "drifting_noise": 4,
    "stiction": 4,
    "sampling_rate": 5,
    "slow_rig": 4,
    "voltage_drive": 4,
    "small_servo_scale": 2,
    "current_drive": 2,
    "pendulum": 3,
    "torque_channel_noise": 3,
    "position_channel_noise": 3,
    "command_channel_noise": 3,
    "warming_thermometer": 2,
    "data_sheet_bias": 3,
}
"""Kind of rig to how many of it the whole benchmark has."""
SMOKE_NULLS = (
    "plain",
    "coarse_encoder_jitter",
    "jitter_and_lost_rows",
    "drifting_noise",
    "stiction",
    "sampling_rate",
    "slow_rig",
    "voltage_drive",
    "torque_channel_noise",
    "command_channel_noise",
)
_DRIVES: tuple[Drive, ...] = ("position_servo", "voltage", "current")
_ONE_DRIVE: Mapping[str, Drive] = {
    "plain": "position_servo",
    "pendulum": "position_servo",
    "small_servo_scale": "position_servo",
    "voltage_drive": "voltage",
    "current_drive": "current",
}
TORQUE_BIAS, TORQUE_GAIN = 0.03, 0.001
"""What is left of a torque sensor's zero and span errors after it was tared, at most [N m], [-].

Data sheets of 100 N m sensors state 0.03 to 0.1 % of the range. It stays below what the noise leaves (0.08 N m): a
larger bias that the rig file does not declare is `torque_sensor_bias`, an effect.
"""
DECLARING = {("coloured_noise", 1), ("coarse_encoder_jitter", 1)}
"""Kind and number of the rigs whose file declares the noise of its sensors."""
BANDS: tuple[tuple[float, float], ...] = ((1.0, 5.0), (0.3, 40.0))
"""Noise that wanders and noise that is broad-band [Hz]; rigs take them in turn."""


def null_rig(kind: str, k: int, seed: int) -> RigSpec:
    """The k-th null rig of a kind.

    Raises:
        BlindError: An unknown kind.
    """
    if kind not in FULL_NULLS:
        raise BlindError(f"no null kind {kind!r}; kinds are {', '.join(FULL_NULLS)}")
    rng = np.random.default_rng([seed, 2, k, *kind.encode()])
    drive = _ONE_DRIVE.get(kind, _DRIVES[k % 3])
    pendulum = draw_pendulum(rng) if kind == "pendulum" else None
    joint = _joint_of(kind, draw_joint(rng, drive, pendulum=pendulum), rng)
    spec = RigSpec(
        name="", group="null", kind=kind, strength="", joint=joint, seed=int(rng.integers(2**31)),
        pendulum=pendulum, sensors=_sensors(kind, k, rng), declares_sensors=(kind, k) in DECLARING,
    )  # fmt: skip
    if kind == "stiction":
        excess = joint.coulomb * float(rng.uniform(0.3, 0.6))
        speed = float(rng.uniform(0.0015, 0.003))
        spec = replace(spec, causes={"stribeck": {"excess": excess, "speed": speed, "exponent": 2.0}})
    if kind == "slow_rig":
        spec = replace(spec, pace=float(rng.uniform(0.25, 0.4)))
    if kind.endswith("_channel_noise"):
        spec = replace(spec, sensors=_with_channel_noise(spec, kind.removesuffix("_channel_noise"), k, rng))
    return spec


def _joint_of(kind: str, joint: Joint, rng: np.random.Generator) -> Joint:
    """The joint with the servo gain that suits the kind: a coarse link encoder comes with a soft servo."""
    if kind == "small_servo_scale":
        return replace(joint, gain=float(rng.uniform(2.5e-5, 6e-5)))
    if kind == "coarse_encoder_jitter" and joint.drive == "position_servo":
        return replace(joint, gain=float(rng.uniform(2e-3, 4e-3)))
    return joint


def _with_channel_noise(spec: RigSpec, channel: str, k: int, rng: np.random.Generator) -> Sensors:
    """Independent noise on one channel as recorded, 1 to 1.5 times what the rig's other noise leaves in the balance."""
    low, high = BANDS[k % 2]
    rms = float(rng.uniform(1.0, 1.5)) * torque_left_by_noise(spec)
    scale = {"torque": 1.0, "position": 1.0 / torque_of_position(spec, low, high), "command": spec.joint.gain}[channel]
    noise: dict[str, float] = {f"{channel}_band": rms * scale}
    return replace(spec.sensors, band_hz=(low, high), **noise)  # type: ignore[arg-type]


def _sensors(kind: str, k: int, rng: np.random.Generator) -> Sensors:
    """The sensors of a null kind."""
    plain = Sensors(torque_noise=float(rng.uniform(0.2, 0.3)))
    special = _SENSORS.get(kind)
    return plain if special is None else special(plain, k, rng)


Change = Callable[[Sensors, int, np.random.Generator], Sensors]
_SENSORS: Mapping[str, Change] = {
    "coarse_encoder": lambda s, k, r: replace(s, encoder_step=2 * np.pi / 2 ** (12 + k % 3)),
    "coarse_encoder_jitter": lambda s, k, r: replace(
        s,
        encoder_step=2 * np.pi / 2**12,
        jitter=float(r.uniform(0.1, 0.35)),
        rate_hz=(1000, 500, 250, 200)[k % 4],
    ),
    "jitter_and_lost_rows": lambda s, k, r: replace(
        s, jitter=float(r.uniform(0.1, 0.35)), lost=float(r.uniform(0.005, 0.03))
    ),
    "coloured_noise": lambda s, k, r: replace(
        s, torque_noise=float(r.uniform(0.2, 0.4)), torque_noise_time=float(r.uniform(0.005, 0.05))
    ),
    "drifting_noise": lambda s, k, r: replace(s, torque_walk=float(r.uniform(0.2, 0.5))),
    "sampling_rate": lambda s, k, r: replace(s, rate_hz=(100, 250, 500, 125, 200)[k % 5]),
    "slow_rig": lambda s, k, r: replace(s, rate_hz=(100, 200, 125)[k % 3]),
    "warming_thermometer": lambda s, k, r: replace(s, temperature_drift=float(r.uniform(4.0, 10.0))),
    "data_sheet_bias": lambda s, k, r: replace(
        s, torque_bias=float(r.uniform(-1, 1) * TORQUE_BIAS), torque_gain=float(r.uniform(-1, 1) * TORQUE_GAIN)
    ),
}
