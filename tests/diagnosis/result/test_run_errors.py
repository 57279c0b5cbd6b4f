"""Errors of a joint beside their RMS, and runs without usable rows, about which no verdict is."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from drake_tc.diagnosis.notes import RunsWithoutMotion
from drake_tc.diagnosis.result.errors import mean_absolute_errors, without_rows

from ..rigs import Joint, problem


def test_runs_without_rows_are_named_and_others_are_not():
    samples = problem(Joint(duration=6.0, period=4e-3), runs=2).samples
    assert without_rows((samples, samples)) == ()
    held = replace(samples, runs=(*samples.runs, "jittery"))
    assert without_rows((samples, held)) == (RunsWithoutMotion(("jittery",), samples.kernel.actual_width_s),)


def test_mean_absolute_errors_have_the_names_of_their_rms():
    joint = SimpleNamespace(
        train=SimpleNamespace(before=np.array([1.0, -3.0]), after=np.array([0.5, -0.5])),
        heldout=SimpleNamespace(before=np.array([2.0, -2.0, 5.0]), after=np.array([0.0, -3.0, 0.0])),
        free_run={
            "one": {"recorded": np.zeros(2), "before": np.array([0.1, -0.3]), "after": np.array([0.1, np.nan])},
            "two": {"recorded": np.ones(1), "before": np.array([1.2])},
        },
    )
    found = mean_absolute_errors(joint)
    assert found["before"] == pytest.approx({"train": 2.0, "heldout": 3.0, "free_run_heldout": 0.2})
    assert found["after"] == {"train": 0.5, "heldout": 1.0, "free_run_heldout": None}
