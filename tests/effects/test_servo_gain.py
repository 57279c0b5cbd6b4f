"""A drive gain that is not the declared one: simulated, and found where the fit holds the declared gain."""

import numpy as np
import pytest
from drake_tc.diagrams.joint_bench import record_bench
from numpy.testing import assert_allclose

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.diagnosis.columns import Columns, Term
from drake_tc.diagnosis.preparation import build_samples, context_of
from drake_tc.diagnosis.regression import fit
from drake_tc.effects.library import effect
from drake_tc.effects.servo_gain import gain_error
from drake_tc.errors import RigError
from drake_tc.logs.rig import parse_rig, rig_document
from tests.effects.test_identify_back import BENCH, COULOMB, GAIN, INERTIA, VISCOUS, motion

DECLARED = {"rotor_inertia": INERTIA + 0.5 * VISCOUS * BENCH.step}


@pytest.mark.parametrize("drive", ["position_servo", "current"])
def test_the_error_of_a_declared_gain_is_found(drive):
    error, declared = 0.15, GAIN[drive]
    base = (("rotor_inertia", INERTIA), ("viscous", VISCOUS), ("coulomb", COULOMB))
    values = (*(EffectValue(n, {n: x}) for n, x in base), EffectValue("servo_gain", {"gain_error": error}))
    run = record_bench(ActuatorModel("joint", Drive(drive, declared), values), motion(drive, BENCH, 1.0), BENCH)
    rig = parse_rig({"joint": "joint", "drive": drive, "declared": DECLARED, "drive_gain": declared})
    samples = build_samples([run], rig, "joint")
    member = effect("servo_gain")
    assert member.obstacle(context_of(samples, rig, "joint")) == ""
    columns = Columns(samples)
    terms = [Term(effect("viscous")), Term(effect("coulomb"))]
    free = fit(columns, terms)
    assert_allclose(gain_error(free.gain, (free.gain, free.gain), declared)[0], error, atol=0.005)
    design = np.column_stack([-columns.of(Term(member)), columns.design(terms)[:, 1:]])
    held = columns.target - columns.effort(terms) / declared  # the drive is held at its declared gain
    theta = np.linalg.lstsq(design, held, rcond=None)[0]
    assert_allclose(member.physical(theta[:1], {}, declared)["gain_error"], error, atol=0.005)


def test_the_interval_of_the_error_follows_that_of_the_gain():
    value, (low, high) = gain_error(0.08, (0.07, 0.1), 0.09)
    assert_allclose([value, low, high], [0.125, -0.1, 0.09 / 0.07 - 1.0])


def test_compensation_undoes_the_error():
    asked = effect("servo_gain").inverse(np.array([2.3]), np.array([1.0]), {"gain_error": 0.15})
    kernel = effect("servo_gain").kernel({"gain_error": 0.15}, 1e-3)
    assert_allclose(kernel.step(asked[0], asked[0], 1.0, [], 0), 2.3)


def test_a_rig_file_declares_the_gain_of_a_drive():
    document = {"joints": ["hip", "knee"], "drive": "current", "drive_gain": {"knee": 0.08}}
    rig = parse_rig(document)
    assert rig.drive_gain == {"knee": 0.08}
    assert parse_rig(rig_document(rig)).drive_gain == {"knee": 0.08}
    with pytest.raises(RigError, match="drive_gain: wanted a positive number"):
        parse_rig(document | {"drive_gain": -1.0})
    with pytest.raises(RigError, match="'ankle' is not a joint"):
        parse_rig(document | {"drive_gain": {"ankle": 1.0}})
