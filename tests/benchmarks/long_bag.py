"""`bench long-bag`: a bag of ten minutes at 1 kHz with stamps that scatter, from the file to the verdict."""

from pathlib import Path

import numpy as np

from tests.benchmarks.close_loop_speed import SpeedCase

NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
SCATTER = 3e-4
"""Of the stamps about a steady clock, to both sides [s]."""
RATE = 1000.0
RIG = """joint: wrist_3
drive: current
columns: {current: wrist_3/effort}
drive_gain: 0.12
declared: {rotor_inertia: 0.3}
load: {pendulum: {mass: 1.6, length: 0.2}}
"""
MASS, LENGTH, GRAVITY = 1.6, 0.2, 9.81


def write_bag(folder: Path, seconds: float, held: float) -> SpeedCase:
    """Two bags of the joint states of an arm; its last joint swings a known pendulum and has quadratic friction too.

    Position, velocity and current of six joints are recorded at 1 kHz. The stamps scatter evenly within `SCATTER`, and
    the values are those at the stamps.

    Args:
        folder: Where to write.
        seconds: Length of the bag to fit [s].
        held: Length of the one that is held out [s].
    """
    from tests.logs.bags.recorded import bag, joint_states

    rng = np.random.default_rng(0)
    files = []
    for name, length, shift in (("run", seconds, 0.0), ("held", held, 40.0)):
        steady = np.arange(round(length * RATE)) / RATE
        time = np.sort(steady + rng.uniform(-SCATTER, SCATTER, steady.size))
        states = {joint: _motion(time + shift, number, rng) for number, joint in enumerate(NAMES)}
        files.append(bag(folder / name, joint_states("/joint_states", time, states)))
    rig = folder / "rig.yaml"
    rig.write_text(RIG, encoding="utf-8")
    what = f"bag of {seconds / 60.0:.2g} min at 1 kHz, stamps within {1e3 * SCATTER:g} ms"
    return SpeedCase(what, rig, (files[0],), (files[1],))


def _motion(time: np.ndarray, number: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Position [rad], velocity [rad/s] and current [A] of a joint."""
    q, v, a = np.zeros_like(time), np.zeros_like(time), np.zeros_like(time)
    for hertz, size in ((0.13, 0.5), (0.41, 0.35), (0.83, 0.15)):
        w = 2.0 * np.pi * hertz
        phase = w * time + number + hertz
        q, v, a = q + size * np.sin(phase), v + size * w * np.cos(phase), a - size * w**2 * np.sin(phase)
    torque = MASS * LENGTH * (GRAVITY * np.sin(q) + LENGTH * a)
    torque += 0.3 * a + 1.2 * v + 1.0 * np.sign(v) + 0.4 * v * np.abs(v)
    step = 2.0 * np.pi / 2**17
    noise = rng.standard_normal((2, q.size))
    return [step * np.round(q / step), v + 0.02 * noise[0], 0.12 * torque + 0.01 * noise[1]]
