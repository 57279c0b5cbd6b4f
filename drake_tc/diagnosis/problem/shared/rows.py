"""The rows of all joints' torque balances: each joint's own columns, those of the shared causes, and the target.

    z_j = X_j beta_j + C_j delta + e_j

Blocks are half seconds, numbered alike for all joints; folds of the cross-validation are pairs of them.
"""

from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.shared.causes import CauseColumns
from drake_tc.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class JointRows:
    """One joint's rows.

    Attributes:
        joint: Name.
        samples: Where the rows come from.
        own: (N, k) X, the effort first unless the drive's gain is held. shared: (N, P) C of all causes.
        target: (N,) z, less y*/K where the gain is held.
        block: (N,) half seconds, numbered alike for all joints.
        grams: (FOLDS, m, m) of [X, C, z] by fold, m = k + P + 1.
        scaling: (P,) columns that hold the noise of z; None: all.
        held: 1/K where the drive's gain is declared [N m/effort]; None: fitted, the first coefficient.
        opposite: (P,) `scaling` under the opposite assumption, where it is not certain; None: none.
        precision: (k,) of the prior of the own coefficients, around 0 and in units in which a row's squared residual
            counts 1: of errors of the joint's sensors within tolerance (`data.sensor_prior`); None: there is none.
    """

    joint: str
    samples: Samples
    own: FloatArray
    shared: FloatArray
    target: FloatArray
    block: IntArray
    grams: FloatArray
    scaling: BoolArray | None = None
    held: float | None = None
    opposite: BoolArray | None = None
    precision: FloatArray | None = None

    def stiffness(self, beta: FloatArray) -> float:
        """1/K, with its own coefficients beta (k,)."""
        return float(beta[0]) if self.held is None else self.held

    def stiffness_response(self, response: FloatArray) -> FloatArray:
        """(...,) by how much 1/K moves, of how much the own coefficients (k, ...) do."""
        return np.asarray(response[0] if self.held is None else np.zeros(response.shape[1:]))

    def scales(self, columns: IntArray) -> FloatArray:
        """(p,) 1.0 where these columns hold the noise of z, else 0.0."""
        return np.ones(columns.size) if self.scaling is None else self.scaling[columns].astype(np.float64)

    @property
    def width(self) -> int:
        """Number of own columns k."""
        return int(self.own.shape[1])


def over_samples(samples: Samples, joint: str, causes: CauseColumns) -> FloatArray:
    """(T, P) of one joint on the samples' own clock."""
    time, run = samples.signals.time, samples.run_of_sample
    out = np.zeros((time.size, causes.causes[-1].columns.stop))
    for number, name in enumerate(samples.runs):
        inside = run == number
        out[inside] = causes.of(name, joint, time[inside])
    return out
