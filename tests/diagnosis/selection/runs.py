"""Simulated runs of one joint, and their columns, for the tests of what confirms an effect."""

from collections.abc import Sequence

import numpy as np

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.effects.library import effect

from ..rigs import Joint, Motion, record, rig_of

DECLARED = (Term(effect("viscous")), Term(effect("coulomb")))
LEAST_GAIN = 0.05
PLAIN = Joint(duration=12.0, period=4e-3, torque_noise=0.2)
BIAS, QUADRATIC = Term(effect("torque_sensor_bias")), Term(effect("quadratic_viscous"))


def offset(size: float):
    """Constant torque of this size: what a biased torque sensor looks like."""
    return lambda m: size * np.ones_like(m.q)


def drag(m: Motion) -> np.ndarray:
    return 1.5 * m.v * np.abs(m.v)


def columns_of(joints: Sequence[Joint], names: str, first: int = 0, width: float | None = None) -> Columns:
    made = [record(j, f"{names}{k}", 0.37 * (first + k), first + k) for k, j in enumerate(joints)]
    return Columns(build_samples(made, rig_of(joints[0]), "joint", width_s=width))
