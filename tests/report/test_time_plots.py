"""Plots over time: thinning keeps extremes, the packed data are the traces, and a page of many runs stays small."""

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.diagnosis.problem.regression import predict
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.errors import DrakeTcError
from drake_tc.logs.rig import parse_rig
from drake_tc.report.html import PageBudget, plot_script, render
from drake_tc.report.plots.rows import extreme_samples
from drake_tc.report.plots.time_plots import (
    LEVELS,
    Trace,
    effort_plot,
    effort_traces,
    packed_line,
    position_plot,
    position_traces,
    worst_window,
)

from .conftest import record


@given(st.integers(1, 4000), st.integers(8, 500), st.integers(0, 2**32 - 1))
def test_thinning_keeps_the_extremes_of_every_series_and_the_ends(size: int, most: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    series = [rng.normal(size=size), np.where(rng.random(size) < 0.3, np.nan, rng.normal(size=size))]
    kept = extreme_samples(series, most)
    assert kept.size <= max(most, 2) + 2
    assert np.all(np.diff(kept) > 0)
    assert kept[0] == 0 and kept[-1] == size - 1
    for values in series:
        if np.isfinite(values).any():
            assert np.nanmax(values[kept]) == np.nanmax(values)
            assert np.nanmin(values[kept]) == np.nanmin(values)


def test_a_spike_of_one_sample_survives_in_every_stretch() -> None:
    values = np.zeros(100_000)
    spikes = np.arange(500, 100_000, 1000)
    values[spikes] = np.where(np.arange(spikes.size) % 2, 1.0, -1.0)
    assert set(spikes) <= set(extreme_samples([values], 600).tolist())


def test_a_thinned_trace_keeps_its_breaks_and_the_extremes_of_the_modelled_lines() -> None:
    time = np.arange(5000.0)
    measured = np.sin(0.01 * time)
    measured[[1000, 3000]] = np.nan
    before, after = 0.1 * np.cos(0.03 * time), np.where(time == 777.0, 0.5, 0.0)
    thin = Trace("a", True, time, measured, {"before": before, "after": after}).thinned(400)
    assert thin.time.size < 410
    assert {1000.0, 3000.0} == set(thin.time[np.isnan(thin.measured)])
    assert 777.0 in thin.time
    assert_allclose(np.nanmax(thin.measured + thin.errors["before"]), np.nanmax(measured + before), rtol=1e-12)
    assert_array_equal(thin.errors["before"], before[np.isin(time, thin.time)])


def test_modelled_effort_is_measured_effort_plus_the_residual(joint: JointResult) -> None:
    traces = effort_traces(joint)
    assert [(t.run, t.heldout) for t in traces] == [("slow", False), ("wide", False), ("fast", True)]
    held, samples = traces[-1], joint.heldout.samples
    rows = ~np.isnan(held.measured)
    assert_allclose(held.measured[rows], samples.reduce(samples.signals.effort), rtol=1e-12)
    assert_allclose(held.errors["after"][rows], joint.heldout.after, rtol=1e-12)
    gaps = np.flatnonzero(np.isnan(held.measured))
    assert gaps.size > 0  # the joint reverses
    assert np.all(np.isnan(held.errors["before"][gaps]))
    assert np.all(np.diff(held.time) > 0.0)


def test_positions_that_run_away_do_not_set_the_axis(joint: JointResult) -> None:
    trace = joint.free_run["fast"]
    runaway = {**trace, "after": np.where(trace["time"] > 4.0, 1e9, trace["after"])}
    (found,) = position_traces({"fast": runaway}, ["fast"])
    assert found.heldout
    assert np.nanmax(np.abs(found.errors["after"])) <= 10.0 * np.ptp(trace["recorded"]) + 1e-9
    assert_allclose(found.errors["before"], 0.04, rtol=1e-9)


def unpacked(packed: tuple[float, float, str]) -> np.ndarray:
    low, high, text = packed
    steps = np.frombuffer(base64.b64decode(text), "<i2").astype(float)
    return np.where(steps == -32768, np.nan, low + (steps + LEVELS / 2) * (high - low) / LEVELS)


@pytest.mark.parametrize("values", [[1.0, np.nan, -2.5, 1e3], [3.0, 3.0], [np.nan, np.nan], [0.0, -1e-7, np.inf]])
def test_packed_lines_are_the_lines_to_a_step(values: list[float]) -> None:
    wanted = np.array([v if np.isfinite(v) else np.nan for v in values])
    span = np.ptp(wanted[np.isfinite(wanted)]) if np.isfinite(wanted).any() else 0.0
    assert_allclose(unpacked(packed_line(np.array(values))), wanted, atol=0.6 * span / LEVELS, rtol=1e-6)


def test_the_script_gets_what_the_traces_hold(joint: JointResult) -> None:
    plot = effort_plot(joint, "j0", 10_000)
    assert plot is not None
    run, trace = plot.data["runs"][2], effort_traces(joint)[2]
    factor = {"mA": 1e3, "A": 1.0}
    error, value = factor[plot.data["errorUnit"]], factor[plot.data["unit"]]
    assert plot.data["valuePerError"] == value / error
    assert_allclose(np.frombuffer(base64.b64decode(run["time"]), "<f4"), trace.time, rtol=1e-6)
    after = trace.errors["after"]
    assert_allclose(unpacked(run["after"]), error * after, atol=1e-4 * error * np.nanmax(np.abs(after)))
    modelled = unpacked(run["measured"]) + unpacked(run["after"]) * plot.data["valuePerError"]
    assert_allclose(modelled, value * (trace.measured + after), atol=1e-3 * value * np.nanmax(trace.measured))
    assert plot.shown == 2  # the held-out run


def test_no_free_run_has_no_position_plot(unexplained_joint: JointResult) -> None:
    assert position_plot(unexplained_joint, "j0", 100) is None


def test_the_worst_stretch_is_where_the_model_after_errs() -> None:
    time = np.arange(0.0, 20.0, 0.01)
    error = 0.1 * ((time > 8.0) & (time < 11.0))
    trace = Trace("a", True, time, np.sin(time), {"before": 5.0 * np.cos(time), "after": error})
    assert_allclose(worst_window(trace), (8.0, 11.0), atol=0.03)
    assert_allclose(worst_window(replace(trace, errors={"before": error})), (8.0, 11.0), atol=0.03)
    assert worst_window(replace(trace, errors={})) == (time[0], time[-1])


def test_a_missing_library_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drake_tc.report.html.PACKAGE", "no-such-package-at-all")
    with pytest.raises(DrakeTcError, match="the report needs the package no-such-package-at-all: pip install"):
        plot_script()


def test_more_joints_and_runs_leave_less_for_each() -> None:
    one, many = PageBudget.of(1, 3), PageBudget.of(5, 150)
    assert many.trace_samples < one.trace_samples
    assert many.held.most < one.held.most
    assert PageBudget.of(0, 0).trace_samples == one.trace_samples


@pytest.fixture(scope="module")
def many_runs(joint: JointResult) -> JointResult:
    """Twenty training runs and five held-out runs of 10 s at 500 Hz, free runs of 20 s."""
    rig = parse_rig({"joint": "knee", "drive": "current", "declared": {}}, "rig.yaml")
    width = joint.train.samples.light.width_s
    splits = []
    for first, count in ((10, 20), (40, 5)):
        runs = [record(f"run_{k}", k, 10.0) for k in range(first, first + count)]
        columns = Columns(build_samples(runs, rig, "knee", width_s=width))
        splits.append(DataSplit(columns.samples, predict(columns, joint.baseline), predict(columns, joint.final)))
    time = np.arange(0.0, 20.0, 2e-3)
    recorded = np.sin(3.0 * time)
    noise = np.random.default_rng(0).normal(size=time.size)
    trace = {"time": time, "recorded": recorded, "before": recorded + 0.04 * noise, "after": recorded + 0.01}
    names = [*splits[0].samples.runs, *splits[1].samples.runs]
    return replace(joint, train=splits[0], heldout=splits[1], free_run=dict.fromkeys(names, trace))


@pytest.mark.slow
def test_a_page_of_25_runs_and_5_joints_stays_below_4_mb(result: CloseLoopResult, many_runs: JointResult) -> None:
    html = render(replace(result, joints={f"joint_{k}": replace(many_runs, joint=f"joint_{k}") for k in range(5)}))
    assert len(html.encode()) < 4e6
    stored = re.search(r'<script type="application/json" id="trace-data">(.*?)</script>', html, flags=re.DOTALL)
    assert stored is not None
    data = json.loads(stored.group(1))
    assert len(data) == 10
    assert all(len(plot["runs"]) == 25 for plot in data.values())
    sizes = [len(base64.b64decode(run["time"])) // 4 for plot in data.values() for run in plot["runs"]]
    assert min(sizes) > 200  # two hundred samples still draw a run
