"""A pendulum of which the rig says nothing: the motion is a closed form, the effort follows from its dynamics."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from drake_tc.effects.base import DriveKind
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, parse_rig

from .rigs import COMMAND, Logged, sines

JOINT = "joint"


@dataclass(frozen=True)
class Swing(Logged):
    """True numbers of the joint and its log; `extra` is torque (q, v, a) that no declared model has."""

    duration: float = 20.0
    encoder_noise: float = 1e-4
    drive: DriveKind = "current"
    gain: float = 0.4
    moment: float = 2.5
    zero: float = 0.3
    constant: float = 0.12
    inertia: float = 0.15
    viscous: float = 0.2
    coulomb: float = 0.4
    size: float = 1.0
    effort_noise: float = 2e-3
    extra: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray] | None = None
    gravity: Callable[[np.ndarray], np.ndarray] | None = None


def motion(swing: Swing, shift: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(q, v, a), (T,) each: three sines about 0.2 rad."""
    waves = ((0.11, 0.8, 0.0), (0.43, 0.4, 1.1), (0.97, 0.2, 2.3))
    q, v, a = sines(swing.times(), waves, shift)
    return 0.2 + swing.size * q, swing.size * v, swing.size * a


def record(swing: Swing, name: str, seed: int, shift: float = 0.0) -> Run:
    """y = K (m g l sin(q - z) + c + J a + F_v v + F_c sign v + extra), without a torque column."""
    rng = np.random.default_rng(seed)
    q, v, a = motion(swing, shift)
    gravity = swing.moment * np.sin(q - swing.zero) if swing.gravity is None else swing.gravity(q)
    torque = gravity + swing.constant + swing.inertia * a + swing.viscous * v + swing.coulomb * np.sign(v)
    if swing.extra is not None:
        torque = torque + swing.extra(q, v, a)
    servo = swing.drive == "position_servo"
    effort = swing.gain * torque + (q if servo else swing.effort_noise * rng.standard_normal(q.size))
    columns = {
        f"{JOINT}/position": swing.encoder(q, rng),
        f"{JOINT}/{COMMAND[swing.drive]}": effort,
    }
    return swing.run(name, columns)


def runs_of(swing: Swing, seed: int = 0) -> tuple[list[Run], list[Run]]:
    """(two training runs, a held-out run)."""
    made = [record(swing, f"run{k}", seed + 1000 * k, 0.37 * k) for k in range(3)]
    return made[:2], made[2:]


def rig_of(swing: Swing, load: Any = "unknown", **more: Any) -> Rig:
    """The rig as its owner writes it, the drive gain declared unless `more` says otherwise (None: not declared)."""
    document = {"joint": JOINT, "drive": swing.drive, "load": load, "drive_gain": swing.gain} | more
    return parse_rig({key: value for key, value in document.items() if value is not None})
