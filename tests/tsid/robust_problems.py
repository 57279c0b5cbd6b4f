"""Random problems of the robot's kind: torques of 1 to 300 N m, a cost of weights 1 and 1e-3, some rows close by."""

import numpy as np

from drake_tc.tsid.robust.scaled import TorqueError
from drake_tc.tsid.rows import LeastSquares, Polytope


def random_polytope(rng, n, rows, *, one_sided=2, near=3.0):
    """(polytope, inside, sigma): n bounds, `rows` two-sided and `one_sided` rows around the point `inside`.

    Every side is 0.3 to `near` times as many sigmas away from it.
    """
    largest = 10.0 ** rng.uniform(0.0, 2.5, n)
    sigma = 0.003 * largest
    inside = rng.uniform(-0.5, 0.5, n) * largest
    matrix = np.vstack([np.eye(n), rng.normal(size=(rows + one_sided, n)) / largest])
    deviation = np.sqrt((matrix**2) @ sigma**2)
    value = matrix @ inside
    room = rng.uniform(0.3, near, (2, len(matrix))) * deviation
    lower, upper = value - room[0], value + room[1]
    lower[:n], upper[:n] = -largest, largest
    lower[n + rows :] = -np.inf
    groups = {"torque": slice(0, n), "other": slice(n, len(matrix))}
    return Polytope(matrix, lower, upper, groups, bounds=n), inside, sigma


def random_problem(seed, n=6, rows=8, *, near=3.0, rank=None, off=3.0, light=1e-3):
    """(cost, polytope, error): the cost wants a torque `off` sigmas from a point inside; rank < n leaves freedom."""
    rng = np.random.default_rng(seed)
    polytope, inside, sigma = random_polytope(rng, n, rows, near=near)
    matrix = rng.normal(size=(rank or n, n)) / sigma * 0.02
    matrix *= np.where(np.arange(len(matrix)) < 3, 1.0, light)[:, None]
    wanted = inside + off * sigma * rng.normal(size=n)
    return LeastSquares(matrix, matrix @ wanted), polytope, TorqueError(sigma**2)


def random_covariance(rng, sigma):
    """Full, with these standard deviations."""
    factor = rng.normal(size=(len(sigma), len(sigma) + 2))
    covariance = factor @ factor.T
    scale = sigma / np.sqrt(np.diagonal(covariance))
    return covariance * np.outer(scale, scale)
