"""A designed motion as a Drake trajectory: a `PiecewisePolynomial` in the YAML that Drake reads and writes.

    from pydrake.common.yaml import yaml_load_typed
    from pydrake.trajectories import PiecewisePolynomial
    trajectory = yaml_load_typed(schema=PiecewisePolynomial, filename="trajectory.drake.yaml")

Rows are the joints in the order of the other files.
"""

import json
from collections.abc import Mapping

import numpy as np
from scipy.interpolate import BPoly, PPoly

from drake_tc.types import FloatArray

KNOT = 0.02
"""Time between knots, about [s]: position, velocity and acceleration are exact there."""


def drake_trajectory(time: FloatArray, motions: Mapping[str, FloatArray]) -> str:
    """YAML of a `PiecewisePolynomial` of degree 5 through position, velocity and acceleration at knots.

    Between knots the position errs by h^6/46080 of its sixth derivative at most (Hermite): 3e-7 of the amplitude at
    4 Hz.

    Args:
        time: (T,) [s], evenly spaced.
        motions: By joint, (4, T) position, velocity, acceleration and jerk.
    """
    every = max(1, round(KNOT / float(time[1] - time[0])))
    picked = np.unique(np.append(np.arange(0, time.size, every), time.size - 1))
    knots = time[picked]
    rows = []
    for motion in motions.values():
        spline = PPoly.from_bernstein_basis(BPoly.from_derivatives(knots, motion[:3, picked].T))
        rows.append(spline.c[::-1].T.tolist())  # by segment, lowest power first
    polynomials = [[[row[k]] for row in rows] for k in range(knots.size - 1)]
    lines = ",\n".join(json.dumps(each) for each in polynomials)
    return f'{{"breaks": {json.dumps(knots.tolist())},\n"polynomials": [\n{lines}\n]}}\n'
