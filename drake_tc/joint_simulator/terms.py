"""What a cause is in the simulator: a small object that changes one quantity of the joint at every step.

The quantities, in the order in which a step passes through them:

    command   q_d that the servo receives [rad]
    effort    y* that the drive acts on [effort]
    motor     torque of the motor [N m]
    level     sliding friction level g [N m]; friction is g s, with s in [-1, 1] the bristle state
    torque    further torque between motor and torque sensor, against the motor [N m]
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from drake_tc.joint_simulator.spec import BlindError, RigSpec
from drake_tc.types import FloatArray, IntArray

Stage = Literal["command", "effort", "motor", "level", "torque"]
STAGES: tuple[Stage, ...] = ("command", "effort", "motor", "level", "torque")


@dataclass
class State:
    """The changing quantities of a batch, every array (n,), one entry a column (a run of a rig).

    Attributes:
        time: Since the start of the run [s].
        q, v, a: Motor side over the gear ratio [rad, rad/s, rad/s^2].
        bristle: s of the friction, in [-1, 1].
        transmitted: Torque into the link at the last step [N m].
        temperature: [deg C].
    """

    time: float
    q: FloatArray
    v: FloatArray
    a: FloatArray
    bristle: FloatArray
    transmitted: FloatArray
    temperature: FloatArray


class Term(ABC):
    """One cause in all columns that have it.

    Attributes:
        index: (m,) the columns.
        p: Parameter name to (m,) values.
        dt: Step [s].
    """

    stage: ClassVar[Stage]

    def __init__(self, index: IntArray, p: Mapping[str, FloatArray], dt: float) -> None:
        self.index = index
        self.p = dict(p)
        self.dt = dt

    @abstractmethod
    def apply(self, state: State, x: FloatArray) -> FloatArray:
        """The quantity of `stage` after this cause, (m,), from its value before it."""


def joint_parameters(spec: RigSpec) -> dict[str, float]:
    """The joint's own numbers, which a term may scale with: `joint.coulomb`, `joint.viscous` ..."""
    joint = spec.joint
    names = ("gain", "coulomb", "viscous", "breakaway", "ambient", "rotor_inertia")
    return {f"joint.{name}": float(getattr(joint, name)) for name in names}


def build_terms(
    registry: Mapping[str, tuple[type[Term], ...]], specs: list[RigSpec], runs: list[str], dt: float
) -> dict[Stage, list[Term]]:
    """All terms of a batch by stage.

    Args:
        registry: Cause id to the terms that make it up.
        specs: The rig of each column.
        runs: The run of each column.
        dt: Step [s].

    Raises:
        BlindError: A cause that the registry does not know.
    """
    columns: dict[str, list[int]] = {}
    for i, spec in enumerate(specs):
        for cause in spec.causes:
            if cause not in registry:
                raise BlindError(f"no cause {cause!r}; causes are {', '.join(sorted(registry))}")
            columns.setdefault(cause, []).append(i)
    terms: dict[Stage, list[Term]] = {stage: [] for stage in STAGES}
    for cause, where in columns.items():
        values = [_column_parameters(specs[i], cause, runs[i]) for i in where]
        stacked = {name: np.array([value[name] for value in values]) for name in values[0]}
        for kind in registry[cause]:
            terms[kind.stage].append(kind(np.array(where), stacked, dt))
    return terms


def _column_parameters(spec: RigSpec, cause: str, run: str) -> dict[str, float]:
    """A cause's numbers in one run; a parameter `only_run` (0 static, 1 sine, 2 multisine) confines it."""
    run_index = float(("static", "sine", "multisine").index(run))
    return dict(spec.causes[cause]) | joint_parameters(spec) | {"run": run_index}
