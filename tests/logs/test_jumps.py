"""An encoder that loses its zero within a run is told, and the run is split there; motion is never taken for a jump."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from drake_tc.logs.checks.jumps import jumps
from drake_tc.logs.prepare import load_run

from .conftest import bench, servo_rig, write


def motion(rate: float, step: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """(time, angle) of 20 s, with an encoder of this step [rad]."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 20.0, 1.0 / rate)
    angle = 0.8 * np.sin(2.0 * np.pi * 0.7 * time) + 0.1 * np.sin(2.0 * np.pi * 3.1 * time)
    return time, np.round((angle + 1e-4 * rng.standard_normal(time.size)) / step) * step


@pytest.mark.parametrize("rate", [100.0, 1000.0])
@pytest.mark.parametrize("step", [1e-6, 2.0 * np.pi / 4096])
def test_a_lost_zero_is_found_at_its_row(rate: float, step: float) -> None:
    time, angle = motion(rate, step)
    row = time.size // 3
    angle[row + 1 :] -= 0.4
    assert_array_equal(jumps(time, angle), [row])


@pytest.mark.parametrize("rate", [20.0, 100.0, 1000.0])
@pytest.mark.parametrize("step", [1e-6, 2.0 * np.pi / 4096])
def test_motion_has_no_jump(rate: float, step: float) -> None:
    time, angle = motion(rate, step)
    assert jumps(time, angle).size == 0


def test_a_fast_step_of_a_servo_is_no_jump() -> None:
    """A second-order step response of 20 Hz in an otherwise resting log."""
    time = np.arange(0.0, 20.0, 0.005)
    w, since = 2.0 * np.pi * 20.0, np.maximum(time - 8.0, 0.0)
    angle = 0.5 * (1.0 - np.exp(-w * since) * (1.0 + w * since))
    assert jumps(time, np.round(angle / 1e-3) * 1e-3).size == 0


def test_rows_that_are_missing_in_time_are_no_jump() -> None:
    time, angle = motion(500.0, 1e-6)
    kept = np.r_[0:3000, 3100 : time.size]
    assert jumps(time[kept], angle[kept]).size == 0


def test_a_run_is_split_where_its_encoder_lost_its_zero(tmp_path) -> None:
    whole = load_run(write(bench(), tmp_path / "whole.csv"), servo_rig())
    table = bench()
    table.loc[len(table) // 2 :, "joint/position"] += 0.5
    run = load_run(write(table, tmp_path / "run.csv"), servo_rig())
    assert len([hint for hint in run.hints if "joint/position jumps by 0.5" in hint]) == 1
    assert set(run.hints) <= set(run.notes)
    assert run.segment.max() == whole.segment.max() + 1
    assert whole.hints == ()
