"""Functions at the top of a module, as sweeps need them."""

import os
import signal
from pathlib import Path

import numpy as np


def drawn(point, seed):
    """Depends on everything that could differ: the point, its seed, linear algebra big enough for several threads."""
    matrix = np.random.default_rng(seed).normal(size=(120, 120))
    return float(point), np.linalg.eigvals(matrix @ matrix.T + point).real.sum(), np.linalg.inv(matrix).tobytes()


def square(point, seed):
    return point * point


def odd_ones_fail(point, seed):
    if point % 2:
        raise ValueError(f"no odd\nnumbers: {point}")
    return point


def killed_once(point, seed):
    """The first time that a point with a marker is run, its process is killed."""
    number, folder = point
    marker = Path(folder) / f"been_{number}"
    if number in (3, 17) and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number, seed


def always_killed(point, seed):
    if point == 5:
        os.kill(os.getpid(), signal.SIGKILL)
    return point


def unsendable(point, seed):
    return lambda: point


def busy(point, seed):
    """A fixed amount of work."""
    total = 0.0
    for i in range(point):
        total += i * 0.5
    return total
