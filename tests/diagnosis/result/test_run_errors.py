"""Runs that have no usable rows are named, as no verdict is about them."""

from dataclasses import replace

from drake_tc.diagnosis.result.run_errors import without_rows

from ..rigs import Joint, problem


def test_runs_without_rows_are_named_and_others_are_not():
    samples = problem(Joint(duration=6.0, period=4e-3), runs=2).samples
    assert without_rows((samples, samples)) == ()
    held = replace(samples, runs=(*samples.runs, "jittery"))
    (said,) = without_rows((samples, held))
    assert said.endswith("take no part: jittery.")
    assert all(name not in said for name in samples.runs)
    assert f"{1e3 * samples.kernel.actual_width_s:.3g} ms" in said
