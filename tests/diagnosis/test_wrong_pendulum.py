"""A pendulum whose declared mass is wrong under a drive whose gain is declared, and the reverse."""

from collections.abc import Mapping

import pytest

from drake_tc.diagnosis.joint import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.result.joint_result import JointResult

from . import pendulum_rig

ROTOR = 0.05
SWING = pendulum_rig.Swing(constant=0.0, duration=12.0, period=4e-3, effort_noise=1e-3)


def diagnose(*, share: float = 0.0, gain_error: float = 0.0, rotor: float = ROTOR, **keys: object) -> JointResult:
    """The true load is (1 + share) times the declared one, the true 1/K (1 + gain_error) times the declared one."""
    length = 0.25
    mass = SWING.moment / (9.81 * length * (1.0 + share))
    inertia = (SWING.inertia - ROTOR) / (1.0 + share)
    load = {"mass": mass, "length": length, "inertia": inertia, "zero": SWING.zero}
    more = {"drive_gain": SWING.gain * (1.0 + gain_error), "declared": {"rotor_inertia": rotor}} | keys
    rig = pendulum_rig.rig_of(SWING, {"pendulum": load}, **more)
    runs = [pendulum_rig.record(SWING, f"run{k}", k, 0.37 * k) for k in range(3)]
    return diagnose_joint(runs[:2], runs[2:], rig, pendulum_rig.JOINT, DiagnosisOptions(assess_residual=False))


def holds(found: Mapping[str, Estimate], name: str, truth: float, room: float = 0.01) -> None:
    """The interval, widened by a share of the truth for what the filters leave, has the truth."""
    low, high = found[name].ci95
    assert low - room * abs(truth) <= truth <= high + room * abs(truth), (name, truth, found[name])


@pytest.mark.parametrize("share", [-0.2, 0.3])
def test_a_declared_gain_is_held_and_the_load_is_found_wrong(share: float) -> None:
    result = diagnose(share=share)
    assert [e.id for e in result.effects] == ["payload"]
    found = result.final_parameters
    assert found["drive"]["gain"].value == pytest.approx(SWING.gain, rel=1e-9)
    holds(result.effects[0].parameters, "payload_share", share)
    holds(found["viscous"], "viscous", SWING.viscous)
    holds(found["coulomb"], "coulomb", SWING.coulomb)


def test_a_declared_gain_that_is_wrong_is_told_from_a_wrong_load() -> None:
    result = diagnose(gain_error=0.25)
    assert [e.id for e in result.effects] == ["servo_gain"]
    holds(result.effects[0].parameters, "gain_error", 0.25)


def test_a_wrong_inertia_is_not_told_as_a_wrong_gain_and_a_wrong_load_together() -> None:
    named = {e.id for e in diagnose(rotor=0.6 * ROTOR).effects}
    assert not {"servo_gain", "payload"} <= named
