"""Two masses with backlash between them, step by step: a servo that sees the motor, an encoder on the link."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

STEP = 2e-5
EVERY = 200
"""Steps between two samples of the log."""
WEIGHT, INERTIA = 22.0, 1.1
"""Of the pendulum: m g l [N m] and m l^2 [kg m^2]."""


@dataclass(frozen=True)
class Gear:
    """Backlash [rad], stiffness of the servo [N m/rad], rotor [kg m^2], friction, a spring at the link [N m/rad], and
    the stiffness of the teeth [N m/rad].
    """

    backlash: float
    stiffness: float = 5000.0
    rotor: float = 0.4
    viscous: float = 30.0
    coulomb: float = 4.0
    spring: float = 0.0
    contact: float = 4e5


@njit
def _integrate(command, backlash, stiffness, rotor, viscous, coulomb, spring, contact):
    damping = 0.6 * np.sqrt(contact)
    motor = link = command[0]
    motor_rate = link_rate = 0.0
    out = np.empty((2, command.size // EVERY))
    for n in range(command.size):
        twist = motor - link
        depth = twist - min(max(twist, -0.5 * backlash), 0.5 * backlash)
        torque = contact * depth + damping * (motor_rate - link_rate) * (depth != 0.0)
        if backlash > 0.0 and torque * depth < 0.0:
            torque = 0.0
        if n % EVERY == 0:
            out[:, n // EVERY] = link, torque
        friction = viscous * motor_rate + coulomb * np.tanh(motor_rate / 1e-3)
        motor_rate += STEP * (stiffness * (command[n] - motor) - friction - torque) / rotor
        link_rate += STEP * (torque - WEIGHT * np.sin(link) - spring * link) / INERTIA
        motor += STEP * motor_rate
        link += STEP * link_rate
    return out


def run(gear: Gear, seed: int, duration: float = 16.0, late: int = 0) -> Run:
    """A log of command, link position and torque at 250 Hz, with 4 urad and 0.1 N m of noise.

    The position is recorded `late` samples after it was measured.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(round(duration / STEP)) * STEP
    waves = [(0.17, 0.45), (0.41, 0.3), (0.83, 0.2), (1.7, 0.06)]
    command = sum(a * np.sin(2.0 * np.pi * f * time + rng.uniform(0.0, 2.0 * np.pi)) for f, a in waves)
    numbers = (gear.backlash, gear.stiffness, gear.rotor, gear.viscous, gear.coulomb, gear.spring, gear.contact)
    link, torque = _integrate(command, *numbers)
    clock = time[::EVERY]
    columns = {
        "joint/position": np.roll(link, late) + 4e-6 * rng.standard_normal(link.size),
        "joint/position_command": command[::EVERY],
        "joint/torque": torque + 0.1 * rng.standard_normal(link.size),
    }
    return Run(f"run{seed}", None, clock, STEP * EVERY, columns, np.zeros(clock.size, dtype=np.int64))


def diagnose(gear: Gear, late: int = 0, *, torque_sensor: bool = False) -> JointResult:
    """Two training runs and a held-out one; the rotor and the pendulum are declared, or the torque is measured."""
    length = 0.3
    pendulum = {"mass": WEIGHT / (9.81 * length), "length": length, "inertia": INERTIA}
    rig = parse_rig(
        {
            "joint": "joint",
            "drive": "position_servo",
            "load": "torque" if torque_sensor else {"pendulum": pendulum},
            "declared": {"rotor_inertia": gear.rotor},
        }
    )
    runs = [run(gear, seed, late=late) for seed in range(3)]
    return diagnose_joint(runs[:2], runs[2:], rig, "joint", DiagnosisOptions())
