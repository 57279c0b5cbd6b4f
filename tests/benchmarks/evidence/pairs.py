"""Pairs of effects that are hard to tell apart, and the simulated joint on which each is tried."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from drake_tc.experiments.causes import cause_of, cause_values
from drake_tc.joint_simulator.spec import Drive, RigSpec, Sensors
from drake_tc.logs.rig import Rig, parse_rig
from tests.benchmarks.blind.joints import draw_joint

JOINT = "joint"
DRIVE_GAIN = "servo_gain"
"""The effect that is an error of the rig file and not of the joint."""


@dataclass(frozen=True)
class Pair:
    """Two effects of about equal influence, and the joint that has one of them.

    Attributes:
        first, second: Id and size of each effect.
        drive: Of the joint.
        gravity: Factor on the m g l of the drawn joint.
        weight: Constant load, such as that of a weight on a pulley [N m].
        pendulum: (mass [kg], length [m]) of a known pendulum in place of the drawn link and of the torque sensor.
    """

    first: tuple[str, float]
    second: tuple[str, float]
    drive: Drive = "position_servo"
    gravity: float = 1.0
    weight: float = 0.0
    pendulum: tuple[float, float] | None = None

    def scaled(self, factor: float) -> "Pair":
        """The pair with both sizes multiplied by a factor."""
        first, second = ((name, factor * size) for name, size in (self.first, self.second))
        return replace(self, first=first, second=second)


PAIRS: tuple[Pair, ...] = (
    Pair(("delay", 4e-3), ("current_lag", 4e-3), "voltage"),
    Pair(("torque_sensor_bias", 0.8), ("asymmetric_friction", 0.8)),
    Pair(("elasticity", 6e-5), ("torque_sensor_gain", 0.2)),
    Pair(("load_dependent_friction", 0.12), ("stribeck", 1.5)),
    Pair(("quadratic_viscous", 2.5), ("thermal_friction", 0.02), "voltage"),
    Pair(("cable_spring", 3.0), ("payload", 1.5)),
    Pair(("load_dependent_friction", 0.12), ("stribeck", 1.5), gravity=0.0, weight=12.0),
    Pair(("backlash", 1.5e-3), ("delay", 4e-3)),
    Pair((DRIVE_GAIN, 0.15), ("payload", 3.0)),
)
"""Pairs that the first logs often do not separate. `bench experiments --pair N` counts them from 0."""
LOAD_PAIRS: tuple[Pair, ...] = (
    Pair(("torque_sensor_gain", 0.2), (DRIVE_GAIN, 0.2), gravity=0.0),
    Pair(("load_dependent_friction", 0.12), ("stribeck", 1.5), gravity=0.0),
    Pair(("cable_spring", 3.0), ("payload", 1.5)),
    Pair((DRIVE_GAIN, 0.15), ("payload", 3.0)),
    Pair(("payload", 3.0), ("elasticity", 6e-5), pendulum=(4.0, 0.5)),
)
"""Pairs that motions alone do not separate, or hardly, and that known loads may. The same with `--loads`."""


@dataclass(frozen=True, eq=False)
class PairJoint:
    """The joint of a pair with one of its effects.

    Attributes:
        spec: The joint without any cause.
        causes: Parameters of the cause that the joint has, by the name of the cause in the simulator.
        rig: Rig file of the joint.
    """

    spec: RigSpec
    causes: Mapping[str, Mapping[str, float]]
    rig: Rig


def drawn_joint(pair: Pair, truth: tuple[str, float], seed: int) -> PairJoint:
    """The simulated joint of a pair with one of its effects, and its rig file.

    A wrong drive gain is an error of the rig file, which then declares (1 + e) K with the size e. If a wrong drive gain
    is the other effect of the pair, the rig file declares the true gain K.

    Args:
        pair: The pair.
        truth: Id and size of the effect that the joint has.
        seed: Of the joint.
    """
    name, size = truth
    rng = np.random.default_rng([seed, *name.encode()])
    joint = draw_joint(rng, pair.drive, soft=True, pendulum=pair.pendulum)
    joint = replace(joint, gravity=pair.gravity * joint.gravity)
    spec = RigSpec("loop", "single", "loop", "", joint, 0, sensors=Sensors(torque_noise=0.25), pendulum=pair.pendulum)
    declared: dict[str, Any] = {"joint": JOINT, "drive": pair.drive, "declared": {"rotor_inertia": joint.rotor_inertia}}
    if DRIVE_GAIN in (pair.first[0], pair.second[0]):
        declared["drive_gain"] = joint.gain * (1.0 + size if name == DRIVE_GAIN else 1.0)
    if pair.pendulum is not None:
        declared["load"] = {"pendulum": {"mass": pair.pendulum[0], "length": pair.pendulum[1]}}
    values = {} if name == DRIVE_GAIN else cause_values(name, size, joint, pair.pendulum, rng)
    causes = {} if name == DRIVE_GAIN else {cause_of(name): values}
    return PairJoint(spec, causes, parse_rig(declared))
