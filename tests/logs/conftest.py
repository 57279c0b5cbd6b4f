"""A small bench whose balance is known in closed form, and where the public data sets lie."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from drake_tc.logs.rig import Rig, parse_rig

GAIN = 2e-3  # rad/(N m)
PERIOD = 1e-3


def bench(seconds: float = 6.0, period: float = PERIOD, joint: str = "joint", seed: int = 0) -> pd.DataFrame:
    """A joint under a position servo: q, load torque and q_d = q + K (tau + 0.3 qddot + 2 qdot + 1.5 tanh(50 qdot))."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds / period)) * period
    q = 0.6 * np.sin(2.0 * t) + 0.1 * np.sin(5.0 * t)
    qd = 1.2 * np.cos(2.0 * t) + 0.5 * np.cos(5.0 * t)
    qdd = -2.4 * np.sin(2.0 * t) - 2.5 * np.sin(5.0 * t)
    tau = 8.0 * np.sin(3.1 * t + 1.0)
    motor = tau + 0.3 * qdd + 2.0 * qd + 1.5 * np.tanh(50.0 * qd)
    return pd.DataFrame(
        {
            "time": t,
            f"{joint}/position": q,
            f"{joint}/position_command": q + GAIN * motor,
            f"{joint}/velocity": qd,
            f"{joint}/voltage": 0.5 * motor,
            f"{joint}/torque": tau + 0.05 * rng.standard_normal(t.size),
            f"{joint}/temperature": 25.0 + 0.1 * t,
        }
    )


def servo_rig(**more: object) -> Rig:
    return parse_rig({"joint": "joint", "drive": "position_servo", **more}, "rig.yaml")


@pytest.fixture
def table() -> pd.DataFrame:
    return bench()


def write(table: pd.DataFrame, path: Path) -> Path:
    table.to_csv(path, index=False)
    return path
