"""A drive gain that is not the declared one: simulated, and found where the fit holds the declared gain."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.parameters import physical_parameters
from drake_tc.effects.library import effect
from drake_tc.errors import RigError
from drake_tc.logs.rig import parse_rig, rig_document

from .test_identify_back import GAIN
from .test_told_apart import diagnosed


def test_a_right_declared_gain_is_held_and_nothing_is_missing(drive="position_servo"):
    found = diagnosed(drive, {}, ["servo_gain"], drive_gain=GAIN[drive])
    assert found.effects == ()
    assert_allclose(found.final_parameters["drive"]["gain"].value, GAIN[drive], rtol=1e-6)


def test_the_error_of_a_declared_gain_is_found(drive="current"):
    found = diagnosed(drive, {"servo_gain": {"gain_error": 0.15}}, ["servo_gain"], drive_gain=GAIN[drive])
    (named,) = found.effects
    assert named.id == "servo_gain"
    low, high = named.parameters["gain_error"].ci95
    assert low < 0.15 < high and high - low < 0.01
    assert_allclose(found.final_parameters["drive"]["gain"].value, GAIN[drive], rtol=1e-6)
    assert found.after.heldout < 0.2 * found.before.heldout


def test_beside_an_error_of_the_torque_sensor_the_declared_gain_stays_the_declared_one():
    """(1 + g) times the balance: what the sensor shows, tau + g tau, with y (1 + e)/K_0 = tau + J qddot + F_v qdot."""
    error, sensor, declared, viscous = 0.15, 0.08, 0.02, 6.0
    terms = (
        Term(effect("viscous")),
        Term(effect("torque_sensor_gain")),
        Term(effect("servo_gain"), {"declared_gain": declared}),
    )
    beta = np.array([(1.0 + sensor) * (1.0 + error) / declared, (1.0 + sensor) * viscous, sensor])
    found = physical_parameters(SimpleNamespace(terms=terms, beta=beta))
    assert_allclose(found["drive"]["gain"], declared, rtol=1e-12)
    assert_allclose(found["servo_gain"]["gain_error"], error, rtol=1e-12)
    assert_allclose(found["torque_sensor_gain"]["gain_error"], sensor, rtol=1e-12)
    assert_allclose(found["viscous"]["viscous"], viscous, rtol=1e-12)


def test_compensation_undoes_the_error():
    asked = effect("servo_gain").inverse(np.array([2.3]), np.array([0.0]), np.array([1.0]), {"gain_error": 0.15})
    kernel = effect("servo_gain").kernel({"gain_error": 0.15}, 1e-3)
    assert_allclose(kernel.step(asked[0], asked[0], 1.0, [], 0), 2.3)


def test_a_rig_file_declares_the_gain_of_a_drive():
    document = {"joints": ["hip", "knee"], "drive": "current", "drive_gain": {"knee": 0.08}}
    rig = parse_rig(document)
    assert rig.drive_gain == {"knee": 0.08}
    assert parse_rig(rig_document(rig)).drive_gain == {"knee": 0.08}
    with pytest.raises(RigError, match="drive_gain: expected a positive number"):
        parse_rig(document | {"drive_gain": -1.0})
    with pytest.raises(RigError, match="'ankle' is not a joint"):
        parse_rig(document | {"drive_gain": {"ankle": 1.0}})
