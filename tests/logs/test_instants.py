"""Stamps that scatter about a steady clock are noise, those of an unsteady clock are true; the positions tell which."""

import time as clock
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drake_tc.logs.checks.clock import sampling_instants, uniform_clock
from drake_tc.logs.prepare import load_run
from drake_tc.logs.rig import parse_rig

STEP = 5e-5


def motion(at: np.ndarray) -> np.ndarray:
    """An encoder's reading [rad] of two sines at the instants `at`."""
    return np.round((0.5 * np.sin(5.0 * at) + 0.2 * np.sin(14.0 * at)) / STEP) * STEP


@settings(deadline=None, max_examples=25)
@given(
    period=st.sampled_from([1e-3, 2e-3, 5e-3]),
    scatter=st.floats(0.1, 0.35),
    seed=st.integers(0, 2**16),
    lost=st.integers(0, 5),
)
def test_scatter_of_the_stamps_is_taken_away_and_that_of_the_clock_stays(period, scatter, seed, lost):
    rng = np.random.default_rng(seed)
    number = np.delete(np.arange(4000 + lost), 200 + 600 * np.arange(lost))
    steady = 1.00003 * period * number
    noise = scatter * period * rng.normal(size=number.size)
    stamps = np.maximum.accumulate(steady + noise)
    found = sampling_instants(stamps, [motion(steady)])
    assert len(found.notes) == 1 and "scatter" in found.notes[0]
    # a line through 201 stamps has 1/14 of their scatter; the ends of the log and rows beside a lost one have more
    error = np.abs(found.time - steady)
    assert np.sqrt(np.mean((found.time - steady) ** 2)) < 0.5 * np.sqrt(np.mean((stamps - steady) ** 2))
    assert np.median(error) < 0.12 * scatter * period
    unsteady = np.sort(steady + noise)
    kept = sampling_instants(unsteady, [motion(unsteady)])
    assert kept.notes == () and np.array_equal(kept.time, unsteady)


def read(path, stamps, position, current):
    """The run of a file with these columns."""
    table = pd.DataFrame({"time": stamps, "knee/position": position, "knee/current": current})
    table.to_parquet(path)
    return load_run(path, parse_rig({"joint": "knee", "drive": "current", "load": "unknown"}))


def test_a_joint_at_rest_tells_nothing():
    rng = np.random.default_rng(1)
    stamps = np.sort(1e-3 * np.arange(4000) + 3e-4 * rng.normal(size=4000))
    still = STEP * rng.integers(0, 2, size=4000)
    assert sampling_instants(stamps, [still]).notes == ()


def test_a_clock_whose_rate_changes_is_no_scatter():
    """A loop that is faster while the drive is off: 3.5 ms instead of 5.3 ms, and the stamps are true."""
    rng = np.random.default_rng(4)
    steps = np.where(np.arange(1500) // 500 == 1, 3.5e-3, 5.3e-3) + 1.5e-4 * rng.normal(size=1500)
    stamps = np.cumsum(steps)
    assert sampling_instants(stamps, [motion(stamps)]).notes == ()


@pytest.mark.parametrize("scatter", [0.0, 0.05, 0.3])
def test_rows_out_of_order_are_no_scatter(scatter):
    """Two rows far from each other change places; their neighbours' scatter could not do it."""
    steady = 1e-3 * np.arange(2000)
    stamps = np.maximum.accumulate(steady + scatter * 1e-3 * np.random.default_rng(5).normal(size=2000))
    stamps[[800, 804]] = stamps[[804, 800]]
    found = sampling_instants(stamps, [motion(steady)])
    assert found.notes == () and np.array_equal(found.time, stamps)


@pytest.mark.parametrize("resolution", [1e-6, 1e-3])
def test_a_run_with_scattering_stamps_is_that_of_a_steady_clock(tmp_path, resolution):
    """Whole milliseconds at 1 kHz repeat many stamps; none of their rows is dropped."""
    rng = np.random.default_rng(2)
    steady = 1e-3 * np.arange(6000)
    stamps = np.maximum.accumulate(np.floor((steady + 3e-4 * rng.normal(size=6000)) / resolution) * resolution)
    run = read(tmp_path / "run.parquet", stamps, motion(steady), np.cos(5.0 * steady))
    assert any("about a steady clock" in note for note in run.notes)
    assert run.period == pytest.approx(1e-3, rel=1e-3) and len(run) == pytest.approx(6000, abs=3)
    shift = 0.5 * resolution if resolution > 1e-4 else 0.0
    inner = slice(50, -50)
    true = 0.5 * np.sin(5.0 * (run.time + shift)) + 0.2 * np.sin(14.0 * (run.time + shift))
    assert np.abs(run.columns["knee/position"] - true)[inner].max() < 1e-3


def test_ten_minutes_at_a_kilohertz_take_seconds(tmp_path):
    rng = np.random.default_rng(3)
    steady = 1e-3 * np.arange(600_000)
    stamps = np.maximum.accumulate(steady + 3e-4 * rng.normal(size=steady.size))
    begin = clock.process_time()
    run = read(tmp_path / "run.parquet", stamps, motion(steady), np.cos(5.0 * steady))
    assert clock.process_time() - begin < 20.0 and len(run) == pytest.approx(600_000, abs=10)


def test_noise_of_rows_at_true_scattered_instants_stays_as_it_is(tmp_path):
    """Interpolated noise would be a fifth smaller, and alike in neighbouring samples by 0.2."""
    rng = np.random.default_rng(3)
    steady = 1e-3 * np.arange(40_000)
    stamps = steady + rng.uniform(-3e-4, 3e-4, steady.size)
    noise = 0.01 * rng.normal(size=steady.size)
    run = read(tmp_path / "run.parquet", stamps, motion(stamps), np.cos(5.0 * stamps) + noise)
    assert run.period == pytest.approx(1e-3, rel=1e-5)
    assert not any("lost rows" in note for note in run.notes)
    left = run.columns["knee/current"] - np.cos(5.0 * (run.time + stamps[0] - run.time[0]))
    assert left.std() == pytest.approx(0.01, rel=0.03)
    assert abs(np.corrcoef(left[1:], left[:-1])[0, 1]) < 0.06


def test_a_step_is_not_carried_over():
    """Beside a jump of a measured column, samples stay between the two levels."""
    rng = np.random.default_rng(6)
    time = 1e-3 * np.arange(4000) + rng.uniform(-3e-4, 3e-4, 4000)
    enabled = np.ones(4000, dtype=bool)
    grid = uniform_clock(time, enabled, Path("run.csv"))
    level = np.where(time < 2.0, -1.0, 1.0)
    for values in (level, level + 1e-4 * rng.normal(size=4000)):
        found = grid.resample(values)
        assert np.abs(found).max() < 1.001
    assert np.array_equal(grid.resample(level, held=True), np.interp(grid.time, grid.raw_time, level))
