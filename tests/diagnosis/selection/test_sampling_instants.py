"""Controllers that hold their effort for one sampling period: no delay is named, and a longer one still is."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml
from robot_files import joint_tag, link_tag, urdf, write_robot

from drake_tc.diagnosis.joint import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.estimates import estimates
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.run import close_loop
from drake_tc.diagnosis.selection.sampling_instants import _between, sampled_late
from drake_tc.diagnosis.timing_notes import OlderEffort
from drake_tc.effects.library import effect
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

PERIOD, FINE = 5e-3, 2.5e-4
INERTIA, MOMENT, VISCOUS, COULOMB, GAIN = 0.05, 3.2, 0.35, 0.3, 0.25
ENCODER = 2 * np.pi / 2**16
RIG = parse_rig(
    {
        "joint": "joint",
        "drive": "current",
        "load": {"pendulum": {"mass": 2.0, "length": MOMENT / (2.0 * 9.81), "inertia": 0.14}},
        "declared": {"rotor_inertia": INERTIA},
    }
)


def run(shift: float, late: float) -> Run:
    """A sampled PD loop [A] on a pendulum: its current is recorded when it is set, `late` before it acts, and held."""
    count, each = round(25.0 / PERIOD), round(PERIOD / FINE)
    q, v, total = 0.0, 0.0, INERTIA + 0.14
    wait = [0.0] * (round(late / FINE) + 1)
    position, current = np.empty(count), np.empty(count)
    for k in range(count):
        t = k * PERIOD
        waves = ((0.7, 0.19, 0.0), (0.5, 0.47, 1.1), (0.25, 0.83, 2.3))
        goal = min(t, 1.0) * sum(a * np.sin(2 * np.pi * f * (t + shift) + p) for a, f, p in waves)
        measured = ENCODER * round(q / ENCODER)
        asked = GAIN * (40.0 * (goal - measured) - 2.0 * v)
        position[k], current[k] = measured, asked
        for _ in range(each):
            wait.append(asked)
            torque = wait.pop(0) / GAIN - MOMENT * np.sin(q) - VISCOUS * v
            faster = v + FINE * torque / total
            slower = FINE * COULOMB / total
            v = np.sign(faster) * max(abs(faster) - slower, 0.0)
            q += FINE * v
    columns = {"joint/position": position, "joint/current": current}
    segment = np.zeros(count, dtype=int)
    steps = {"joint/position": ENCODER}
    return Run(f"run{shift}", None, PERIOD * np.arange(count), PERIOD, columns, segment, steps=steps)


def diagnosed(late: float) -> JointResult:
    runs = [run(shift, late) for shift in (0.0, 0.4, 0.7)]
    return diagnose_joint(runs[:2], runs[2:], RIG, "joint", DiagnosisOptions(assess_residual=False))


def test_half_a_period_of_hold_is_no_delay():
    found = diagnosed(0.0)
    assert found.effects == ()
    (older,) = (note for note in found.notes if isinstance(note, OlderEffort))
    assert 0.0 < older.age <= older.period


@pytest.mark.slow
def test_half_a_period_of_hold_is_no_delay_where_a_robot_model_gives_the_load(tmp_path):
    """The same pendulum as a robot of one link."""
    mass, length = 2.0, MOMENT / (2.0 * 9.81)
    about_com = 0.14 - mass * length**2
    text = urdf(
        joint_tag("joint", "base", "arm", axis=(0, -1, 0)),
        link_tag("arm", (0, 0, -length), mass, (about_com, about_com, 1e-3)),
    )
    write_robot(tmp_path, text, ["joint"])
    logs = []
    for k, shift in enumerate((0.0, 0.4, 0.7)):
        made = run(shift, 0.0)
        logs.append(tmp_path / f"run_{k}.csv")
        pd.DataFrame({"time": made.time, **made.columns}).to_csv(logs[-1], index=False)
    rig = {"robot": "arm.yaml", "drive": "current", "load": {"robot": "inverse_dynamics"}}
    rig |= {"declared": {"rotor_inertia": INERTIA}}
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig), encoding="utf-8")
    options = DiagnosisOptions(assess_residual=False)
    found = close_loop(tmp_path / "rig.yaml", logs[:2], logs[2:], options).joints["joint"]
    assert found.effects == ()
    assert any(isinstance(note, OlderEffort) for note in found.notes)


def test_a_late_torque_sensor_is_no_age_of_the_effort():
    """Its delay is a coefficient of the fit, not a shape."""
    sensor = Term(effect("delay.torque_sensor"))
    prepared = prepare_joint([run(0.0, 0.0)], [run(0.4, 0.0)], RIG, "joint")
    assert sampled_late(None, prepared, [*prepared.terms, sensor]) == 0.0
    assert sampled_late(None, prepared, prepared.terms) == 0.0


@pytest.mark.parametrize(("stated", "explained"), [(None, 0.5), (True, 0.0), (False, 0.0)])
def test_what_the_rig_file_states_of_the_hold_is_not_explained_twice(stated, explained):
    """Half a period is the hold's where nothing is stated, a cause where the fit has the hold, or none acts."""
    rig = replace(RIG, command_hold=stated)
    prepared = prepare_joint([run(0.0, 0.0)], [run(0.4, 0.0)], rig, "joint")
    delay = Term(effect("delay"), {"delay": 0.5 * PERIOD})
    assert sampled_late(stated, prepared, [*prepared.terms, delay]) == pytest.approx(explained)


def test_a_delay_that_may_be_as_short_as_sampling_explains_is_none():
    """Half a period of the hold beyond 0.6 of one is no delay while noise leaves it as uncertain as this."""
    made = [coarse(run(shift, 0.0), bits=9, seed=seed) for seed, shift in enumerate((0.0, 0.4))]
    rig = replace(RIG, command_hold=None)
    prepared = prepare_joint(made[:1], made[1:], rig, "joint")
    chosen = [*prepared.terms, Term(effect("delay"), {"delay": 0.65 * PERIOD})]
    delay = estimates(prepared.train, fit(prepared.train, chosen), "current")[effect("delay").key]["delay"]
    assert delay.ci95[0] < 0.6 * PERIOD
    assert sampled_late(None, prepared, chosen) == pytest.approx(0.6)
    sure = prepare_joint([run(0.0, 0.0)], [run(0.4, 0.0)], rig, "joint")
    assert sampled_late(None, sure, chosen) == 0.0


def coarse(made: Run, bits: int, seed: int) -> Run:
    """The run as a coarse and noisy encoder records it."""
    step = 2 * np.pi / 2**bits
    position = made.columns["joint/position"] + 0.5 * step * np.random.default_rng(seed).standard_normal(made.time.size)
    columns = dict(made.columns) | {"joint/position": step * np.round(position / step)}
    return replace(made, columns=columns, steps={"joint/position": step})


def test_no_age_lies_between_ages_of_which_one_explains_nothing():
    """An infinite error has no parabola."""
    prepared = prepare_joint([run(0.0, 0.0)], [run(0.4, 0.0)], RIG, "joint")
    sound = fit(prepared.train, prepared.terms)
    tried = {0.125: sound, 0.25: sound, 0.375: replace(sound, cv_rms=np.inf)}
    assert _between(tried, pytest.fail, prepared.terms) == {}
