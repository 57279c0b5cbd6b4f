# ruff: noqa: E501  (one row of the table a line)
"""Errors and noise of the sensors of one joint, within their tolerances and beyond."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from drake_tc.logs.record import Run

from .. import pendulum_rig
from ..pendulum_rig import Swing
from ..rigs import COMMAND, Extra, Joint, Motion, record, servo
from .case import ANY, NULL, RED, Case, Is, Record
from .friction import wandering
from .recorders import SHIFTS, changed, logs_of, recorder

NOTHING: frozenset[str] = frozenset()
CONSTANTS = tuple(frozenset({name}) for name in ("torque_sensor_bias", "asymmetric_friction", "effort_bias"))
"""A constant in motion is any of these."""
JOINT = Joint(torque_noise=0.1, encoder_step=1e-5, duration=12.0, period=4e-3)
TOLERANCE = {"torque": {"bias": "0.2 N*m", "gain": "1 %"}}


def sensor(bias: float, gain: float = 0.0) -> Extra:
    return lambda m: bias + gain * m.tau


def read_by(error: Extra, tolerances: object = None, joint: Joint = JOINT) -> Record:
    """A torque sensor with this error, of these declared tolerances."""
    return logs_of(replace(joint, sensor=error), rig={"sensors": tolerances})


def holds(joint: Joint, room: float = 0.0) -> dict[str, float | Is]:
    """The intervals of gain and friction hold the truth."""
    truth = {"drive.gain": joint.gain, "viscous.viscous": joint.viscous, "coulomb.coulomb": joint.coulomb}
    return {key: Is(value, room, interval=True) for key, value in truth.items()}


FINE = replace(JOINT, torque_noise=0.05)
OFFSET = 0.01
TORQUES = [
    Case("sensors: a bias without a tolerance", read_by(sensor(0.25)), {"torque_sensor_bias": {"bias": Is(0.25, 0.1)}}, CONSTANTS),
    Case("sensors: a bias within tolerance", read_by(sensor(0.25), TOLERANCE), values=holds(JOINT)),
    Case("sensors: a bias of five tolerances", read_by(sensor(1.0), TOLERANCE), {"torque_sensor_bias": {"bias": Is(1.0, 0.01)}}),
    Case("sensors: a scale within tolerance", read_by(sensor(0.1, 0.015), TOLERANCE, FINE), values=holds(JOINT)),
    Case("sensors: a scale of six tolerances", read_by(sensor(0.1, 0.06), TOLERANCE, FINE), {"torque_sensor_gain": {"gain_error": Is(0.06, 0.0, interval=True)}}),
    Case("sensors: a scale that nothing tells", read_by(sensor(0.0, 0.01), TOLERANCE, replace(FINE, inertia=0.0)), values=holds(JOINT)),
    Case("sensors: a scale 25 % too large beside a heavy rotor",
         logs_of(Joint(inertia=1.2, torque_noise=0.05, sensor=lambda m: 0.25 * m.tau)),
         {"torque_sensor_gain": {"gain_error": Is(0.25, 0.02)}}, values={"drive.gain": Is(0.08, 0.01), "viscous.viscous": Is(6.0, 0.01)}),
    Case("sensors: a torque that drifts", read_by(lambda m: 0.15 * m.time), {"torque_sensor_drift": {}}),
    Case("sensors: the zero of a servo's encoder",
         logs_of(replace(servo(torque_noise=0.05), extra=lambda m: -OFFSET / 2e-3 * np.ones_like(m.q))),
         {"encoder_offset": {"offset": Is(OFFSET, 0.01)}},
         (frozenset({"encoder_offset"}), *CONSTANTS), values={"drive.gain": Is(2e-3, 0.01)}),
]  # fmt: skip


def two_joints(number: int, seed: int) -> Run:
    """A hip and a knee with the same bias."""
    made = [record(replace(JOINT, sensor=sensor(0.25)), f"run_{number}", SHIFTS[number], 1000 * seed + number + 10 * k, label)
            for k, label in enumerate(("hip", "knee"))]  # fmt: skip
    return replace(made[0], columns={**made[0].columns, **made[1].columns})


OF_TWO = {"torque": {"bias": "5 mN*m"}, "hip": {"torque": {"bias": "0.2 N*m"}}}

# ---- zeros of an encoder and of a current, on a pendulum


def pendulum(sensors: object = None, offset: float = 0.0, constant: float = 0.0) -> Record:
    """A pendulum whose encoder reads q + offset, and whose current is that of `constant` [N m] too high."""
    swing, rotor = Swing(constant=constant, duration=12.0, period=4e-3, effort_noise=1e-3), 0.05
    load = {"mass": 1.0, "length": 2.5 / 9.81, "inertia": swing.inertia - rotor, "zero": swing.zero}
    rig = {"joint": "joint", "drive": "current", "load": {"pendulum": load}, "declared": {"rotor_inertia": rotor}}

    def run(number: int, seed: int) -> Run:
        made = pendulum_rig.record(swing, f"run_{number}", 1000 * seed + number, 0.37 * number)
        return changed(made, position=made.columns["joint/position"] + offset)

    return recorder(rig | ({"sensors": sensors} if sensors else {}), run)


OF_SWING: dict[str, float | Is] = {
    "coulomb.coulomb": Is(0.4, 0.0, interval=True),
    "viscous.viscous": Is(0.2, 0.0, interval=True),
}
ENCODER, CURRENT = {"encoder": {"offset": "0.01 rad"}}, {"current": {"bias": "20 mA"}}
ZEROS = [
    Case("sensors: tolerances by joint", recorder(
        {"joints": ["hip", "knee"], "drive": "current", "declared": {"rotor_inertia": 0.3}, "sensors": OF_TWO}, two_joints),
        {"knee/torque_sensor_bias": {}}),
    Case("sensors: the zero of an encoder within tolerance", pendulum(ENCODER, 0.02), values=OF_SWING),
    Case("sensors: the zero of an encoder of eight tolerances", pendulum(ENCODER, 0.08), {"encoder_offset": {"offset": Is(0.08, 0.0, interval=True)}}, values=OF_SWING),
    Case("sensors: the zero of a current within tolerance", pendulum(CURRENT, constant=0.05), values=OF_SWING),
    Case("sensors: the zero of a current of 1.6 tolerances", pendulum(CURRENT, constant=-0.08), values=OF_SWING),
    Case("sensors: the zero of a current of six tolerances", pendulum(CURRENT, constant=0.3), {"effort_bias": {}}, CONSTANTS[1:], values=OF_SWING),
    Case("sensors: the zero of a current without a tolerance", pendulum(constant=0.05), {"effort_bias": {}}, CONSTANTS[1:]),
]  # fmt: skip

# ---- white and coloured noise

PERIOD = 4e-3


def swung(number: int, seed: int) -> pd.DataFrame:
    """A servo's joint that lacks nothing: J 0.3 kg m^2, viscous 2 N m s/rad, Coulomb 1.5 N m; torque noise 0.1 N m."""
    rng = np.random.default_rng(10 * seed + number)
    t, phase = np.arange(5000) * PERIOD, rng.uniform(0.0, 2.0 * np.pi, 4)
    w = np.array([1.3, 2.1, 3.7, 5.3]) * (1.0 + 0.05 * rng.standard_normal(4))
    a = np.array([0.5, 0.3, 0.1, 0.05])
    angle = np.outer(t, w) + phase
    q, v, acceleration = np.sin(angle) @ a, np.cos(angle) @ (a * w), -np.sin(angle) @ (a * w**2)
    tau = 8.0 * np.sin(3.1 * t + phase[0]) + 4.0 * np.sin(1.7 * t + phase[1])
    command = q + 2e-3 * (tau + 0.3 * acceleration + 2.0 * v + 1.5 * np.tanh(50.0 * v))
    torque = tau + 0.1 * rng.standard_normal(t.size)
    return pd.DataFrame({"time": t, "joint/position": q, "joint/position_command": command, "joint/torque": torque})


def noisy_current(number: int, seed: int) -> pd.DataFrame:
    table = swung(number, seed)
    current = 10.0 * (table["joint/position_command"] - table["joint/position"])
    noise = 0.01 * np.random.default_rng([seed, number]).standard_normal(len(table))
    return table.drop(columns="joint/position_command").assign(**{"joint/current": current + noise})


def ar1(rng: np.random.Generator, size: int, memory: float, period: float) -> np.ndarray:
    """Noise (T,) of unit standard deviation that is correlated over `memory` [s]."""
    pole = np.exp(-period / memory)
    return np.asarray(np.sqrt(1.0 - pole**2) * lfilter([1.0], [1.0, -pole], rng.standard_normal(size + 5000))[5000:])


def noisy_torque(number: int, seed: int) -> pd.DataFrame:
    table = swung(number, seed)
    noise = 0.6 * ar1(np.random.default_rng([5, seed, number]), len(table), 0.02, PERIOD)
    return table.assign(**{"joint/torque": table["joint/torque"] + noise})


def on_swung(run: Callable[[int, int], pd.DataFrame], drive: str = "position_servo", sensors: object = None) -> Record:
    document = {"joint": "joint", "drive": drive, "declared": {"rotor_inertia": 0.3}}
    return recorder(document | ({"sensors": sensors} if sensors else {}), run)


def of_band(
    size: int, period: float, low_hz: float, high_hz: float, rms: float, rng: np.random.Generator
) -> np.ndarray:
    """Noise (T,) of this RMS between two frequencies."""
    f = np.fft.rfftfreq(size, period)
    noise = np.fft.irfft(np.where((f < low_hz) | (f > high_hz), 0.0, np.fft.rfft(rng.standard_normal(size))), size)
    return np.asarray(rms * noise / np.std(noise))


def noisy(drive: str, channel: str, rms: float, band: tuple[float, float]) -> Record:
    """Independent noise of several noise floors on one channel of a joint that lacks nothing."""
    joint = Joint(
        duration=30.0, period=4e-3, torque_noise=0.05, drive=drive, gain=2e-3 if drive == "position_servo" else 0.08
    )  # type: ignore[arg-type]

    def run(number: int, seed: int) -> Run:
        made = record(joint, f"run_{number}", SHIFTS[number], 1000 * seed + number)
        name, size = (COMMAND[drive], rms * joint.gain) if channel == "effort" else (channel, rms)
        noise = of_band(len(made), made.period, *band, size, np.random.default_rng([seed, number]))
        return changed(made, **{name: made.columns[f"joint/{name}"] + noise})

    return recorder({"joint": "joint", "drive": drive, "declared": {"rotor_inertia": 0.3}}, run)


def coloured(m: Motion) -> np.ndarray:
    return 0.3 * ar1(np.random.default_rng(round(1e6 * abs(float(m.q[0])))), m.q.size, 0.02, float(m.time[1]))


def walk_and(size: float) -> Extra:
    """The same walk of 0.6 N m RMS in every run, and a constant: only its size tells it from the walk."""

    def extra(m: Motion) -> np.ndarray:
        walk = np.cumsum(np.random.default_rng(7).standard_normal(m.time.size))
        return np.asarray(0.6 * (walk - walk.mean()) / np.std(walk) + size)

    return extra


LEVELS = frozenset({"torque_sensor_drift", "torque_sensor_bias", "asymmetric_friction", "cable_spring", "effort_bias"})
GREEN_OR_LOUD = NULL | {"unexplained_residual", "cannot_tell"}
OF_SWUNG = {"viscous.viscous": 2.0, "coulomb.coulomb": 1.5}
NOISES = [
    Case("sensors: white noise of a torque under a servo", on_swung(swung), values=OF_SWUNG, seeds=(0, 1)),
    Case("sensors: white noise of a current", on_swung(noisy_current, "current"), values=OF_SWUNG, seeds=(0, 1)),
    Case("sensors: coloured noise of a torque", on_swung(noisy_torque)),
    Case("sensors: coloured noise of a torque, declared", on_swung(noisy_torque, sensors={"torque_noise": 0.6, "correlation_time": 0.02})),
    Case("sensors: more noise of a torque than is declared", on_swung(noisy_torque, sensors={"torque_noise": 0.1}), verdicts=RED - {"unexplained_structure"}),
    Case("sensors: noise of a torque that is correlated over 20 ms", logs_of(Joint(duration=40.0, sensor=coloured))),
    *(Case(f"sensors: noise of the {channel} of a {drive}, {band[0]:g} to {band[1]:g} Hz", noisy(drive, channel, rms, band),
           verdicts=GREEN_OR_LOUD)
      for drive in ("position_servo", "current")
      for channel, rms, band in (("torque", 0.6, (1.0, 5.0)), ("torque", 0.6, (0.05, 0.3)), ("position", 2e-4, (1.0, 5.0)),
                                 ("effort", 0.6, (1.0, 5.0)))),
    Case("sensors: a torque that wanders is no drift, bias, asymmetry or spring",
         logs_of(Joint(torque_noise=0.25, sensor=wandering(0.4)), train=3), never=LEVELS, seeds=(0, 1, 2)),
    Case("sensors: a bias smaller than a walk", logs_of(Joint(duration=12.0, period=4e-3, torque_noise=0.2, extra=walk_and(0.1)), train=3), never=LEVELS, verdicts=ANY),
    Case("sensors: a bias larger than a walk", logs_of(Joint(duration=12.0, period=4e-3, torque_noise=0.2, extra=walk_and(4.0)), train=3),
         {"torque_sensor_bias": {}}, CONSTANTS, verdicts=ANY - NULL),
]  # fmt: skip

# ---- a wave of a coarse encoder that the servo does not use

STEP = 2.9e-3


def wavy(amplitude: float) -> Record:
    joint = Joint(duration=40.0, period=4e-3, torque_noise=0.2, gain=2e-2)

    def change(table: pd.DataFrame) -> pd.DataFrame:
        q = table["joint/position"]
        error = amplitude * (0.6 * np.sin(12.0 * q) - 0.8 * np.cos(12.0 * q))
        return table.assign(**{"joint/position": np.round((q + error) / STEP) * STEP})

    return logs_of(joint, change)


WAVES = [
    Case("sensors: a wave of an encoder below one of its steps", wavy(1.3e-3), {"encoder_ripple": {}}),
    Case("sensors: a coarse encoder without a wave", wavy(0.0)),
]

CASES = [*TORQUES, *ZEROS, *NOISES, *WAVES]
