"""Where friction acts in a robot whose motors do not turn with one joint each."""

from dataclasses import dataclass

import numpy as np

from drake_tc.errors import IdentificationError
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class Axis:
    """A shaft on which effects act: a motor, or the output of a gear.

    Attributes:
        name: For reports.
        turns: (n,) row r: the shaft turns by r q and its torque phi loads the joints by r^T phi.
        carries: (n,) row s: of the joints' torques tau the shaft carries s tau [N m].
    """

    name: str
    turns: tuple[float, ...]
    carries: tuple[float, ...]


def joint_axes(joints: tuple[str, ...]) -> tuple[Axis, ...]:
    """One shaft a joint, each turning with its joint."""
    rows = np.eye(len(joints)).tolist()
    return tuple(Axis(name, tuple(row), tuple(row)) for name, row in zip(joints, rows, strict=True))


def motor_axes(names: tuple[str, ...], turns: FloatArray) -> tuple[Axis, ...]:
    """Shafts of a coupled transmission q_m = R q, and so tau = R^T tau_m, by power balance.

    Args:
        names: Of the n motors.
        turns: R (n, n), gear ratios taken out: motor angles in joint units.

    Raises:
        IdentificationError: R is not square or has no inverse.
    """
    matrix = np.asarray(turns, dtype=float)
    size = len(names)
    if matrix.shape != (size, size) or np.linalg.cond(matrix) > 1e8:
        raise IdentificationError(
            f"coupled transmission: wanted an invertible ({size}, {size}) matrix of motor turns a joint turn; "
            f"got {matrix.tolist()}"
        )
    carries = np.linalg.inv(matrix).T
    return tuple(
        Axis(name, tuple(r), tuple(s)) for name, r, s in zip(names, matrix.tolist(), carries.tolist(), strict=True)
    )
