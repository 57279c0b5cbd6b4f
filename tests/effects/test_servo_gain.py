"""A drive gain that is not the declared one: simulated, and found where the fit holds the declared gain."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.diagnosis.data.preparation import build_samples, context_of
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.estimates import estimates
from drake_tc.diagnosis.problem.parameters import physical_parameters
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.effects.library import effect
from drake_tc.errors import RigError
from drake_tc.logs.rig import parse_rig
from drake_tc.logs.rig_writing import rig_document
from drake_tc.loops.joint_bench.recording import record_bench

from .test_identify_back import BENCH, COULOMB, GAIN, INERTIA, VISCOUS, motion

DECLARED = {"rotor_inertia": INERTIA + 0.5 * VISCOUS * BENCH.step}


@pytest.mark.parametrize("drive", ["position_servo", "current"])
def test_the_error_of_a_declared_gain_is_found(drive):
    error, declared = 0.15, GAIN[drive]
    base = (("rotor_inertia", INERTIA), ("viscous", VISCOUS), ("coulomb", COULOMB))
    values = (*(EffectValue(n, {n: x}) for n, x in base), EffectValue("servo_gain", {"gain_error": error}))
    run = record_bench(ActuatorModel("joint", Drive(drive, declared), values), motion(drive, BENCH, 1.0), BENCH)
    rig = parse_rig({"joint": "joint", "drive": drive, "declared": DECLARED, "drive_gain": declared})
    samples = build_samples([run], rig, "joint")
    context = context_of(samples, rig, "joint")
    member = effect("servo_gain")
    assert member.obstacle(context) == ""
    columns = Columns(samples, declared_gain=declared)
    terms = [Term(effect("viscous")), Term(effect("coulomb"))]
    held = fit(columns, terms)
    assert_allclose(held.gain, declared, rtol=1e-9)  # without the effect the drive is held at its declared gain
    freed = fit(columns, [*terms, Term(member, member.shape_grid(context)[0])])
    assert freed.rms < 0.2 * held.rms
    found = physical_parameters(freed)
    assert_allclose(found["servo_gain"]["gain_error"], error, atol=0.005)
    assert_allclose(found["drive"]["gain"], declared, rtol=1e-12)
    estimate = estimates(columns, freed, drive)["servo_gain"]["gain_error"]
    assert estimate.ci95[0] < error < estimate.ci95[1]


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
