"""The harder draw: its physics against closed forms, its channels against known signals, its oracle and its score."""

import dataclasses
import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drake_tc.logs.rig import load_rig
from tests.benchmarks.hard import draw as drawing
from tests.benchmarks.hard import oracle, score
from tests.benchmarks.hard.causes import CAUSES, World
from tests.benchmarks.hard.physics import CURRENT, GRAVITY, STEP, VOLTAGE, Joint, Traces, simulate
from tests.benchmarks.hard.rig import EFFORT_COLUMN, Rig, problem, record_run
from tests.benchmarks.hard.run import hard_benchmark
from tests.benchmarks.hard.sensors import Channel, record, stamps

LIMP = Joint(gain=1e9, rotor=0.1, link=0.2, moment=0.2 * GRAVITY / 0.4, viscous=0.0, coulomb=0.0)
"""A joint whose drive gives no torque and that has no friction."""


def free(joint: Joint, seconds: float, start: float = 0.0, external: float = 0.0) -> Traces:
    n = round(seconds / STEP)
    zero = np.zeros(n)
    return simulate(joint, zero, zero, zero + external, zero + 25.0, start)


def test_a_free_joint_swings_with_the_period_of_a_pendulum_and_keeps_its_energy() -> None:
    traces = free(LIMP, 20.0, start=0.01)
    rises = traces.time[1:][(traces.q[:-1] < 0.0) & (traces.q[1:] >= 0.0)]
    period = 2.0 * np.pi * np.sqrt((LIMP.rotor + LIMP.link) / LIMP.moment)
    np.testing.assert_allclose(np.diff(rises).mean(), period, rtol=2e-4)  # a crossing is known to 0.2 ms
    traces = free(LIMP, 10.0, start=2.0)
    energy = 0.5 * (LIMP.rotor + LIMP.link) * traces.v**2 - LIMP.moment * np.cos(traces.q)
    np.testing.assert_allclose(energy, -LIMP.moment * np.cos(2.0), atol=2e-3 * LIMP.moment)  # first-order step


def test_a_constant_torque_ends_at_the_speed_at_which_friction_takes_it() -> None:
    joint = LIMP._replace(moment=1e-9, coulomb=0.5, viscous=0.3, quadratic_viscous=0.1, coulomb_asymmetry=0.1)
    speed = free(joint, 10.0, external=-2.0).v[-1]
    np.testing.assert_allclose(0.5 + 0.1 + 0.3 * speed + 0.1 * speed**2, 2.0, rtol=1e-6)
    speed = free(joint, 10.0, external=2.0).v[-1]
    np.testing.assert_allclose(0.5 - 0.1 - 0.3 * speed + 0.1 * speed**2, 2.0, rtol=1e-6)


def test_a_torque_below_coulomb_friction_only_bends_the_bristle() -> None:
    joint = LIMP._replace(moment=1e-9, coulomb=1.0, bristle=1e-3, viscous=20.0)
    n = round(6.0 / STEP)
    push = -0.8 * np.minimum(np.arange(n) * STEP / 3.0, 1.0)
    traces = simulate(joint, np.zeros(n), np.zeros(n), push, np.zeros(n), 0.0)
    np.testing.assert_allclose(traces.q[-1], -1e-3 * np.log(1.0 - 0.8), rtol=0.01)
    assert abs(traces.v[-1]) < 1e-5


def test_play_and_compliance_of_the_gear_under_a_slow_load() -> None:
    n = round(8.0 / STEP)
    push = 3.0 * np.sin(2.0 * np.pi * 0.25 * np.arange(n) * STEP)
    stiff = LIMP._replace(gain=1e-4, derivative=80.0, moment=1e-6, link=0.05)
    elastic = simulate(stiff._replace(compliance=2e-3), np.zeros(n), np.zeros(n), push, np.zeros(n), 0.0)
    np.testing.assert_allclose(elastic.after_gap[5000:], 2e-3 * elastic.torque[5000:], atol=2e-5)
    loose = simulate(stiff._replace(backlash=0.02), np.zeros(n), np.zeros(n), push, np.zeros(n), 0.0)
    pressed = np.abs(push[::2]) > 2.0
    pressed[:5000] = False
    spring = 3.0 / (0.05 * 700.0**2)
    side = 0.01 * np.sign(push[::2][pressed])
    np.testing.assert_allclose(loose.after_gap[pressed], side, atol=1.05 * spring)


@pytest.mark.parametrize("drive", [CURRENT, VOLTAGE])
def test_a_lag_follows_a_step_exponentially(drive: int) -> None:
    """The controller asks for a constant torque; the joint is held by friction, so there is no back-EMF."""
    joint = Joint(drive=drive, gain=0.5, moment=1e-9, coulomb=100.0, outer_stiffness=4.0, lag=0.02, bristle=1e-2)
    n = round(0.2 / STEP)
    traces = simulate(joint, np.ones(n), np.zeros(n), np.zeros(n), np.zeros(n), 0.0)
    expected = 0.5 * 4.0 * (1.0 - np.exp(-(traces.time + STEP) / 0.02))
    np.testing.assert_allclose(traces.acting, expected, atol=0.03)  # the bristle bends, and the current loop is 0.1 ms


TRACE = np.arange(0.0, 4.0, 2e-4)
SIGNAL = np.sin(2.0 * np.pi * 1.5 * TRACE)


def test_a_channel_is_as_old_as_its_age_and_its_average_say() -> None:
    rng = np.random.default_rng(0)
    time = stamps(100.0, 4.0, 0.0, rng)
    column, clean = record(Channel(age=0.004), time, TRACE, SIGNAL, rng)
    np.testing.assert_allclose(column, np.sin(2.0 * np.pi * 1.5 * (time - 0.004)), atol=1e-6)
    np.testing.assert_array_equal(column, clean)
    scattered, clean = record(Channel(age=0.004, jitter=1e-3), time, TRACE, SIGNAL, rng)
    np.testing.assert_array_equal(column, clean)
    slope = np.sqrt(np.mean((2.0 * np.pi * 1.5 * np.cos(2.0 * np.pi * 1.5 * (time - 0.004))) ** 2))
    np.testing.assert_allclose(np.std(scattered - clean), 1e-3 * slope, rtol=0.1)
    averaged, _ = record(Channel(age=0.001, average=0.01), time, TRACE, SIGNAL, rng)
    w = 2.0 * np.pi * 1.5
    mean = (np.cos(w * (time - 0.011)) - np.cos(w * (time - 0.001))) / (0.01 * w)
    np.testing.assert_allclose(averaged, mean, atol=1e-6)


def test_a_slow_channel_repeats_its_value_and_steps_are_rounded() -> None:
    rng = np.random.default_rng(0)
    time = stamps(100.0, 4.0, 0.0, rng)
    column, _ = record(Channel(every=4, gain=0.1, zero=0.5), time, TRACE, SIGNAL, rng)
    updates = time[(np.arange(time.size) // 4) * 4]
    np.testing.assert_allclose(column, 0.5 + 1.1 * np.sin(2.0 * np.pi * 1.5 * updates), atol=1e-6)
    stepped, _ = record(Channel(step=0.25), time, TRACE, SIGNAL, rng)
    assert set(stepped) <= set(0.25 * np.arange(-4, 5))


def test_noise_and_wander_have_the_sizes_that_they_state() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 400.0, 0.01)
    noisy, clean = record(Channel(noise=0.2, wander=0.3, wander_time=0.5), time, time, np.zeros_like(time), rng)
    error = noisy - clean
    np.testing.assert_allclose(error.std(), np.hypot(0.2, 0.3), rtol=0.05)
    lag = int(0.5 / 0.01)
    np.testing.assert_allclose(np.mean(error[lag:] * error[:-lag]), 0.09 * np.exp(-1.0), atol=0.012)


def test_stamps_jitter_and_stay_in_order() -> None:
    time = stamps(50.0, 20.0, 0.1, np.random.default_rng(2))
    assert np.diff(time).min() > 0.0
    np.testing.assert_allclose(np.diff(time).std(), np.sqrt(2.0) * 0.1 / 50.0, rtol=0.1)


def perfect(rig: Rig) -> Rig:
    """The rig with sensors without errors, and friction of exactly the declared form."""
    shown = ["position", EFFORT_COLUMN[rig.drive], *(["torque"] if rig.load == "torque" else [])]
    joint = rig.world.joint._replace(small_stribeck=0.0)
    runs = tuple(dataclasses.replace(r, coulomb=1.0, viscous=1.0, zero=0.0, duration=8.0) for r in rig.runs)
    return dataclasses.replace(
        rig, channels={name: Channel() for name in shown}, world=World(joint), runs=runs, rate=250.0, tolerances={}
    )


QUICK = {"backlash", "stribeck", "torque_sensor_gain"}
EACH = [pytest.param(name, marks=[] if name in QUICK else pytest.mark.slow) for name in sorted(CAUSES)]


@pytest.mark.parametrize("name", EACH)
def test_with_perfect_sensors_the_columns_of_each_cause_explain_what_it_does(name: str) -> None:
    cause = CAUSES[name]
    rng = np.random.default_rng(3)
    rig = perfect(drawing._rig("rig", cause.drives[0], cause.loads[0], (name,), rng))
    world = drawing._apply(rig, rig.world, name, rig.causes[name], cause.first)
    task, _ = problem(rig, world, {run.name: record_run(rig, world, run) for run in rig.training})
    judged = oracle.judge(task, {})[name]
    assert judged.floors > 15.0
    assert judged.log_odds > 100.0


def test_a_rig_is_the_same_for_the_same_seed_and_another_for_another_seed() -> None:
    first, again, other = drawing.draw(5, 0), drawing.draw(5, 0), drawing.draw(6, 0)
    assert first.judgements == again.judgements
    for run in first.rig.runs:
        for name, column in first.recordings[run.name].columns.items():
            np.testing.assert_array_equal(column, again.recordings[run.name].columns[name])
    assert first.world.joint != other.world.joint


def test_one_rig_of_each_pair_lacks_nothing_and_first_causes_go_round() -> None:
    kinds = [drawing._kind(4, number, np.random.default_rng(number)) for number in range(2 * len(CAUSES))]
    assert all((not a[2]) != (not b[2]) for a, b in zip(kinds[::2], kinds[1::2], strict=True))
    assert {ids[0] for _, _, ids in kinds if ids} == set(CAUSES)


def synthetic(size: float, correlated: bool = False) -> oracle.Problem:
    rng = np.random.default_rng(7)
    base, cause = rng.normal(size=(2000, 2)), rng.normal(size=(2000, 1))
    noise = rng.normal(size=2000)
    if correlated:
        noise = np.repeat(noise[::50], 50)
    run = np.repeat([0.0, 1.0], 1000)
    nuisance = (run[:, None] == np.array([0.0, 1.0])).astype(float)
    target = base @ [3.0, -2.0] + size * cause[:, 0] + noise
    return oracle.Problem(target, base, nuisance, np.array([0.1, 0.1]), {"a": cause}, run)


def test_the_oracle_finds_a_strong_cause_and_no_absent_one() -> None:
    strong = oracle.judge(synthetic(1.5), {})["a"]
    np.testing.assert_allclose(strong.floors, 1.5, rtol=0.1)
    # n / 2 log(1 + 1.5^2) - log(n) / 2, of about 2000 independent rows
    np.testing.assert_allclose(strong.log_odds, 1000.0 * np.log(3.25) - 3.8, rtol=0.15)
    assert oracle.judge(synthetic(0.0), {})["a"].log_odds < 0.0
    unrelated = np.random.default_rng(9).normal(size=(2000, 1))
    assert oracle.gain(synthetic(1.5), unrelated) < 0.0


def test_correlated_noise_leaves_fewer_independent_rows() -> None:
    assert oracle.judge(synthetic(1.5, correlated=True), {})["a"].log_odds < 0.1 * 1000.0 * np.log(3.25)


def test_an_alternative_that_explains_as_much_is_allowed() -> None:
    task = synthetic(1.5)
    twin = task.causes["a"] * 2.0 + 1e-3
    other = np.random.default_rng(9).normal(size=(2000, 1))
    assert oracle.judge(task, {"twin": [other, twin], "other": [other]})["a"].allowed == ("twin",)


def truth(name: str, *causes: dict[str, Any], **more: Any) -> dict[str, Any]:
    base = {"name": name, "drive": "current", "load": "torque", "causes": list(causes), "null": not causes}
    return base | {"tolerated": [], "declared_parameters": {"viscous": 2.0, "coulomb": 1.0, "drive_gain": 0.5}} | more


def cause(name: str, odds: float = 50.0, allowed: tuple[str, ...] = (), **parameters: float) -> dict[str, Any]:
    return {
        "id": name,
        "parameters": parameters,
        "allowed": list(allowed),
        "strength_floors": 3.0,
        "oracle_log_odds": odds,
    }


def report(*effects: tuple[str, dict[str, tuple[float, float]]], **final: tuple[float, float]) -> dict[str, Any]:
    names = {"viscous": "viscous", "coulomb": "coulomb", "drive": "gain"}
    joint = {
        "effects": [
            {"id": name, "parameters": {p: {"value": 0.0, "ci95": list(ci)} for p, ci in parameters.items()}}
            for name, parameters in effects
        ],
        "final_parameters": {effect: {names[effect]: {"ci95": list(ci)}} for effect, ci in final.items()},
    }
    return {"verdict": "effects_found", "seconds": 1.0, "joints": {"axis": joint}}


def test_the_score_counts_by_hand() -> None:
    stribeck = cause("stribeck", stribeck=0.4, stribeck_velocity=0.1)
    intervals = {"stribeck": (0.3, 0.5), "stribeck_velocity": (0.2, 0.3)}
    sound = report(viscous=(1.9, 2.1), coulomb=(1.1, 1.2), drive=(0.4, 0.6)) | {"verdict": "no_missing_effect"}
    unsure = report(("elasticity", {}))
    unsure["joints"]["axis"]["indistinguishable"] = [["payload", "elasticity"], ["stribeck", "deadzone"]]
    results = [
        score.outcome(truth("null_clean"), sound),
        score.outcome(truth("null_false"), report(("delay", {}))),
        score.outcome(truth("null_late", tolerated=["delay"]), report(("delay", {}))),
        score.outcome(truth("exact", stribeck), report(("stribeck", intervals))),
        score.outcome(truth("other", cause("payload", allowed=("load_tilt",))), report(("load_tilt", {}))),
        score.outcome(truth("missed", cause("payload"), cause("backlash", odds=3.0)), unsure),
        score.outcome(truth("refused", stribeck), {"error": "LogError: x"}),
    ]
    counts = {row.name: (row.hits, row.of) for row in score.rows(results) if row.group == "all"}
    assert counts == {
        "nulls with a false name": (1, 3),
        "causes found": (2, 3),
        "causes found or listed as indistinguishable": (3, 3),
        "nulls of which nothing is said to be missing": (1, 3),
        "rigs with causes and a false name": (1, 3),
        "rigs with causes and nothing found": (1, 3),
        "exact sets": (4, 6),
        "exact sets, rigs with causes": (2, 3),
        "refused": (1, 7),
        "intervals that hold, declared": (2, 3),
        "intervals that hold, effects": (1, 2),
    }
    assert score.table(results).row_count == len(counts)
    assert score.rig_table(results).row_count == len(results)
    assert {(r.group, r.name): r.hits for r in score.by_cause(results)}["elasticity", "false"] == 1


def echo(rig: Path, reports: Path) -> None:
    """A diagnosis that names nothing and refuses every second rig."""
    number = int(rig.name.split("_")[1])
    if number % 2:
        raise ValueError("no")
    assert load_rig(rig / "rig.yaml").joints
    (reports / rig.name / "report.json").write_text(json.dumps(report()))


def test_the_benchmark_writes_rigs_that_the_library_reads_and_scores_every_report(tmp_path: Path) -> None:
    with ThreadPoolExecutor(1) as pool:
        results = hard_benchmark(tmp_path, 2, 2, pool, echo)
    assert [bool(r.refused) for r in results] == [False, True]
    again = hard_benchmark(tmp_path, 2, 2, None, echo, only=["rig_001"])
    assert again == results
    for rig in (tmp_path / "rigs").iterdir():
        held = list(rig.glob("run_held_*.csv"))
        assert len(held) == 1
        assert len(list(rig.glob("run_*.csv"))) >= 3
    with pytest.raises(ValueError, match="no rig rig_9"):
        hard_benchmark(tmp_path, 2, 2, None, echo, only=["rig_9"])
