"""The torque effects of a model, split by how a step and the compensation come to their parts."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.effects.kernel import EquationKernel, TorqueKernel, TorqueParts
from drake_tc.kernels.torque_equations import CONSTANT
from drake_tc.types import FloatArray, IntArray


class ResistanceLaw(NamedTuple):
    """What one torque effect resists with, where that changes.

    Attributes:
        kernel: Of the effect.
        travel: Over which its own hysteretic state turns over [rad]; 0 where it has none.
    """

    kernel: TorqueKernel
    travel: float


def split_parts(model: ActuatorModel) -> tuple[TorqueParts, tuple[ResistanceLaw, ...]]:
    """The sum of a model's constant parts, and the effects that have to be evaluated at every instant."""
    level = damping = rest = 0.0
    changing = []
    for effect, parameters in model.torque_effects:
        kernel = effect.kernel(parameters)
        if isinstance(kernel, EquationKernel) and kernel.kind == CONSTANT:
            a, b, c = kernel.numbers
            level, damping, rest = level + a, damping + b, rest + c
        else:
            changing.append(ResistanceLaw(kernel, effect.hysteresis_travel(parameters)))
    return (level, damping, rest), tuple(changing)


def term_tables(terms: Sequence[tuple[EquationKernel, int]]) -> tuple[IntArray, FloatArray]:
    """(E, 4) rows of torque effects (`drake_tc.kernels.joint_layout`) and their numbers, one behind the other.

    Args:
        terms: Each with the place of its hysteretic state, or -1.
    """
    ends = np.cumsum([len(kernel.numbers) for kernel, _ in terms], dtype=np.int64).tolist()
    rows = [
        (kernel.kind, first, end, state) for (kernel, state), first, end in zip(terms, [0, *ends], ends, strict=False)
    ]
    values = [number for kernel, _ in terms for number in kernel.numbers]
    return np.array(rows, dtype=np.int64).reshape(-1, 4), np.array(values, dtype=np.float64)
