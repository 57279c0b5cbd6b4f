"""A run that is given twice is refused, whatever file it is in; two takes of one motion are not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drake_tc.errors import LogError
from drake_tc.logs.episodes import require_different_runs
from drake_tc.logs.record import Run


def run(name: str, seed: int, size: int = 200) -> Run:
    rng = np.random.default_rng(seed)
    time = 1e-3 * np.arange(size)
    columns = {"joint/position": np.sin(time), "joint/current": rng.standard_normal(size)}
    return Run(name, Path(name), time, 1e-3, columns, np.zeros(size, dtype=np.int64))


def test_takes_of_one_motion_are_different_runs():
    require_different_runs([run("a.csv", 0), run("b.csv", 1), run("c.csv", 0, 199)])
    require_different_runs([run("a.csv", 0)])
    require_different_runs([])


@pytest.mark.parametrize("place", [0, 1, 2])
def test_the_same_samples_are_refused_and_both_files_named(place):
    runs = [run("a.csv", 0), run("b.csv", 1), run("c.csv", 2)]
    runs.insert(place, replace(runs[2], source=Path("again.npz"), name="again", time=runs[2].time + 5.0))
    with pytest.raises(LogError, match=r"holds the same samples.*remove one") as caught:
        require_different_runs(runs)
    assert "again.npz" in str(caught.value)
    assert "c.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_column_more_does_not_make_it_another_run():
    first = run("a.csv", 0)
    more = {**first.columns, "joint/temperature": np.full(len(first), 30.0)}
    with pytest.raises(LogError):
        require_different_runs([first, replace(first, source=Path("b.csv"), columns=more)])


def test_one_sample_that_differs_makes_it_another_run():
    first = run("a.csv", 0)
    current = first.columns["joint/current"].copy()
    current[100] += 1e-9
    require_different_runs([first, replace(first, columns={**first.columns, "joint/current": current})])
