"""What is told of shared causes: parameters with intervals, held-out gains, and joints before them."""

import numpy as np

from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.problem.shared.causes import AXES
from drake_tc.types import FloatArray


def body_parameters(inertial: FloatArray, spread: FloatArray, quantile: float) -> dict[str, Estimate]:
    """Mass m and centre c = h/m of what a link carries, with 95 % intervals to first order.

        var c_i = (var h_i - 2 c_i cov(h_i, m) + c_i^2 var m)/m^2

    Its inertia is estimated along with them, and not reported: rotors and friction of the last joints hide it.

    Args:
        inertial: (10,) `LINK_PARAMETERS`.
        spread: (10, 10) their covariance.
        quantile: Half width of an interval over the standard deviation.
    """
    mass, centre = float(inertial[0]), inertial[1:4] / inertial[0]
    gradient = np.zeros((4, inertial.size))
    gradient[0, 0] = 1.0
    gradient[1:, 0], gradient[1:, 1:4] = -centre / mass, np.eye(3) / mass
    width = quantile * np.sqrt(np.maximum(np.diag(gradient @ spread @ gradient.T), 0.0))
    names = (("mass", "kg"), *((f"com_{axis}", "m") for axis in AXES))
    return {
        name: Estimate(value, unit, (value - half, value + half), False)
        for (name, unit), value, half in zip(names, [mass, *centre.tolist()], width.tolist(), strict=True)
    }
