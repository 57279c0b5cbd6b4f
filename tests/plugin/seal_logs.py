"""Simulated logs of a pendulum on a current drive whose seal is eccentric, from the balance written backwards."""

from pathlib import Path

import numpy as np
import pandas as pd

RIG = """\
joint: axis
drive: current
load: {pendulum: {mass: 2.0, length: 0.3}}
declared: {rotor_inertia: 0.05}
"""
GAIN = 0.4
"""[A/(N m)]"""
COSINE, SINE = 0.25, -0.4
"""Of the seal [N m s/rad]."""


def pendulum_log(seed: int) -> pd.DataFrame:
    """i = K (m l^2 qdd + m g l sin q + J qdd + F_v qd + F_c sign qd + (c cos q + s sin q) qd), with noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 16.0, 0.01)
    q, v, a = (np.zeros(time.size) for _ in range(3))
    for frequency, size in ((0.13, 1.4), (0.41, 0.6), (0.97, 0.2)):
        w, phase = 2.0 * np.pi * frequency, rng.uniform(0.0, 2.0 * np.pi)
        q += size * np.sin(w * time + phase)
        v += size * w * np.cos(w * time + phase)
        a -= size * w**2 * np.sin(w * time + phase)
    torque = (2.0 * 0.3**2 + 0.05) * a + 2.0 * 9.81 * 0.3 * np.sin(q) + 0.8 * v + 0.6 * np.sign(v)
    torque += (COSINE * np.cos(q) + SINE * np.sin(q)) * v
    position = q + 1e-5 * rng.standard_normal(time.size)
    current = GAIN * torque + 2e-3 * rng.standard_normal(time.size)
    return pd.DataFrame({"time": time, "axis/position": position, "axis/current": current})


def write_bench(folder: Path) -> tuple[Path, list[Path], Path]:
    """Rig file, two runs to fit, one held out."""
    folder.mkdir(parents=True, exist_ok=True)
    rig = folder / "rig.yaml"
    rig.write_text(RIG, encoding="utf-8")
    runs = [folder / f"run{number}.csv" for number in range(3)]
    for number, run in enumerate(runs):
        pendulum_log(number).to_csv(run, index=False)
    return rig, runs[:2], runs[2]
