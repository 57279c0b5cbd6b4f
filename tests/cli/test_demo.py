"""The demo's rig: files as a stranger would get them, from a joint that has more than its model."""

import json
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pandas as pd
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal

from drake_tc.cli import demo
from drake_tc.cli.demo import (
    ENCODER_STEP,
    JOINT,
    LIMITS,
    MISSING,
    ROTOR_INERTIA,
    DemoLength,
    demo_excitation,
    demo_model,
    record_demo,
)
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig

from .conftest import SHORT
from .report_schema import check_report

TINY = DemoLength(duration=6.0, period=2e-3, step=2e-3)


def test_the_files_read_back_without_a_repair(bench):
    rig = load_rig(bench.rig)
    runs = load_runs([*bench.logs, bench.holdout], rig)
    assert rig.joints == (JOINT,)
    for run in runs:
        assert run.notes == ()
        assert_array_equal(run.segment, 0)
        assert_allclose(run.period, SHORT.period, rtol=1e-9)  # the clock as it was written


def test_the_rig_file_declares_the_rotor_alone_and_says_that_it_is_simulated(bench):
    text = bench.rig.read_text()
    assert "simulated" in text.lower()
    assert yaml.safe_load(text)["declared"] == {"rotor_inertia": ROTOR_INERTIA}


def test_what_is_missing_is_in_the_simulated_joint_and_depends_on_the_seed():
    found = [{v.effect.id for v in demo_model(seed).effects} for seed in range(len(MISSING))]
    for seed, ids in enumerate(found):
        assert {v.effect.id for v in MISSING[seed]} <= ids
    assert len(set(map(frozenset, found))) == len(MISSING)


def test_in_a_posture_the_torque_sensor_sees_gravity_less_the_push(bench):
    """Link near rest: tau = 18 sin q - push, 18 N m being the demo's gravity moment."""
    table = pd.read_parquet(bench.logs[0])
    push = demo_excitation(0, SHORT)["postures_with_pushes"][1]
    moved = table[f"{JOINT}/position_command"].diff().abs().rolling(75, center=True).max().to_numpy()
    still = moved == 0.0
    assert still.sum() > 300 and np.ptp(push[still]) > 40.0
    gravity = 18.0 * np.sin(table[f"{JOINT}/position"].to_numpy())
    slope, offset = np.polyfit(push[still], (table[f"{JOINT}/torque"].to_numpy() - gravity)[still], 1)
    # the link still rings a little, and gives way to the push at up to 0.2 rad/s^2
    assert_allclose([slope, offset], [-1.0, 0.0], atol=0.15)


def test_the_encoder_has_steps(bench):
    steps = pd.read_parquet(bench.logs[1])[f"{JOINT}/position"].to_numpy() / ENCODER_STEP
    assert_allclose(steps, np.round(steps), atol=1e-6)  # rounding of the division


@pytest.mark.parametrize("seed", range(3))
def test_the_excitation_stays_inside_the_limits(seed):
    for motion, push in demo_excitation(seed, TINY).values():
        assert LIMITS.position[0] <= motion.position.min() and motion.position.max() <= LIMITS.position[1]
        assert np.abs(motion.velocity).max() <= LIMITS.velocity * (1 + 1e-9)
        assert np.abs(motion.acceleration).max() <= LIMITS.acceleration * (1 + 1e-9)
        assert push.shape == motion.position.shape


def test_same_seed_same_numbers(tmp_path):
    first, again, other = (record_demo(tmp_path / n, s, TINY, jobs=1) for n, s in (("a", 1), ("b", 1), ("c", 4)))
    for one, two in zip(first[1] + first[2], again[1] + again[2], strict=True):
        pd.testing.assert_frame_equal(pd.read_parquet(one), pd.read_parquet(two), check_exact=True)
    assert not pd.read_parquet(first[1][0]).equals(pd.read_parquet(other[1][0]))


@pytest.fixture
def short_demo(monkeypatch, tmp_path):
    """An empty working folder, and a demo whose recordings are short: the mock that makes them."""
    record = Mock(side_effect=partial(record_demo, length=DemoLength(duration=3.0, period=4e-3, step=1e-3), jobs=1))
    monkeypatch.setattr(demo, "record_demo", record)
    monkeypatch.chdir(tmp_path)
    return record


def test_a_script_gets_json_alone_and_the_joint_of_its_seed(invoke, look_for, short_demo):
    look_for()
    outcome = invoke("demo", "--json", "--seed", 1, "--out", "deep/out")
    assert (outcome.code, outcome.err) == (0, "")
    report, written = json.loads(outcome.out), json.loads(Path("deep/out/report.json").read_text("utf-8"))
    check_report(report)
    assert set(report["joints"]) == {JOINT}
    assert {k: v for k, v in report.items() if k != "seconds"} == {k: v for k, v in written.items() if k != "seconds"}
    assert short_demo.call_args.args[1] == 1
    out = Path("deep/out")
    assert {path.stem for path in (out / "demo_logs").glob("*.parquet")} == set(demo_excitation(0, TINY))
    named = yaml.safe_load((out / "model_after.yaml").read_text(encoding="utf-8"))["provenance"]["rig"]
    assert (out / named).is_file() and (out / "report.html").stat().st_size > 100_000


def test_a_report_of_the_users_is_not_overwritten(invoke, short_demo):
    page = Path("demo/report.html")
    page.parent.mkdir()
    page.write_text("mine")
    refusal = invoke("demo").refusal()
    assert "report.html" in refusal and "--force" in refusal
    assert page.read_text() == "mine"
