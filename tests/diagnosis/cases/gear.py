# ruff: noqa: E501  (one row of the table a line)
"""Gears with play, soft gears, and what looks like one."""

from dataclasses import replace

import numpy as np

from drake_tc.logs.record import Run

from ..gear_with_backlash import INERTIA, WEIGHT, Gear, run
from ..rigs import Joint, record
from .case import ANY, NULL, RED, Case, Is, Record
from .recorders import SHIFTS, changed, recorder

LENGTH = 0.3
HUNG = {"pendulum": {"mass": WEIGHT / (9.81 * LENGTH), "length": LENGTH, "inertia": INERTIA}}


def geared(gear: Gear, late: int = 0, *, torque_sensor: bool = False) -> Record:
    """The rotor and the pendulum are declared, or the torque is measured."""
    rig = {"joint": "joint", "drive": "position_servo", "load": "torque" if torque_sensor else HUNG}
    return recorder(
        rig | {"declared": {"rotor_inertia": gear.rotor}}, lambda number, seed: run(gear, 10 * seed + number, late=late)
    )


def soft(compliance: float, late: float = 0.0) -> Record:
    """A current drive whose encoder and torque sensor stand on the link's side of a soft gear, and agree.

    The motor is ahead by the wind-up c tau; its rotor and its friction go with it.
    """
    joint = Joint(torque_noise=0.05, encoder_step=1e-5)

    def made(number: int, seed: int) -> Run:
        plain = record(replace(joint, torque_noise=0.0, encoder_step=0.0), f"run_{number}", SHIFTS[number])
        time, tau = plain.time, plain.columns["joint/torque"]
        motor = plain.columns["joint/position"] + compliance * tau
        v = np.gradient(motor, time)
        need = tau + joint.inertia * np.gradient(v, time) + joint.viscous * v + joint.coulomb * np.sign(v)
        rng = np.random.default_rng([seed, number])
        noisy = tau + joint.torque_noise * rng.standard_normal(tau.size)
        position = joint.encoder(plain.columns["joint/position"], rng)
        return changed(plain, current=joint.gain * need, torque=np.interp(time - late, time, noisy), position=position)

    return recorder({"joint": "joint", "drive": "current", "declared": {"rotor_inertia": joint.inertia}}, made)


def between(play: float, compliance: float) -> Record:
    """A motor encoder that leads the link's by half the play and by the wind-up; nothing else is missing."""
    joint = Joint(duration=20.0, period=4e-3, torque_noise=0.05)

    def made(number: int, seed: int) -> Run:
        plain = record(joint, f"run_{number}", SHIFTS[number], 1000 * seed + number)
        tau = plain.columns["joint/torque"]
        noise = np.random.default_rng([seed, number]).normal(0.0, 2e-5, tau.size)
        lead = 0.5 * play * np.sign(tau) + compliance * tau + 0.3 + noise
        return changed(plain, motor_position=plain.columns["joint/position"] + lead)

    return recorder({"joint": "joint", "drive": "current", "declared": {"rotor_inertia": joint.inertia}}, made)


def play(value: float) -> dict[str, dict[str, Is]]:
    return {"backlash": {"backlash": Is(value, 0.03)}}


STIFF = Gear(backlash=0.0, contact=4e6)
SPRUNG = Gear(backlash=1.2e-3, spring=3.0)
SOFT = 1.0 / ((2.0 * np.pi * 7.0) ** 2 * INERTIA)
"""Compliance of a gear on which the link swings at 7 Hz [rad/(N m)]."""
WINDS_UP = frozenset({"elasticity"})
CASES = [
    *(Case(f"gear: play of {1e3 * gear.backlash:g} mrad", geared(gear), play(gear.backlash))
      for gear in (Gear(backlash=2e-3), Gear(backlash=6e-4), Gear(backlash=1.2e-3, stiffness=2500.0, rotor=0.3))),
    Case("gear: play beside a spring of the link", geared(SPRUNG), play(SPRUNG.backlash) | {"cable_spring": {"spring_stiffness": Is(SPRUNG.spring, 0.05)}}),
    Case("gear: without play", geared(Gear(backlash=0.0))),
    Case("gear: soft teeth", geared(Gear(backlash=0.0, contact=8e3)), {"elasticity": {"compliance": Is(1.0 / 8e3, 0.1)}}, verdicts=ANY - NULL),
    Case("gear: a position in time beside a torque sensor", geared(STIFF, torque_sensor=True), values={"viscous.viscous": Is(30.0, 0.1)}),
    Case("gear: a position logged 12 ms late beside a torque sensor is no payload", geared(STIFF, 3, torque_sensor=True),
         allowed=(frozenset(), frozenset({"delay"})), values={"viscous.viscous": Is(30.0, 0.1)}),
    Case("gear: a link that swings at 7 Hz on a soft gear is no late sensor", geared(Gear(backlash=0.0, contact=1.0 / SOFT)),
         {"elasticity": {"compliance": Is(SOFT, 0.15)}}, verdicts=ANY - NULL),
    Case("gear: a link that swings at 7 Hz on a soft gear, its torque measured",
         geared(Gear(backlash=0.0, contact=1.0 / SOFT), torque_sensor=True), {"elasticity": {"compliance": Is(SOFT, 0.15)}},
         verdicts=ANY - NULL),
    Case("gear: a motor ahead of its encoder by the wind-up is no late sensor", soft(5e-3), {"elasticity": {"compliance": Is(5e-3, 0.15)}}, verdicts=ANY - NULL),
    Case("gear: play and wind-up between two encoders lack nothing", between(0.012, 2.5e-4), verdicts=NULL | RED),
]  # fmt: skip
