"""Declared values: what a fit holds, what it fits anew, and parameters that an effect does not have."""

from types import SimpleNamespace

import pytest

from drake_tc.diagnosis.problem import declared
from drake_tc.diagnosis.problem.declared import declared_terms, fit_declared, known_values
from drake_tc.effects.context import Context
from drake_tc.errors import RigError
from drake_tc.logs.rig import parse_rig


def rig(entered, joint_type="revolute"):
    entries = {"joint": "knee", "joint_type": joint_type, "drive": "current", "declared": entered}
    return parse_rig(entries, "rig.yaml")


def test_values_of_friction_are_held_and_those_of_drives_are_fitted_anew():
    found = rig({"stribeck": {"stribeck": 2.0}, "deadzone": 0.1, "viscous": 3.0, "rotor_inertia": 0.2})
    assert known_values(found, "knee") == {
        "stribeck": {"stribeck": 2.0, "stribeck_velocity": 0.1, "stribeck_exponent": 2.0}
    }
    assert declared_terms(found, "knee") == ["viscous", "coulomb", "deadzone"]


def test_a_parameter_that_the_effect_does_not_have_is_refused():
    with pytest.raises(RigError, match="stribeck: no parameter 'velocity'; did you mean 'stribeck_velocity'"):
        known_values(rig({"stribeck": {"velocity": 0.1}}), "knee")


def test_a_prismatic_joint_has_the_forms_of_its_type():
    """A payload that slides has a weight and a mass, not the moment of a pendulum."""
    found = rig({"payload": {"payload_mass": 12.0, "payload_weight": 40.0}, "presliding_hysteresis": None}, "prismatic")
    assert known_values(found, "knee") == {"payload.sliding": {"payload_weight": 40.0, "payload_mass": 12.0}}
    assert declared_terms(found, "knee") == ["viscous", "coulomb", "presliding_hysteresis.sliding"]
    with pytest.raises(RigError, match=r"payload.*: no parameter 'payload_moment'"):
        known_values(rig({"payload": {"payload_moment": 3.0}}, "prismatic"), "knee")


def test_an_effect_of_revolute_joints_is_refused_for_a_prismatic_one():
    said = "declared: load_tilt: knee is prismatic, and only revolute joints have this effect; leave it out"
    with pytest.raises(RigError, match=said):
        declared_terms(rig({"load_tilt": None}, "prismatic"), "knee")
    assert declared_terms(rig({"load_tilt": None}), "knee") == ["viscous", "coulomb", "load_tilt"]


@pytest.mark.parametrize("load", ["torque", "links"])
def test_the_declared_value_of_a_drive_effect_is_tried(monkeypatch, load):
    """A command that winds up to 160 A leaves a declared limit of 0.7 A outside the grid of limits."""
    tried = []

    def fit(columns, terms):
        limits = [dict(t.shape)["limit"] for t in terms if t.effect.id == "saturation"]
        tried.extend(limits)
        return SimpleNamespace(terms=terms, cv_rms=min((abs(limit - 0.7) for limit in limits), default=1.0))

    monkeypatch.setattr(declared, "fit", fit)
    context = Context("current", load, frozenset(), declared={"saturation": 0.7}, effort_span=(-160.0, 160.0))
    best = fit_declared(None, ["saturation"], context)
    assert [dict(t.shape) for t in best.terms if t.effect.id == "saturation"] == [{"limit": 0.7}]
    assert (len(tried) == 1) == (load == "links")
