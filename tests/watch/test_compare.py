"""`compare`: a joint without a change, one with more friction, and input that cannot be used."""

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pandas as pd
import pytest
import yaml

import drake_tc
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.cli.main import run
from drake_tc.diagnosis.result.models import gap_between_encoders
from drake_tc.effects.base import plain_signals
from drake_tc.errors import ParamsError
from drake_tc.logs.rig import parse_rig
from drake_tc.report.comparison import effect_sentence
from drake_tc.types import GRAVITY
from drake_tc.watch.changes import Known, Shift
from drake_tc.watch.compare import EffectChange, EffectStatus
from drake_tc.watch.parameters import (
    ABSENT,
    PAYLOAD,
    SAME_AGES,
    VISCOUS,
    common_variances,
    opened_by_payload,
    with_discrepancy,
)

from .conftest import OWN_EFFECTS, the_command_finds


def test_the_same_joint_is_unchanged_and_a_change_lies_within_its_interval(same):
    assert same.verdict == "unchanged"
    (joint,) = same.joints.values()
    linear = [p for p in joint.parameters if p.key in ("drive", "viscous", "coulomb", "deadzone")]
    assert len(linear) == 4 and all(p.change.ci95[0] <= 0.0 <= p.change.ci95[1] for p in linear)
    assert {e.key: e.status for e in joint.effects} == {"stribeck": "present", "deadzone": "present"}
    assert joint.floors_now < 2.0 and joint.floors_then < 2.0


def test_worn_friction_is_named_with_its_size(worn):
    assert worn.verdict == "parameters_changed"
    (joint,) = worn.joints.values()
    assert [(p.key, p.name) for p in joint.parameters if p.changed] == [("coulomb", "coulomb")]
    coulomb = next(p for p in joint.parameters if p.key == "coulomb")
    assert coulomb.change.ci95[0] < 0.3 * 6.0 < coulomb.change.ci95[1]
    assert joint.floors_then > 3.0 * joint.floors_now
    assert "coulomb changed by" in repr(worn) and "image/png" in worn._repr_html_()
    assert max(map(len, repr(worn).partition("parameter ")[2].splitlines())) < 130  # 175 with intervals beside values


def test_a_dead_zone_that_is_gone_is_told(diagnosed):
    found = drake_tc.compare(diagnosed.model, [diagnosed.later(3, deadzone=0.01)], options=OWN_EFFECTS)
    (joint,) = found.joints.values()
    assert {e.key: e.status for e in joint.effects}["deadzone"] == "gone"
    assert found.verdict == "parameters_changed"


def test_the_command_writes_page_and_json_and_its_exit_code_tells(diagnosed, worn, tmp_path, capsys):
    log = tmp_path / "today.csv"
    log.touch()
    out = tmp_path / "out"
    with the_command_finds(worn):
        code = run(["compare", "--model", str(diagnosed.model), "--log", str(log), "--out", str(out), "--json"])
    assert code == 1
    document = json.loads(capsys.readouterr().out)
    assert document["verdict"] == "parameters_changed"
    assert document == json.loads((out / "compare.json").read_text(encoding="utf-8"))
    assert "coulomb changed by" in (out / "report.html").read_text(encoding="utf-8")
    named = yaml.safe_load((out / "model_now.yaml").read_text(encoding="utf-8"))["provenance"]["rig"]
    assert (out / named).resolve() == diagnosed.rig.resolve()


def test_a_model_without_a_rig_file_says_what_to_give(diagnosed, tmp_path, capsys):
    alone = tmp_path / "model.yaml"
    alone.write_text(diagnosed.model.read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(ParamsError, match="give the rig file"):
        drake_tc.compare(alone, [diagnosed.later(1)])
    assert run(["compare", "--model", str(alone), "--log", str(tmp_path / "none.csv")]) == 2
    assert capsys.readouterr().err.count("drake-tc: ") == 1


def test_a_gap_between_two_encoders_is_the_one_of_the_gear():
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 20.0, 2e-3)
    q, tau = 0.5 * np.sin(2.0 * np.pi * 0.31 * time), 12.0 * np.cos(2.0 * np.pi * 0.57 * time)
    motor = q + 3e-5 * tau + 4e-4 * np.sign(tau) + 2e-3 + 1e-5 * rng.standard_normal(time.size)
    rows = np.arange(0, time.size, 10)
    signals = plain_signals(time.size, {"position": q, "load_torque": tau, "motor_position": motor})
    samples = SimpleNamespace(signals=signals, rows=rows, block=rows // 250)
    gap, (low, high) = gap_between_encoders(samples)
    assert gap == pytest.approx(8e-4, abs=1e-5) and low < 8e-4 < high and high - low < 2e-5


def test_of_two_joints_the_one_that_changed_is_named(diagnosed, tmp_path):
    (model,) = drake_tc.load_models(diagnosed.model).values()
    path = tmp_path / "two.yaml"
    drake_tc.save_models({name: replace(model, joint=name) for name in ("hip", "knee")}, path)
    parts = {"hip": diagnosed.later(4), "knee": diagnosed.later(5, coulomb=1.3)}
    columns = {f"{j}/{c.split('/')[1]}": t[c] for j, t in parts.items() for c in t if "/" in c}
    table = pd.DataFrame({"time": parts["hip"]["time"], **columns})
    rig = {"joints": ["hip", "knee"], "drive": "position_servo", "declared": {"rotor_inertia": 0.31}}
    found = drake_tc.compare(path, [table], rig, options=OWN_EFFECTS)
    assert found.verdict == "parameters_changed"
    assert [p.key for p in found["knee"].parameters if p.changed] == ["coulomb"]
    assert found["hip"].verdict == "unchanged"
    with pytest.raises(ParamsError, match="no joint 'ankle'; joints here: hip, knee"):
        found["ankle"]


def test_what_a_payload_on_a_pendulum_leaves_open_is_a_balance_with_more_inertia():
    """K (J + I + J_p) and K theta are those of the gain and the friction that it adds, to first order."""
    rig = parse_rig(
        {
            "joint": "knee",
            "drive": "current",
            "load": {"pendulum": {"mass": 2.0, "length": 0.5}},
            "columns": {"time": "t", "position": "q", "current": "i"},
            "declared": {"rotor_inertia": 0.3},
        }
    )
    numbers = {"rotor_inertia": 0.3, "viscous": 4.0, "coulomb": 2.0}
    model = ActuatorModel("knee", Drive("current", 0.1), tuple(EffectValue(k, {k: x}) for k, x in numbers.items()))
    stored = {("drive", "gain"): 0.1, ("viscous", "viscous"): 4.0, ("coulomb", "coulomb"): 2.0}
    pairs = {place: (Known(value, 0.1), Known(value, 0.1)) for place, value in stored.items()}
    pairs[PAYLOAD, "payload_moment"] = (ABSENT, Known(2.0, 0.1))
    gain, viscous, coulomb, payload = opened_by_payload(pairs, model, rig)
    inertia, carried = 0.3 + 2.0 * 0.5**2, 2.0 * 0.35 / GRAVITY  # a point mass at 0.35 m
    assert (0.1 + gain) * inertia == pytest.approx(0.1 * (inertia + carried), rel=0.02)
    assert (0.1 + gain) * (4.0 + viscous) == pytest.approx(0.1 * 4.0, rel=0.02)
    assert (0.1 + gain) * (2.0 + coulomb) == pytest.approx(0.1 * 2.0, rel=0.02)
    assert payload == 0.0


@pytest.mark.parametrize(
    ("drive", "period", "correlation", "expected"),
    [
        ("position_servo", 0.002, 0.0, 25.0),  # the stored deviation is the smallest
        ("position_servo", 0.001, 0.0, (0.4e-3 / 1.4e-4) ** 2),  # a hold of 1 ms leaves less open
        ("position_servo", 0.002, 0.9, 36.0 * (1.0 - 0.9**2)),  # the rest is shared with another parameter
        ("current", 0.002, 0.0, 0.0),
    ],
)
def test_what_the_age_of_a_servos_command_leaves_open_is_in_no_difference(drive, period, correlation, expected):
    matrix = np.array([[1.0, correlation], [correlation, 1.0]])
    told = SimpleNamespace(names=("viscous.viscous", "coulomb.coulomb"), matrix=matrix)
    samples = SimpleNamespace(effort_period=period)
    joint = SimpleNamespace(correlation=told, train=SimpleNamespace(samples=samples))
    pairs = {VISCOUS: (Known(30.0, 5.0), Known(31.0, 6.0)), ("coulomb", "coulomb"): (Known(4.0, 0.1), Known(4.0, 0.1))}
    common = common_variances(pairs, joint, ActuatorModel("knee", Drive(drive, 1.4e-4), ()))
    np.testing.assert_allclose(common, [SAME_AGES * expected, 0.0], rtol=1e-6)


@pytest.mark.parametrize("status", get_args(EffectStatus))
def test_every_status_of_an_effect_has_its_words(status):
    told = effect_sentence(EffectChange("deadzone", "dead zone", status, 2.0, {"deadzone": Known(0.01, 0.001)}))
    assert told.startswith("dead zone ") and "0.01" in told


def test_an_effect_that_explains_no_more_than_is_left_is_none_and_moves_nothing_with_it():
    """New logs that tell (1 + x)/K well, and both alone worse; x and K are off by seven deviations, in this ratio."""
    deviation, off = 0.01, -0.07
    now = deviation**2 * np.array([[1.0, 0.9999], [0.9999, 1.0]])
    then, prior = np.diag([1e-8, 0.0]), np.array([0.3, 0.3])
    found = Shift(np.array([off, off]), then, now, np.array([9e-6, 0.0]), prior, together=((1,),))
    assert found.best()[0] == (0, 1)
    assert with_discrepancy(found, 0.05).best()[0] == (0, 1)  # it explains twenty times what is left
    half_left = with_discrepancy(found, 2.0)
    assert half_left.best()[0] == ()
    np.testing.assert_allclose(
        half_left.now - now, (2.0 * off) ** 2 * np.array([[0.9998, 0.9999], [0.9999, 1.0]]), rtol=1e-4
    )
    assert half_left.new(0, ()).value == pytest.approx(0.0, abs=0.002)  # the stored gain stays
