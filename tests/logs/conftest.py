"""A small bench whose balance is known in closed form, and where the public data sets lie."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import ArrayLike

from drake_tc.errors import LogError
from drake_tc.logs.files.readers import read_table
from drake_tc.logs.inspection import Inspection, inspect_log
from drake_tc.logs.prepare import load_run
from drake_tc.logs.record import Run
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


def inspected(folder: Path, columns: Mapping[str, ArrayLike]) -> Inspection:
    return inspect_log(write(pd.DataFrame(columns), folder / "run.csv"))


def load(table: pd.DataFrame, folder: Path, **rig: object) -> Run:
    return load_run(write(table, folder / "run.csv"), servo_rig(**rig))


def noted(run: Run, text: str) -> bool:
    return any(text in note for note in run.notes)


def _one_line_about(path: Path, act: Callable[[], object]) -> str:
    with pytest.raises(LogError) as caught:
        act()
    message = str(caught.value)
    assert message.startswith(str(path)) and "\n" not in message and len(message.replace(str(path), "")) < 500
    return message


def refusal(table: pd.DataFrame, path: Path, rig: Rig | None = None) -> str:
    """What the refusal of this log says: one line that begins with its file."""
    write(table, path)
    return _one_line_about(path, lambda: load_run(path, rig or servo_rig()))


def unreadable(path: Path) -> str:
    """What the refusal of this file says, before any column is looked at."""
    return _one_line_about(path, lambda: read_table(path))
