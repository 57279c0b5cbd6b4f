"""A drive that reports the amplitude of its effort: the log is refused, and one-sided efforts are not."""

import numpy as np
import pytest

from drake_tc.errors import LogError
from drake_tc.logs.checks.mistaken_columns import is_unsigned
from drake_tc.logs.prepare import load_runs

from .conftest import bench, servo_rig, write


def test_an_absolute_value_is_refused(tmp_path):
    table = bench(5.0, 2e-3)
    table["joint/voltage"] = table["joint/voltage"].abs()
    with pytest.raises(LogError, match=r"run\.csv: column 'joint/voltage' of joint seems to be an absolute value"):
        load_runs([write(table, tmp_path / "run.csv")], servo_rig(drive="voltage"))


def balance(offset: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Effort, load and motion of a joint with friction and noise; `offset` is a constant part of the load [N m]."""
    t = np.arange(0.0, 10.0, 4e-3)
    q, velocity, acceleration = np.sin(2.0 * t), 2.0 * np.cos(2.0 * t), -4.0 * np.sin(2.0 * t)
    load = offset + 2.0 * np.sin(q + 0.3)
    others = np.column_stack([acceleration, velocity, np.sign(velocity), np.ones(t.size)])
    noise = np.random.default_rng(0).normal(0.0, 0.1, t.size)
    return 0.5 * (load + others @ np.array([0.1, 0.1, 0.5, 0.0]) + noise), load, others


def test_an_effort_of_one_sign_is_no_absolute_value():
    effort, load, others = balance(4.0)
    assert effort.min() > 0.0
    assert not is_unsigned(effort, load, others)


def test_a_brake_that_never_pulls_is_no_absolute_value():
    """The effort is cut off at 0 in half of the motion."""
    effort, load, others = balance(0.0)
    assert not is_unsigned(np.maximum(effort, 0.0), load, others)
    assert is_unsigned(np.abs(effort), load, others)
