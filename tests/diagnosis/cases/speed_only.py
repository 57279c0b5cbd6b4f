# ruff: noqa: E501  (one row of the table a line)
"""Logs of a velocity without a position, as from a motor test stand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from ..log_files import Change
from ..rigs import Joint
from .case import Case, Is, Record, Recorded
from .recorders import logs_of

JOINT = Joint(torque_noise=0.05)
DRAGGED = replace(JOINT, extra=lambda m: 1.2 * m.v * np.abs(m.v))


def speed(noise: float = 0.0, step: float = 0.01, scale: float = 1.0) -> Change:
    """The position's column replaced by a velocity with noise and steps [rad/s], in a unit of `scale`."""
    rng = np.random.default_rng(5)

    def change(table: pd.DataFrame) -> pd.DataFrame:
        velocity = np.gradient(table["joint/position"], table["time"])
        velocity = np.round((velocity + noise * rng.standard_normal(velocity.size)) / step) * step
        return table.drop(columns="joint/position").assign(**{"joint/velocity": scale * velocity})

    return change


def mixed(folder: Path, seed: int) -> Recorded:
    """One run with a position among those without."""
    (folder / "both").mkdir()
    both: Record = logs_of(JOINT)
    alone, other = logs_of(replace(JOINT, gain=0.081), speed())(folder, seed), both(folder / "both", seed)
    return Recorded(alone.rig, [alone.train[0], other.train[1]], alone.held)


DECLARED = {"drive.gain": Is(0.08, 0.01), "viscous.viscous": Is(6.0, 0.02), "coulomb.coulomb": Is(3.0, 0.03)}
CASES = [
    Case("speed only: quadratic friction", logs_of(DRAGGED, speed()), {"quadratic_viscous": {"quadratic_viscous": Is(1.2, 0.02)}}),
    Case("speed only: nothing is missing", logs_of(JOINT, speed(2e-3, 1e-4)), values=DECLARED),
    Case("speed only: nothing is missing, a coarse velocity", logs_of(JOINT, speed(0.0, 0.05)), values=DECLARED),
    Case("speed only: nothing is missing, a noisy velocity", logs_of(JOINT, speed(0.02, 1e-5)), values=DECLARED),
    Case("speed only: a declared effect of the position is refused",
         logs_of(JOINT, speed(), {"declared": {"rotor_inertia": 0.3, "cable_spring": {"spring_stiffness": 2.0}}}),
         refusal="cable_spring depends on the position, and the logs have the veloc"),
    Case("speed only: a pendulum asks for the position",
         logs_of(JOINT, speed(), {"load": {"pendulum": {"mass": 1.0, "length": 0.2}}}), refusal="no column 'joint/position'"),
    Case("speed only: a forgotten unit is refused", logs_of(JOINT, speed(scale=600.0 / (2.0 * np.pi))),
         refusal=r"reaches .* it looks like rpm or deg/s; set units: \{velocity: rpm\}"),
    Case("speed only: runs with and without positions do not mix", mixed, refusal=r"run_0\.npz: no column 'joint/position', which .*run_1\.npz has"),
]  # fmt: skip
