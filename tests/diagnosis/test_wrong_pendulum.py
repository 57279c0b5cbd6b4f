"""A pendulum whose declared mass is wrong under a drive whose gain is declared, and the reverse."""

from collections.abc import Mapping

import pytest

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.effects.library import effect

from . import pendulum_rig

ROTOR = 0.05
LENGTH = 0.25
SWING = pendulum_rig.Swing(constant=0.0, duration=12.0, period=4e-3, effort_noise=1e-3)
NEAR = DiagnosisOptions(
    effects=tuple(
        map(
            effect,
            (
                *("payload.pendulum", "payload.own_arm", "payload.declared_gain", "servo_gain"),
                *("rotor_inertia", "cable_spring", "load_tilt", "load_dependent_friction"),
            ),
        )
    ),
    assess_residual=False,
)


def diagnose_payload(arm: float, moment: float, *, gain_declared: bool) -> tuple[JointResult, float]:
    """A point mass of this moment at `arm` beside the declared pendulum; and the least moment of that ratio."""
    own, own_inertia = SWING.moment - moment, SWING.inertia - ROTOR - moment * arm / 9.81
    load = {"mass": own / (9.81 * LENGTH), "length": LENGTH, "inertia": own_inertia, "zero": SWING.zero}
    more = {} if gain_declared else {"drive_gain": None}
    rig = pendulum_rig.rig_of(SWING, {"pendulum": load}, declared={"rotor_inertia": ROTOR}, **more)
    runs = [pendulum_rig.record(SWING, f"run{k}", k, 0.37 * k) for k in range(3)]
    result = diagnose_joint(runs[:2], runs[2:], rig, pendulum_rig.JOINT, NEAR)
    return result, (ROTOR + own_inertia) * SWING.moment / SWING.inertia - own


@pytest.mark.parametrize("arm", [0.3])
def test_a_payload_with_an_arm_of_its_own_is_found_with_the_least_moment_that_explains_it(arm: float) -> None:
    """Near the axis it takes away more of the ratio of inertia to moment than any mass at the pendulum's end."""
    result, least = diagnose_payload(arm * LENGTH, 0.35 * SWING.moment, gain_declared=False)
    assert [e.key for e in result.effects] == ["payload.pendulum"]
    holds(result.effects[0].parameters, "payload_moment", least)


@pytest.mark.parametrize("arm", [0.3])
def test_under_a_declared_gain_the_payloads_moment_and_its_arm_are_found(arm: float) -> None:
    moment = 0.35 * SWING.moment
    result, _ = diagnose_payload(arm * LENGTH, moment, gain_declared=True)
    assert [e.key for e in result.effects] == ["payload.own_arm"]
    found = result.effects[0].parameters
    holds(found, "payload_moment", moment)
    low, high = found["payload_inertia"].ci95
    room = 0.01 * SWING.inertia
    assert low - room <= moment * arm * LENGTH / 9.81 <= high + room


def holds(found: Mapping[str, Estimate], name: str, truth: float, room: float = 0.01) -> None:
    """The interval, widened by a share of the truth for what the filters leave, has the truth."""
    low, high = found[name].ci95
    assert low - room * abs(truth) <= truth <= high + room * abs(truth), (name, truth, found[name])
