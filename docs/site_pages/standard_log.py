"""One log on which every effect is shown: a joint that follows sines of growing speed under a pendulum's load."""

import numpy as np

from drake_tc.effects.base import Context, DriveKind, Signals
from drake_tc.types import FloatArray

SECONDS, PERIOD = 12.0, 4e-3
GAIN: dict[str, float] = {"position_servo": 2e-4, "current": 0.08, "voltage": 0.5, "torque": 1.0}
"""Drive gain K by kind of drive [effort/(N m)]."""
INERTIA, VISCOUS, COULOMB, MOMENT, LINK = 0.3, 3.0, 4.0, 40.0, 1.2
"""Rotor [kg m^2], friction [N m s/rad] and [N m], largest weight of the load [N m], inertia of the load [kg m^2]."""


def motion() -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Time [s], position [rad], velocity [rad/s] and acceleration [rad/s^2], each (T,)."""
    time = np.arange(0.0, SECONDS, PERIOD)
    frequency, amplitude = 2.0 * np.pi * np.array([0.15, 0.41, 0.9]), np.array([0.9, 0.4, 0.15])
    angle = np.outer(time, frequency) + np.array([0.3, 1.1, 2.0])
    grow = 0.3 + 0.7 * time / SECONDS
    shape, slope = np.sin(angle) @ amplitude, np.cos(angle) @ (amplitude * frequency)
    curve, rate = -np.sin(angle) @ (amplitude * frequency**2), 0.7 / SECONDS
    return time, grow * shape, grow * slope + rate * shape, grow * curve + 2.0 * rate * slope


def signals(drive: DriveKind) -> Signals:
    """What an effect may look at, over the log, with everything recorded."""
    time, q, v, a = motion()
    load = MOMENT * np.sin(q) + LINK * a
    torque = load + INERTIA * a + VISCOUS * v + COULOMB * np.sign(v)
    effort = GAIN[drive] * torque
    servo = drive == "position_servo"
    nil = np.zeros_like(q)
    return Signals(
        time=time,
        position=q,
        velocity=v,
        acceleration=a,
        load_torque=load,
        expected_torque=load,
        slow_torque=load,
        effort=effort,
        command=q + effort if servo else effort,
        direction=np.sign(v),
        travel=_travel(q, v),
        load_slope=MOMENT * np.cos(q),
        temperature=25.0 + 20.0 * (1.0 - np.exp(-time / 5.0)),
        motor_position=q + torque / 2e4,
        supply_voltage=24.0 - 2.0 * np.abs(torque) / np.abs(torque).max(),
        known_torque=nil,
        rotor_inertia=INERTIA,
        link_inertia=LINK,
        viscous=VISCOUS,
        stiffness=1.0 / GAIN[drive] if servo else 0.0,
        period=PERIOD,
    )


def context(drive: DriveKind, load: str) -> Context:
    """The same log as a search sees it before it looks at the data."""
    seen = signals(drive)
    names = ("position", "velocity", "acceleration", "load_torque", "effort", "command", "temperature")
    return Context(
        drive=drive,
        load=load,  # type: ignore[arg-type]
        recorded=frozenset({*names, "motor_position", "supply_voltage"}),
        declared={"rotor_inertia": INERTIA},
        link_inertia=LINK,
        max_speed=float(np.abs(seen.velocity).max()),
        position_span=(float(seen.position.min()), float(seen.position.max())),
        effort_span=(float(seen.effort.min()), float(seen.effort.max())),
        period=PERIOD,
        torque_span=(float(seen.load_torque.min()), float(seen.load_torque.max())),
        duration=SECONDS,
        supply_voltage=24.0,
        supply_change=2.0,
        temperature_span=(25.0, 45.0),
        fitted={"gain": GAIN[drive], "viscous": VISCOUS, "coulomb": COULOMB},
    )


def _travel(q: FloatArray, v: FloatArray) -> FloatArray:
    """Distance moved since the last reversal [rad]."""
    turned = np.flatnonzero(np.diff(np.sign(v)) != 0.0) + 1
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(q)))])
    start = np.zeros_like(path)
    for place in turned:
        start[place:] = path[place]
    return path - start
