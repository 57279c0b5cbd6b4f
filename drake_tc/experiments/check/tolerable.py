"""What errors of a joint's sensors within their tolerances cannot imitate of an effect.

The errors b of the sensors are part of the declared model, but each only up to its limit L. With the errors' columns N
and the contribution c of an effect at size 1 [N m], both without what the free parameters of the model imitate,

    r(s) = s c - N b(s),   b(s) = argmin |s c - N b|  with  |b| <= L                    (remainder at a size s)

It grows in proportion to s until the first error reaches its limit, at the size s_0, and faster from there on.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from drake_tc.types import FloatArray

IMITATED = 0.9
"""Share of a contribution (RMS): errors that leave more of it hardly imitate it, and their limits do not matter."""
SIZES = np.concatenate([[1.0], 1.0 + np.geomspace(0.02, 300.0, 24)])
"""Sizes that are looked at, in units of s_0: dense where the errors reach their limits."""


@dataclass(frozen=True, eq=False)
class TolerableErrors:
    """Errors of a joint's sensors that the rig file allows.

    Attributes:
        columns: (N, k) torque [N m] of one unit of each error, without what the free parameters imitate.
        limits: (k,) largest size of each error.
    """

    columns: FloatArray
    limits: FloatArray

    def free_up_to(self, contribution: FloatArray) -> float:
        """The size s_0 from which on the errors cannot imitate a contribution (N,) as if they had no limits.

        0 where they hardly imitate it at any size, so that their limits do not matter.
        """
        factors, *_ = np.linalg.lstsq(self.columns, contribution, rcond=1e-9)
        left = np.linalg.norm(contribution - self.columns @ factors)
        if left >= IMITATED * np.linalg.norm(contribution):  # or nothing to imitate
            return 0.0
        return float(np.min(self.limits / np.maximum(np.abs(factors), 1e-300)))

    def remainders(self, contribution: FloatArray, sizes: FloatArray) -> FloatArray:
        """(g, N) r(s) of a contribution (N,) at sizes (g,) [N m]."""
        basis, upper = np.linalg.qr(np.column_stack([self.columns, contribution]))
        errors, effect = upper[:, :-1], upper[:, -1]
        found = [lsq_linear(errors, s * effect, (-self.limits, self.limits), method="bvls").x for s in sizes]
        kept = np.outer(sizes, effect) - np.array(found) @ errors.T
        return np.asarray(kept @ basis.T)
