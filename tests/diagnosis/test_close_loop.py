"""One joint from runs to result, to report.json and to model files; several joints from files."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.model_file import load_models
from drake_tc.diagnosis.diagnose import decided, diagnose_joint, joint_model
from drake_tc.diagnosis.evidence import Evidence
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.priors import ALTERNATIVE
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.models import model_of, models_of
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.diagnosis.run import close_loop
from drake_tc.diagnosis.search import Found
from drake_tc.effects.library import effect
from drake_tc.errors import DrakeTcError, IdentificationError
from drake_tc.report.data_files import result_json

from .rigs import Joint, record, rig_of, servo

NOISY = Joint(period=4e-3, torque_noise=0.25, extra=lambda m: 1.2 * m.v * np.abs(m.v))


QUICK = DiagnosisOptions(assess_residual=False)
"""Without the search for structure in what is left, which these tests do not ask for."""


def diagnose(joint: Joint, options: DiagnosisOptions = QUICK) -> JointResult:
    runs = [record(joint, "one"), record(joint, "two", 0.9, 1), record(joint, "held", 2.3, 2)]
    return diagnose_joint(runs[:2], runs[2:], rig_of(joint), "joint", options)


FEW = ("quadratic_viscous", "load_dependent_friction")
SOME = ("thermal_friction", "stribeck", "payload", "deadzone", "torque_ripple", "delay.loop", "backlash", *FEW)
"""Of each kind; tests of cases and of commands look for all."""


def only(*keys: str) -> DiagnosisOptions:
    """Look for these effects alone."""
    return replace(QUICK, effects=tuple(effect(key) for key in keys))


def result_of(*joints: JointResult) -> CloseLoopResult:
    named = {j.joint: j for j in joints}
    return CloseLoopResult(
        named, joints[0].verdict, 1.5, ("logs/one.csv", "logs/two.csv"), ("logs/held.csv",), "rig.yaml"
    )


@pytest.fixture(scope="module")
def found() -> JointResult:
    return diagnose(NOISY, replace(only(*SOME), assess_residual=True))


def test_an_effect_that_the_search_missed_is_added_to_its_result():
    runs = [record(NOISY, "one"), record(NOISY, "two", 0.9, 1), record(NOISY, "held", 2.3, 2)]
    prepared = prepare_joint(runs[:2], runs[2:], rig_of(NOISY), "joint")
    model = joint_model(prepared)
    evidence = Evidence(model).heard(model.declared, spread=False)
    nothing = Found(evidence, evidence.refined(evidence.score(model.declared)), ())
    decision = decided(nothing, [effect(key) for key in ("stribeck", "quadratic_viscous")])
    assert decision.best.ids - {t.effect.key for t in model.declared} == {"quadratic_viscous"}
    assert [(each.key, each.reason) for each in decision.tried] == [("stribeck", "too_little_evidence")]
    assert decision.tried[0].log_odds < 0.0


def test_an_effect_that_only_an_impossible_value_would_name_is_not_added_and_the_value_is_told():
    unstable = diagnose(replace(NOISY, extra=lambda m: -1.5 * m.q), only("cable_spring"))
    (rejected,) = (each for each in unstable.rejected if each.key == "cable_spring")
    assert unstable.effects == ()
    assert rejected.reason == "not_possible"
    assert rejected.log_odds > ALTERNATIVE
    assert rejected.obstacle.startswith("spring_stiffness is -1.5")


def test_the_missing_effect_is_found_and_its_value_is_right(found):
    assert found.verdict == "effects_found"
    assert [e.id for e in found.effects] == ["quadratic_viscous"]
    value = found.effects[0].parameters["quadratic_viscous"]
    # the first millimetre after reversals is left out, where sign(v) is smeared: 1 %
    assert value.ci95[0] - 0.012 <= 1.2 <= value.ci95[1] + 0.012
    assert found.effects[0].heldout_gain > 0.3
    assert found.effects[0].stability > 0.98
    assert found.after.heldout < 0.7 * found.before.heldout
    assert found.after.heldout < 1.5 * found.noise_floor
    assert {r.id for r in found.rejected} >= {"thermal_friction", "stribeck", "payload", "deadzone"}


def test_a_held_out_run_can_withdraw_an_effect_and_change_nothing_else(found):
    other = [record(NOISY, "one"), record(NOISY, "two", 0.9, 1), record(replace(NOISY, extra=None), "held", 2.3, 2)]
    again = diagnose_joint(other[:2], other[2:], rig_of(NOISY), "joint", only(*FEW))
    assert again.final.terms == again.baseline.terms
    assert_allclose(again.final.beta, found.baseline.beta, rtol=1e-4)  # each is linearised where its search ended
    assert [(d.id, d.reason) for d in again.did_not_hold] == [("quadratic_viscous", "worse_on_held_out")]


def test_report_has_the_keys_of_its_contract(found):
    report = json.loads(json.dumps(result_json(result_of(found)), allow_nan=False))
    assert set(report) >= {"schema", "verdict", "joints", "shared", "seconds"}
    assert report["schema"] == 1
    assert report["verdict"] == "effects_found"
    assert report["shared"] == []
    joint = report["joints"]["joint"]
    wanted = {"baseline", "noise_floor", "error", "effects", "rejected", "indistinguishable", "next_experiment"}
    assert set(joint) >= wanted | {"unexplained"}
    assert set(joint["baseline"]) >= {"effects", "parameters"}
    assert joint["baseline"]["effects"][:2] == ["viscous", "coulomb"]
    assert joint["error"]["unit"] == "A"
    for side in ("before", "after"):
        assert set(joint["error"][side]) == {"train", "heldout", "free_run_heldout"}
        assert joint["error"][side]["free_run_heldout"] is None
    effects = joint["effects"]
    assert set(effects[0]) >= {"id", "parameters", "heldout_gain", "stability"}
    value = effects[0]["parameters"]["quadratic_viscous"]
    assert set(value) >= {"value", "unit", "ci95", "at_bound"}
    assert value["ci95"][0] < value["value"] < value["ci95"][1]
    assert value["at_bound"] is False
    assert all(set(r) >= {"id", "heldout_gain", "why"} and r["why"] for r in joint["rejected"])
    assert set(joint["unexplained"]) >= {"fraction", "structured", "depends_on"}
    assert_allclose(joint["error"]["after"]["heldout"], found.after.heldout)


def test_models_survive_their_files(found, tmp_path):
    texts = models_of(result_of(found), tmp_path)
    for name, text, final in zip(("model_before.yaml", "model_after.yaml"), texts, (False, True), strict=True):
        assert (tmp_path / name).read_text(encoding="utf-8") == text
        again, wanted = load_models(tmp_path / name)["joint"], model_of(found, final=final)
        assert again.drive.kind == wanted.drive.kind
        assert_allclose(again.drive.gain, wanted.drive.gain, rtol=1e-5)
        assert [e.key for e in again.effects] == [e.key for e in wanted.effects]
        for a, b in zip(again.effects, wanted.effects, strict=True):
            for key, x in b.parameters.items():
                assert_allclose(a.parameters[key], x, rtol=1e-4)
    keys = [e.key for e in model_of(found, final=True).effects]
    assert keys == ["rotor_inertia", "viscous", "coulomb", "quadratic_viscous"]
    assert "quadratic_viscous" not in texts[0]


def test_a_model_beside_a_wrong_sensor_is_in_true_torque():
    wrong = Joint(duration=10.0, period=4e-3, inertia=1.2, torque_noise=0.05, sensor=lambda m: 0.25 * m.tau)
    found = diagnose(wrong, only("torque_sensor_gain", *FEW))
    assert [e.id for e in found.effects] == ["torque_sensor_gain"]
    model = model_of(found, final=True)
    values = {e.key: e.parameters for e in model.effects}
    assert_allclose(values["torque_sensor_gain"]["gain_error"], 0.25, rtol=0.02)
    assert_allclose(model.drive.gain, wrong.gain, rtol=0.01)
    assert_allclose(values["viscous"]["viscous"], wrong.viscous, rtol=0.01)
    assert_allclose(values["coulomb"]["coulomb"], wrong.coulomb, rtol=0.02)
    assert values["rotor_inertia"]["rotor_inertia"] == wrong.inertia


def test_servo_side_parameters_use_the_final_stiffness():
    offset = 0.01  # 5 N m at 500 N m/rad: a fit without it takes the servo for much softer
    joint = servo(duration=10.0, period=4e-3, torque_noise=0.05)
    joint = replace(joint, extra=lambda m: -offset / joint.gain * np.ones_like(m.q))
    found = diagnose(joint, only("encoder_offset", *FEW))
    assert [e.id for e in found.effects] == ["encoder_offset"]
    value = found.effects[0].parameters["offset"]
    assert_allclose(value.value, offset, rtol=0.01)
    assert_allclose(found.final.gain, joint.gain, rtol=0.01)


def test_declared_values_are_taken_off_before_the_fit():
    runs = [record(NOISY, "one"), record(NOISY, "two", 0.9, 1), record(NOISY, "held", 2.3, 2)]
    rig = rig_of(NOISY)
    knows = replace(rig, declared={"joint": {**rig.declared["joint"], "quadratic_viscous": 1.2}})
    found = diagnose_joint(runs[:2], runs[2:], knows, "joint", only("quadratic_viscous", "torque_sensor_bias"))
    assert found.verdict == "no_missing_effect"
    assert_allclose(found.final_parameters["viscous"]["viscous"].value, NOISY.viscous, rtol=0.02)
    assert found.before.heldout < 1.5 * found.noise_floor


def test_motion_that_cannot_tell_the_declared_parameters_apart_is_refused():
    run = record(NOISY)
    time = np.arange(2000) * NOISY.period
    flat = {k: v[:2000] for k, v in run.columns.items()}
    flat["joint/position"] = 0.3 * time  # one constant speed: viscous and Coulomb friction are the same column
    runs = [replace(run, time=time, columns=flat, segment=np.zeros(2000, np.int64), name=n) for n in ("a", "b", "c")]
    with pytest.raises(IdentificationError, match="cannot tell"):
        diagnose_joint(runs[:2], runs[2:], rig_of(NOISY), "joint", DiagnosisOptions())


def write(folder, name: str, joints: dict[str, Joint], shift: float, seed: int):
    frame: dict[str, np.ndarray] = {}
    for k, (label, joint) in enumerate(joints.items()):
        run = record(joint, name, shift + 0.2 * k, seed + 10 * k, label)
        frame |= {"time": run.time, **run.columns}
    path = folder / f"{name}.csv"
    pd.DataFrame(frame).to_csv(path, index=False)
    return path


def test_every_joint_of_a_rig_is_diagnosed(tmp_path):
    hip = replace(NOISY, duration=10.0)
    joints = {"hip": hip, "knee": replace(hip, extra=None)}
    rig = tmp_path / "rig.yaml"
    rig.write_text("joints: [hip, knee]\ndrive: current\ndeclared: {rotor_inertia: 0.3}\n")
    one, two, held = (write(tmp_path, n, joints, 0.9 * k, k) for k, n in enumerate(("one", "two", "held")))
    steps: list[str] = []
    result = close_loop(
        rig, [one, two], [held], only("torque_sensor_bias", *FEW), progress=lambda text, share: steps.append(text)
    )
    assert list(result.joints) == ["hip", "knee"]
    assert [e.id for e in result.joints["hip"].effects] == ["quadratic_viscous"]
    assert result.joints["knee"].effects == ()
    assert result.joints["knee"].verdict == "no_missing_effect"
    assert result.verdict == "effects_found"
    assert result.train_files == (str(one), str(two))
    assert result.heldout_files == (str(held),)
    assert result.seconds > 0.0
    assert steps
    assert set(result_json(result)["joints"]) == {"hip", "knee"}


def test_one_run_is_refused(tmp_path):
    rig = tmp_path / "rig.yaml"
    rig.write_text("joint: joint\ndrive: current\n")
    one = write(tmp_path, "one", {"joint": NOISY}, 0.0, 0)
    with pytest.raises(DrakeTcError, match="two"):
        close_loop(rig, [one], [])
