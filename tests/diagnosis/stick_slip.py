"""A soft position servo that sticks, by an integrator of its own: Coulomb friction with rest as a state."""

from dataclasses import dataclass

import numpy as np

from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, parse_rig

from .rigs import Logged

JOINT = "servo"
GRAVITY = 9.81
FINE = 2e-4
"""Step of the integrator [s]."""


@dataclass(frozen=True)
class Servo(Logged):
    """True numbers; the pendulum's are declared, the encoder has 12 bits."""

    period: float = 5e-3
    duration: float = 8.0
    encoder_step: float = 2 * np.pi / 4096
    stiffness: float = 3.0
    inertia: float = 0.003
    viscous: float = 0.06
    coulomb: float = 0.16
    mass: float = 0.5
    length: float = 0.1


def simulated(servo: Servo, command: np.ndarray) -> np.ndarray:
    """Position (T,) [rad], from rest at 0, of the command (T,) [rad], which is held from sample to sample."""
    moment, total = servo.mass * GRAVITY * servo.length, servo.inertia + servo.mass * servo.length**2
    steps = round(servo.period / FINE)
    q, v, out = 0.0, 0.0, np.empty(command.size)
    for k, wanted in enumerate(command.tolist()):
        out[k] = q
        for _ in range(steps):
            drive = servo.stiffness * (wanted - q) - moment * np.sin(q) - servo.viscous * v
            if v == 0.0 and abs(drive) <= servo.coulomb:
                continue
            direction = np.sign(v) if v != 0.0 else np.sign(drive)
            faster = v + FINE * (drive - servo.coulomb * direction) / total
            v = 0.0 if faster * direction < 0.0 else faster
            q += FINE * v
    return out


def commands(servo: Servo) -> list[np.ndarray]:
    """Slow sines and ramps, (T,) each [rad]: most of the time the joint sticks."""
    t = servo.times()
    return [
        1.2 * np.sin(1.1 * t) * np.sin(0.4 * t),
        0.9 * np.sin(2.3 * t) + 0.2 * np.sin(7.0 * t),
        1.1 * np.clip(np.sin(0.9 * t), -0.7, 0.7),
        0.8 * np.sin(0.7 * t) + 0.3 * np.sin(3.1 * t),
    ]


def runs_of(servo: Servo, seed: int = 0) -> tuple[list[Run], list[Run]]:
    """(three training runs, a held-out run)."""
    rng = np.random.default_rng(seed)
    made = []
    for number, command in enumerate(commands(servo)):
        position = servo.encoder(simulated(servo, command), rng)
        made.append(servo.run(f"run{number}", {f"{JOINT}/position": position, f"{JOINT}/position_command": command}))
    return made[:3], made[3:]


def rig_of(servo: Servo) -> Rig:
    """The pendulum is known, the rotor's inertia is fitted."""
    load = {"pendulum": {"mass": servo.mass, "length": servo.length}}
    return parse_rig({"joint": JOINT, "drive": "position_servo", "load": load, "declared": ["rotor_inertia"]})
