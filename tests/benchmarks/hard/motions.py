"""Reference motions, temperatures and pushes of a run, at every step of the simulation."""

from collections.abc import Callable

import numpy as np

from tests.benchmarks.hard.physics import STEP, Array

Generator = np.random.Generator


def motion(kind: str, duration: float, size: float, fastest_hz: float, rng: Generator) -> tuple[Array, Array]:
    """Position [rad] and rate [rad/s] of a motion around zero; `size` is its largest deflection [rad].

    It is smoothed until it is nowhere faster, and accelerates nowhere more, than a sine of this size and `fastest_hz`.
    """
    time = np.arange(0.0, duration, STEP)
    raw = KINDS[kind](time, fastest_hz, rng)
    raw = raw * np.minimum(time / 0.5, 1.0) ** 2 * (3.0 - 2.0 * np.minimum(time / 0.5, 1.0))
    omega = 2.0 * np.pi * fastest_hz
    width = 0.5 / omega
    while True:
        q = _smooth(raw, width)
        q *= size / np.abs(q).max()
        rate = np.gradient(q, STEP)
        if max(np.abs(rate).max() / omega, np.abs(np.gradient(rate, STEP)).max() / omega**2) < 1.05 * size:
            return q, rate
        width *= 1.3


def _smooth(q: Array, seconds: float) -> Array:
    """A moving average applied twice: corners become parabolas."""
    width = max(1, round(seconds / STEP))
    for _ in range(2):
        padded = np.concatenate([np.full(width, q[0]), q])
        total = np.cumsum(padded)
        q = (total[width:] - total[:-width]) / width
    return q


def _multisine(time: Array, fastest: float, rng: Generator) -> Array:
    count = int(rng.integers(4, 9))
    hz = fastest * rng.uniform(0.08, 1.0, count)
    sizes = rng.uniform(0.4, 1.0, count) * (fastest / hz) ** 0.7
    return np.sin(2.0 * np.pi * np.outer(time, hz) + rng.uniform(0.0, 2.0 * np.pi, count)) @ sizes


def _chirp(time: Array, fastest: float, rng: Generator) -> Array:
    low = 0.08 * fastest
    growth = np.log(fastest / low) / time[-1]
    phase = 2.0 * np.pi * low * np.expm1(growth * time) / growth
    return np.sin(phase) * (1.0 - 0.7 * time / time[-1])


def _triangles(time: Array, fastest: float, rng: Generator) -> Array:
    hz = fastest * rng.uniform(0.15, 0.4)
    sizes = np.repeat(rng.uniform(0.3, 1.0, int(time[-1] * hz) + 2), 2)
    corners = np.concatenate([[0.0], sizes * np.where(np.arange(sizes.size) % 2, -1.0, 1.0)])
    return np.interp(time, np.arange(corners.size) * 0.5 / hz, corners)


def _trapezoids(time: Array, fastest: float, rng: Generator) -> Array:
    knots, levels, now = [0.0], [0.0], 0.0
    while now < time[-1]:
        now += rng.uniform(0.25, 0.8) / fastest
        level = rng.uniform(-1.0, 1.0)
        knots.append(now)
        levels.append(level)
        now += rng.uniform(0.05, 0.6) / fastest
        knots.append(now)
        levels.append(level)
    return np.interp(time, knots, levels)


def _growing_sine(time: Array, fastest: float, rng: Generator) -> Array:
    return np.sin(2.0 * np.pi * fastest * rng.uniform(0.25, 0.6) * time) * (0.15 + time / time[-1])


def _holds(time: Array, fastest: float, rng: Generator) -> Array:
    count = int(time[-1] * fastest * 0.4) + 2
    knots = np.sort(rng.uniform(0.0, time[-1], count))
    levels = rng.uniform(-1.0, 1.0, count)
    return levels[np.minimum(np.searchsorted(knots, time), count - 1)] + 0.05 * np.sin(2.0 * np.pi * fastest * time)


KINDS: dict[str, Callable[[Array, float, Generator], Array]] = {
    "multisine": _multisine,
    "chirp": _chirp,
    "triangles": _triangles,
    "trapezoids": _trapezoids,
    "growing_sine": _growing_sine,
    "holds": _holds,
}


def held(q: Array, hertz: float) -> Array:
    """The command as a master sends it: `hertz` times a second, unchanged in between."""
    every = max(1, round(1.0 / (hertz * STEP)))
    return q[(np.arange(q.size) // every) * every]


def pushes(samples: int, size: float, rng: Generator) -> Array:
    """External torque [N m] on the link: slow waves and a few pushes."""
    time = np.arange(samples) * STEP
    torque = size * 0.4 * np.sin(2.0 * np.pi * rng.uniform(0.05, 0.3) * time + rng.uniform(0.0, 6.0))
    for _ in range(int(rng.integers(2, 6))):
        middle, width = rng.uniform(0.0, time[-1]), rng.uniform(0.2, 1.0)
        torque += size * rng.uniform(-1.0, 1.0) * np.exp(-(((time - middle) / width) ** 2))
    return torque


def warming(samples: int, rng: Generator) -> Array:
    """Temperature [°C] of a joint that warms up or cools down during a run."""
    time = np.arange(samples) * STEP
    start, end = rng.uniform(20.0, 55.0, 2)
    return end + (start - end) * np.exp(-time / rng.uniform(10.0, 60.0))
