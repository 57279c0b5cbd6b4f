"""The side on which the teeth of a servo's gear touch: what the column of backlash follows, and what it does not."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.diagnose import diagnose_joint, joint_model
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.split import without_sensor_errors
from drake_tc.effects.backlash import Backlash
from drake_tc.effects.base import plain_signals
from drake_tc.effects.encoder_offset import EncoderOffset
from drake_tc.effects.torque_sensor_bias import TorqueSensorBias
from tests.diagnosis.rigs import Joint, Motion, record, rig_of

SERVO = Joint(drive="position_servo", gain=1e-3, encoder_noise=3e-3, torque_noise=0.1)
"""The noise of its effort is a quarter of the effort."""
GAP = 4e-3


def named(joint: Joint) -> dict[str, float]:
    """Backlash that is found, and the drive gain over the true one."""
    train = [record(joint, f"run{k}", 0.4 * k, seed=k) for k in range(3)]
    options = DiagnosisOptions(effects=(Backlash(),), assess_residual=False)
    result = diagnose_joint(train, [record(joint, "held", 2.1, seed=9)], rig_of(joint), "joint", options)
    found = {f.id: f.parameters["backlash"].value for f in result.effects}
    return found | {"gain": result.final_parameters["drive"]["gain"].value / joint.gain}


def test_the_side_is_not_that_of_the_effort_s_noise() -> None:
    """Where the load is small, the sign of a torque that is computed from the effort is that of the effort's noise."""
    joint = replace(SERVO, torque_noise=0.01)
    train = [record(joint, f"run{k}", 0.4 * k, seed=k) for k in range(3)]
    model = joint_model(prepare_joint(train, [record(joint, "held", 2.1, seed=9)], rig_of(joint), "joint"))
    columns = np.concatenate([b.values for b in model.blocks(model.train, model.declared)], axis=1)
    noise = model.train.recorded.effort(()) - columns @ (joint.gain * np.array([1.0, joint.viscous, joint.coulomb]))
    side = model.train.of(Term(Backlash(), {}))[:, 0]
    small = np.abs(model.train.recorded.target) < 1.5 * np.std(noise) / joint.gain
    assert np.count_nonzero(small) > 100
    assert abs(np.corrcoef(side[small], noise[small])[0, 1]) < 0.15


def test_backlash_beside_that_noise_is_found() -> None:
    """q_d - q holds half the gap on the side of the load; as torque, that is over the gain."""

    def gap(m: Motion) -> np.ndarray:
        return 0.5 * GAP * np.sign(m.tau) / SERVO.gain

    found = named(replace(SERVO, extra=gap))
    assert found["backlash"] == pytest.approx(GAP, rel=0.1)
    assert found["gain"] == pytest.approx(1.0, abs=0.02)


def test_the_load_of_the_column_is_without_errors_of_sensors() -> None:
    q = np.linspace(-1.0, 1.0, 21)
    signals = plain_signals(q.size, {"position": q, "load_torque": 3.0 * q + 0.4, "load_slope": np.full(q.size, 3.0)})
    terms = [Term(TorqueSensorBias(), {}), Term(EncoderOffset(), {})]
    told = without_sensor_errors(signals, terms, np.array([1.0, 0.4, 0.05]))
    np.testing.assert_allclose(told, 3.0 * (q - 0.05), atol=1e-12)
