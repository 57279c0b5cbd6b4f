"""Declared values: what a fit holds, what it fits anew, and parameters that an effect does not have."""

import pytest

from drake_tc.diagnosis.problem.declared import declared_terms, known_values
from drake_tc.errors import RigError
from drake_tc.logs.rig import parse_rig


def rig(declared):
    return parse_rig({"joint": "knee", "drive": "current", "declared": declared}, "rig.yaml")


def test_values_of_friction_are_held_and_those_of_drives_are_fitted_anew():
    found = rig({"stribeck": {"stribeck": 2.0}, "deadzone": 0.1, "viscous": 3.0, "rotor_inertia": 0.2})
    assert known_values(found, "knee") == {
        "stribeck": {"stribeck": 2.0, "stribeck_velocity": 0.1, "stribeck_exponent": 2.0}
    }
    assert declared_terms(found, "knee") == ["viscous", "coulomb", "deadzone"]


def test_a_parameter_that_the_effect_does_not_have_is_refused():
    with pytest.raises(RigError, match="stribeck: no parameter 'velocity'; did you mean 'stribeck_velocity'"):
        known_values(rig({"stribeck": {"velocity": 0.1}}), "knee")
