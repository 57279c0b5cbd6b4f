"""A linear axis with a ball screw, simulated here: what close-loop, check and design say of it, and in which units."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from few_effects import experiments_fit

from drake_tc.actuation.model_file import load_models
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.effects.library import effect
from drake_tc.experiments.check.run import check_page, check_rig
from drake_tc.experiments.design.known import joint_from_logs
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig
from drake_tc.report.data_files import result_json
from drake_tc.report.html import render

GAIN, COULOMB, VISCOUS, CARRIAGE, SCREW = 1 / 95.0, 25.0, 60.0, 12.0, 18.0
"""[A/N], [N], [N s/m], mass before the force sensor and reflected mass of rotor and screw [kg]."""
WEIGHT, STIFFNESS, RIPPLE, LEAD = CARRIAGE * 9.81, 250.0, 6.0, 0.010
TURNING = re.compile(r"\brad\b|N·m|N\*m|kg·m|kg\*m|\bN m\b")
PERIOD = 8e-3


def write(path, frequencies, amplitude, seed, spring=0.0, ripple=0.0, sensor=True):
    """A run of 16 s in which the axis follows sinusoids exactly; the current is what the balance asks for."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, 16.0, PERIOD)
    q, v, a = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    for w in 2 * np.pi * np.array(frequencies):
        phase = rng.uniform(0, 6)
        q += amplitude * np.sin(w * t + phase)
        v += amplitude * w * np.cos(w * t + phase)
        a -= amplitude * w**2 * np.sin(w * t + phase)
    load = CARRIAGE * a + WEIGHT
    force = load + SCREW * a + COULOMB * np.sign(v) + VISCOUS * v + spring * q + ripple * np.sin(2 * np.pi * q / LEAD)
    columns = {
        "time": t,
        "z/position": np.round(q / 5e-6) * 5e-6,
        "z/current": GAIN * force + rng.normal(0, 4e-3, t.size),
    }
    if sensor:
        columns["z/torque"] = load + rng.normal(0, 0.5, t.size)
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return path


def logs(folder, **missing):
    runs = (([0.13, 0.31], 0.05, 1), ([0.4, 0.9], 0.02, 2), ([0.2, 0.6], 0.04, 3))
    return [write(folder / f"run{k}.csv", f, a, seed, **missing) for k, (f, a, seed) in enumerate(runs)]


def looking_for(*keys):
    return DiagnosisOptions(effects=tuple(map(effect, keys)))


def diagnosed(folder, rig, options, **missing):
    *train, held = logs(folder, **missing)
    path = folder / "rig.yaml"
    path.write_text(rig)
    return close_loop(path, train, [held], options)


MEASURED = "{joint: z, joint_type: prismatic, drive: current, load: torque, declared: {rotor_inertia: 18.0}}"
UNKNOWN = "{joint: z, joint_type: prismatic, drive: current, load: unknown, drive_gain: 0.0105263}"
NEAR = ("cable_spring", "cable_spring.beside_weight", "payload.sliding", "quadratic_viscous", "asymmetric_friction")
"""The spring and what may resemble it."""


@pytest.fixture(scope="module")
def rippled(tmp_path_factory):
    return diagnosed(tmp_path_factory.mktemp("ripple"), MEASURED, looking_for("torque_ripple", *NEAR), ripple=RIPPLE)


def test_the_ripple_of_the_screw_is_found_with_its_lead(rippled):
    joint = rippled.joints["z"]
    assert [e.id for e in joint.effects] == ["torque_ripple"]
    found = joint.effects[0].parameters
    assert 2 * np.pi / found["cycles_per_turn"].value == pytest.approx(LEAD, rel=1e-3)
    assert found["ripple_sine"].value == pytest.approx(RIPPLE, rel=0.05)
    assert (found["ripple_sine"].unit, found["cycles_per_turn"].unit) == ("N", "rad/m")
    assert joint.final_parameters["coulomb"]["coulomb"].value == pytest.approx(COULOMB, rel=0.02)


def test_the_reports_have_no_unit_of_a_joint_that_turns(rippled):
    page = re.sub(r"<(script|style)[^>]*>.*?</\1>", "", render(rippled), flags=re.DOTALL)
    texts = re.sub(r"<[^>]+>", " ", page).replace("rad/m", "")
    assert TURNING.findall(texts) == []
    assert "after, as force" in texts and "errors as force" in texts and "over the angle" not in texts
    document = json.dumps(result_json(rippled), ensure_ascii=False).replace("rad/m", "")
    assert TURNING.findall(document) == []


def test_the_model_file_says_that_the_joint_slides(rippled, tmp_path):
    from drake_tc.diagnosis.result.models import models_of

    models_of(rippled, tmp_path)
    assert load_models(tmp_path / "model_after.yaml")["z"].joint_type == "prismatic"


def test_an_unknown_load_is_a_mass_and_a_constant_force_and_a_spring_is_found_beside_it(tmp_path):
    quick = replace(looking_for(*NEAR), assess_residual=False)
    joint = diagnosed(tmp_path, UNKNOWN, quick, spring=STIFFNESS, sensor=False).joints["z"]
    title, load = joint.load
    assert title == "unknown load: mass and constant force"
    assert load["inertia"].value == pytest.approx(CARRIAGE + SCREW, rel=0.02)
    assert load["constant"].value == pytest.approx(WEIGHT, rel=0.02)
    assert (load["inertia"].unit, load["constant"].unit) == ("kg", "N")
    assert [e.id for e in joint.effects] == ["cable_spring"]
    assert joint.effects[0].parameters["spring_stiffness"].value == pytest.approx(STIFFNESS, rel=0.03)
    assert joint.effects[0].parameters["spring_stiffness"].unit == "N/m"


def test_check_and_design_know_a_sliding_mass(tmp_path, monkeypatch):
    experiments_fit(monkeypatch, "stribeck", "torque_ripple")
    *train, _ = logs(tmp_path)
    path = tmp_path / "rig.yaml"
    path.write_text(MEASURED)
    found = check_rig(path, train)
    page = re.sub(r"<(script|style)[^>]*>.*?</\1>", "", check_page(found), flags=re.DOTALL)
    assert TURNING.findall(re.sub(r"<[^>]+>", " ", page).replace("rad/m", "")) == []
    assert "A mass of 12 kg and a constant force of 118 N" in page
    rig = load_rig(path)
    joint, limits, _ = joint_from_logs(rig, load_runs(train, rig), "z")
    assert (joint.link_inertia, joint.gravity) == (pytest.approx(CARRIAGE, rel=0.01), 0.0)
    assert joint.constant == pytest.approx(WEIGHT, rel=0.01)
    assert limits.units.position == "m"
