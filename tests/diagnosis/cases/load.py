# ruff: noqa: E501  (one row of the table a line)
"""Pendulums whose weight is wrong, loads of which nothing is known, masses that differ by run, axes that slide."""

from dataclasses import replace

import numpy as np
import pandas as pd

from drake_tc.logs.record import Run
from drake_tc.types import GRAVITY

from .. import pendulum_rig
from ..pendulum_rig import Swing
from ..rigs import Motion, servo
from .case import ANY, NULL, Case, Is, Record
from .recorders import changed, logs_of, recorder, swings_of

NOTHING: frozenset[str] = frozenset()
PAYLOAD = frozenset({"payload"})

# ---- a pendulum whose declared mass is wrong under a drive whose gain is declared, and the reverse

ROTOR, LENGTH = 0.05, 0.25
SWING = Swing(constant=0.0, duration=12.0, period=4e-3, effort_noise=1e-3)
KNOWN = {"rotor_inertia": ROTOR}


def interval(value: float, by: float = 0.0) -> Is:
    return Is(value, 0.01, by, interval=True)


def loaded(arm: float, *, gain_declared: bool) -> Case:
    """A point mass at `arm` pendulum lengths beside the declared pendulum, of 35 % of the moment.

    Without a declared gain only the ratio of inertia to moment is seen, and the least moment that explains it.
    """
    moment, arm_m = 0.35 * SWING.moment, arm * LENGTH
    own, own_inertia = SWING.moment - moment, SWING.inertia - ROTOR - moment * arm_m / 9.81
    load = {"mass": own / (9.81 * LENGTH), "length": LENGTH, "inertia": own_inertia, "zero": SWING.zero}
    least = (ROTOR + own_inertia) * SWING.moment / SWING.inertia - own
    more = {} if gain_declared else {"drive_gain": None}
    room = 0.01 * SWING.inertia
    truth = {"payload_moment": interval(moment), "payload_inertia": interval(moment * arm_m / 9.81, room)}
    return Case(
        f"load: a payload at {arm:g} lengths, the gain {'declared' if gain_declared else 'free'}",
        swings_of(SWING, {"pendulum": load}, declared=KNOWN, **more),
        {"payload": truth if gain_declared else {"payload_moment": interval(least)}},
    )


def mistaken(share: float = 0.0, gain_error: float = 0.0, rotor: float = ROTOR) -> Record:
    """The true load is (1 + share) times the declared one, the true 1/K (1 + gain_error) times the declared one."""
    mass, inertia = SWING.moment / (9.81 * LENGTH * (1.0 + share)), (SWING.inertia - ROTOR) / (1.0 + share)
    load = {"mass": mass, "length": LENGTH, "inertia": inertia, "zero": SWING.zero}
    gain = SWING.gain * (1.0 + gain_error)
    return swings_of(SWING, {"pendulum": load}, drive_gain=gain, declared={"rotor_inertia": rotor})


FRICTION = {"viscous.viscous": interval(SWING.viscous), "coulomb.coulomb": interval(SWING.coulomb)}
ADDED = 0.3 / 1.3
WRONG = [
    *(loaded(arm, gain_declared=False) for arm in (0.0, 0.3, 0.6, 1.0)),
    *(loaded(arm, gain_declared=True) for arm in (0.0, 0.3, 0.6, 2.0)),
    Case("load: a pendulum lighter than declared", mistaken(-0.2), {"payload": {"payload_share": interval(-0.2)}},
         values=FRICTION | {"drive.gain": Is(SWING.gain, 1e-6)}),
    Case("load: a pendulum heavier than declared", mistaken(0.3),
         {"payload": {"payload_moment": interval(ADDED * SWING.moment), "payload_inertia": interval(ADDED * (SWING.inertia - ROTOR))}},
         values=FRICTION | {"drive.gain": Is(SWING.gain, 1e-6)}),
    Case("load: a declared gain that is wrong is no wrong pendulum", mistaken(gain_error=0.25), {"servo_gain": {"gain_error": interval(0.25)}}),
    Case("load: a wrong rotor is not told as a wrong gain and a wrong load", mistaken(rotor=0.6 * ROTOR),
         allowed=(NOTHING, frozenset({"rotor_inertia"}), PAYLOAD), verdicts=ANY),
]  # fmt: skip

# ---- unknown loads

FREE = replace(Swing(), period=4e-3)
SERVO = replace(FREE, drive="position_servo", gain=0.01, encoder_noise=2e-5)
SMOOTH = {"unknown": "smooth"}


def curve(q: np.ndarray) -> np.ndarray:
    return np.asarray(1.5 * np.sin(2.0 * q) + 0.5 * q)


def stribeck(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.asarray(0.5 * np.sign(v) * np.exp(-((v / 0.3) ** 2)))


def load_friction(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.asarray(0.1 * np.abs(FREE.moment * np.sin(q - FREE.zero) + FREE.constant + FREE.inertia * a) * np.sign(v))


def weighed(swing: Swing, scale: float = 1.0, rotor: float = 0.0) -> dict[str, float | Is]:
    """What is fitted of a load and the friction beside it."""
    return {
        "load.moment": Is(scale * swing.moment, 0.02),
        "load.inertia": Is(scale * (swing.inertia - rotor), 0.02),
        "load.constant": Is(scale * swing.constant, 0.02, 0.002 * scale),
        "load.zero": Is(swing.zero, 0.0, 0.02),
        "viscous.viscous": Is(scale * swing.viscous, 0.02),
        "coulomb.coulomb": Is(scale * swing.coulomb, 0.02),
    }


HEAVIER = replace(FREE, moment=1.6 * FREE.moment, inertia=1.6 * FREE.inertia)
VOLTAGE = replace(FREE, drive="voltage", zero=-2.0, size=1.4)
CURVED = replace(FREE, gravity=curve, constant=0.0)
FREE_LOADS = [
    Case("load: unknown, current", swings_of(FREE), values=weighed(FREE), seeds=(0, 1, 2)),
    Case("load: unknown, position servo", swings_of(SERVO), values=weighed(SERVO)),
    Case("load: unknown, voltage", swings_of(VOLTAGE), values=weighed(VOLTAGE)),
    Case("load: unknown beside a declared rotor", swings_of(FREE, declared=KNOWN), values=weighed(FREE, rotor=ROTOR)),
    Case("load: unknown without a scale", swings_of(FREE, drive_gain=None, declared=KNOWN), values=weighed(FREE, FREE.gain)),
    Case("load: unknown without a scale, position servo", swings_of(SERVO, drive_gain=None), values=weighed(SERVO, SERVO.gain)),
    Case("load: smooth", swings_of(CURVED, SMOOTH), values={"load.inertia": Is(0.15, 0.02), "drive.gain": Is(0.4, 0.02)}),
    Case("load: smooth, scaled by a declared rotor",
         swings_of(CURVED, SMOOTH, drive_gain=None, declared={"rotor_inertia": 0.15}), values={"drive.gain": Is(0.4, 0.02)}),
    Case("load: smooth over a small travel", swings_of(replace(FREE, size=0.05), SMOOTH)),
    Case("load: a pendulum over a small travel is refused", swings_of(replace(FREE, size=0.05)),
         refusal=r"cannot be fitted to a motion over 0\.1\d* rad.*load: \{unknown: smooth\}"),
    Case("load: unknown, the effort has the wrong sign", swings_of(replace(FREE, gain=-0.4, constant=0.0), drive_gain=0.4), refusal="the effort has the wrong sign"),
    Case("load: unknown beside a Stribeck friction", swings_of(replace(FREE, extra=stribeck)),
         {"stribeck": {"stribeck": Is(0.5, 0.1)}}, values={"load.moment": Is(2.5, 0.02), "load.inertia": Is(0.15, 0.02)}),
    Case("load: unknown beside friction that grows with it", swings_of(replace(FREE, extra=load_friction)),
         {"load_dependent_friction": {"load_friction": Is(0.1, 0.1)}},
         values={"load.moment": Is(2.5, 0.02), "load.inertia": Is(0.15, 0.02)}),
    Case("load: unknown, another one in each run", swings_of([FREE, HEAVIER, FREE]), verdicts=ANY),
    *(Case(f"load: unknown, a constant by {name} is no effect",
           swings_of(replace(FREE, constant=constant, extra=lambda q, v, a, by=half: np.full_like(q, by))),
           values={"load.constant": Is(constant + half, 0.05, 2e-3)})
      for name, constant, half in (("nothing", 0.0, 0.0), ("preload", 0.12, 0.0), ("direction", 0.0, 0.06))),
]  # fmt: skip

# ---- runs with different masses on one pendulum

BASE = Swing(duration=14.0, constant=0.0, zero=0.0, encoder_noise=2e-5)
MASSES = {"light_1": 0.5, "heavy_1": 1.4, "light_2": 0.5}
BY_NAME = {"light_*": 0.5, "heavy_*": 1.4}


def by_run(mass: object, names: tuple[str, ...] = tuple(MASSES)) -> Record:
    def run(number: int, seed: int) -> Run:
        true = list(MASSES.values())[number]
        swing = replace(BASE, moment=true * GRAVITY * 0.3, inertia=true * 0.3**2)
        return pendulum_rig.record(swing, names[number], 1000 * seed + number, 0.37 * number)

    load = {"pendulum": {"mass": mass, "length": 0.3}}
    return recorder({"joint": "joint", "drive": "current", "load": load}, run)


def hanging(m: Motion) -> np.ndarray:
    return np.asarray(8.0 * np.sin(m.q) + 0.3 * m.a - m.tau)  # no hand: the load is the pendulum alone


UPSIDE_DOWN = {"pendulum": {"mass": 8.0 / 9.81, "length": 1.0, "inertia": 0.3, "zero": float(np.pi)}}
MASS = [
    Case("load: a mass for each run", by_run(BY_NAME), values={"drive.gain": Is(BASE.gain, 2e-3)}),
    Case("load: one mass for runs with two", by_run(0.95), never=frozenset({"load_dependent_friction"}), verdicts=ANY - NULL, may_refuse="not of one joint"),
    Case("load: a run without a mass is refused", by_run(BY_NAME, ("haevy_1", "heavy_1", "light_2")),
         refusal=r"haevy_1\.npz: no mass: .*did you mean 'heavy_\*'"),
    Case("load: a negative mass is refused", by_run({"*": -1}), refusal=r"load\.pendulum\.mass\.\*: expected a positive number, got -1"),
    Case("load: a pendulum that runs against its declared weight",
         logs_of(servo(duration=12.0, encoder_step=1e-5, extra=hanging), rig={"load": UPSIDE_DOWN}),
         allowed=(NOTHING, PAYLOAD, frozenset({"encoder_offset"})), verdicts=ANY - NULL, may_refuse="sign|zero|gain"),
]  # fmt: skip

# ---- torques in another unit

TORQUE = Swing(drive="torque", gain=1.0, moment=2.5, zero=0.0, constant=0.0, inertia=0.15, effort_noise=2e-3)
POINT = TORQUE.moment**2 / (9.81**2 * TORQUE.inertia)
AS_POINT = {"pendulum": {"mass": POINT, "length": TORQUE.moment / (POINT * 9.81)}}


def scaled(scale: float, load: object = AS_POINT, torque: float = 0.0, **keys: object) -> Record:
    """The log has `scale` times the drive's torque and, where given, `torque` times the load's."""
    drive = str(keys.get("drive", "torque"))
    swing = replace(TORQUE, gain=scale, effort_noise=2e-3 * scale, drive=drive)  # type: ignore[arg-type]

    def run(number: int, seed: int) -> Run:
        made = pendulum_rig.record(swing, f"run_{number}", 1000 * seed + number, 0.37 * number)
        q, _, a = pendulum_rig.motion(swing, 0.37 * number)
        return changed(made, torque=torque * (swing.moment * np.sin(q) + swing.inertia * a)) if torque else made

    return recorder({"joint": "joint", "drive": "torque", "load": load} | keys, run)


UNITS = [
    Case("load: a torque command in mN m is refused", scaled(1e3),
         refusal=r"joint/torque_command is in mN\*m and not in N\*m; set units: \{joint/torque_command: mN\*m\}"),
    Case("load: a torque command in N m that is stated in mN m is refused", scaled(1.0, units={"torque_command": "mN*m"}),
         refusal=r"is in N\*m and not in mN\*m; set units: \{joint/torque_command: N\*m\}"),
    Case("load: a torque command in mN m is refused beside a declared gain", scaled(1e3, drive_gain=1.0), refusal=r"is in mN\*m and not in N\*m"),
    Case("load: a measured torque in mN m is refused", scaled(1.0, "torque", 1e3), refusal=r"joint/torque is in mN\*m and not in N\*m"),
    Case("load: a measured torque in N m that is stated in mN m is refused", scaled(1.0, "torque", 1.0, units={"torque": "mN*m"}), refusal=r"joint/torque is in N\*m and not in mN\*m"),
    Case("load: a torque on the motor's side of a gear", scaled(1.0 / 160.0), values={"drive.gain": Is(1.0 / 160.0, 0.02)}),
    Case("load: a stated factor is believed", scaled(1e3, units={"torque_command": 1.0}), values={"drive.gain": Is(1e3, 0.02)}),
    Case("load: a declared gain is believed", scaled(1e3, drive_gain=1e3)),
    Case("load: a current of large numbers", scaled(1e3, drive="current"), values={"drive.gain": Is(1e3, 0.02)}),
]  # fmt: skip

# ---- a linear axis with a ball screw

GAIN, COULOMB, VISCOUS, CARRIAGE, SCREW, LEAD = 1 / 95.0, 25.0, 60.0, 12.0, 18.0, 0.010
WEIGHT, PERIOD = CARRIAGE * 9.81, 4e-3


def sliding(rig: dict[str, object], spring: float = 0.0, ripple: float = 0.0, *, sensor: bool = True) -> Record:
    """A run of 16 s in which the axis follows sinusoids exactly; the current is what the balance asks for."""

    def run(number: int, seed: int) -> pd.DataFrame:
        frequencies, amplitude = (([0.13, 0.31], 0.05), ([0.4, 0.9], 0.02), ([0.2, 0.6], 0.04))[number]
        rng, t = np.random.default_rng([seed, number]), np.arange(0.0, 16.0, PERIOD)
        q, v, a = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
        for w in 2 * np.pi * np.array(frequencies):
            angle = w * t + rng.uniform(0, 6)
            q += amplitude * np.sin(angle)
            v += amplitude * w * np.cos(angle)
            a -= amplitude * w**2 * np.sin(angle)
        load = CARRIAGE * a + WEIGHT
        force = (
            load + SCREW * a + COULOMB * np.sign(v) + VISCOUS * v + spring * q + ripple * np.sin(2 * np.pi * q / LEAD)
        )
        columns = {
            "time": t,
            "z/position": np.round(q / 5e-6) * 5e-6,
            "z/current": GAIN * force + rng.normal(0, 4e-3, t.size),
        }
        if sensor:
            columns["z/torque"] = load + rng.normal(0, 0.5, t.size)
        return pd.DataFrame(columns)

    return recorder({"joint": "z", "joint_type": "prismatic", "drive": "current"} | rig, run)


WEIGHED: dict[str, object] = {"load": "torque", "declared": {"rotor_inertia": SCREW}}
SLIDING = [
    Case("load: an axis that slides", sliding(WEIGHED), values={"coulomb.coulomb": Is(COULOMB, 0.02)}),
    Case("load: a ripple of the screw", sliding(WEIGHED, ripple=6.0),
         {"torque_ripple": {"cycles_per_turn": Is(2 * np.pi / LEAD, 1e-3), "ripple_sine": Is(6.0, 0.05)}},
         values={"coulomb.coulomb": Is(COULOMB, 0.02)}),
    Case("load: a spring beside an unknown mass", sliding({"load": "unknown", "drive_gain": GAIN}, spring=250.0, sensor=False),
         {"cable_spring": {"spring_stiffness": Is(250.0, 0.03)}},
         values={"load.inertia": Is(CARRIAGE + SCREW, 0.02), "load.constant": Is(WEIGHT, 0.02)}),
]  # fmt: skip

CASES = [*WRONG, *FREE_LOADS, *MASS, *UNITS, *SLIDING]
