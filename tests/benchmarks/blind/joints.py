"""Draws plausible joints: orders of magnitude of geared robot joints, different from rig to rig."""

import numpy as np

from drake_tc.joint_simulator.measurement import GRAVITY
from drake_tc.joint_simulator.spec import Drive, Joint


def draw_joint(
    rng: np.random.Generator, drive: Drive, *, soft: bool = False, pendulum: tuple[float, float] | None = None
) -> Joint:
    """A joint with the drive; a `soft` servo has a lower gain, so that lags inside its loop stay stable.

    Gains: position servo 1e-4 to 2.2e-4 rad/(N m) (soft: 5e-4 to 8e-4), voltage 0.3 to 0.5 V/(N m), current
    0.06 to 0.12 A/(N m). With a pendulum, link inertia and gravity are those of its point mass.
    """
    if drive == "position_servo":
        gain = rng.uniform(5e-4, 8e-4) if soft else rng.uniform(1.0e-4, 2.2e-4)
        servo_damping = rng.uniform(20.0, 30.0)
    elif drive == "voltage":
        gain, servo_damping = rng.uniform(0.3, 0.5), rng.uniform(4.0, 7.0)
    else:
        gain, servo_damping = rng.uniform(0.06, 0.12), 0.0
    if pendulum is not None:
        mass, length = pendulum
        link, gravity = mass * length**2, mass * GRAVITY * length
    else:
        link, gravity = rng.uniform(0.5, 1.2), rng.uniform(14.0, 26.0)
    return Joint(
        drive=drive,
        gain=float(gain),
        servo_damping=float(servo_damping),
        viscous=float(rng.uniform(6.0, 10.0)),
        coulomb=float(rng.uniform(3.0, 5.0)),
        breakaway=float(rng.uniform(0.8e-4, 2e-4)),
        rotor_inertia=float(rng.uniform(0.3, 0.45)),
        link_inertia=float(link),
        gravity=float(gravity),
        heat_capacity=float(rng.uniform(25.0, 55.0)),
        ambient=float(rng.uniform(22.0, 28.0)),
        bandwidth=float(rng.uniform(22.0, 32.0)),
    )


def draw_pendulum(rng: np.random.Generator) -> tuple[float, float]:
    """(mass [kg], length [m]) with m g l about 15 to 35 N m."""
    return float(np.round(rng.uniform(3.0, 6.0), 3)), float(np.round(rng.uniform(0.45, 0.65), 3))
