"""Declared tolerances of a joint's sensors: sizes within them are not found, larger ones are, and the check says so."""

import numpy as np

from drake_tc.cli.demo import ROTOR_INERTIA
from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.effects.library import effect
from drake_tc.experiments.check.effects import joint_effects
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import Rig, load_rig, parse_rig
from tests.diagnosis.rigs import Joint, record

BIAS = 0.5  # [N m]: tolerance
SAME = tuple(map(effect, ("torque_sensor_bias", "effort_bias", "asymmetric_friction")))
"""One function of such a joint."""


def with_tolerance(demo, bias: float):
    rig = load_rig(demo[0])
    content = {"joint": rig.joints[0], "drive": "position_servo", "declared": {"rotor_inertia": ROTOR_INERTIA}}
    allowed = parse_rig(content | {"sensors": {"torque": {"bias": f"{bias} N*m"}}})
    return prepare_joint(load_runs(demo[1], allowed), [], allowed, rig.joints[0])


def visible(checked):
    return next(v for v in checked.effects if v.key == "torque_sensor_bias")


def test_a_tolerance_hides_sizes_far_beyond_it(demo, checked):
    assert visible(checked).smallest < BIAS
    assert visible(joint_effects(with_tolerance(demo, BIAS), SAME)).smallest > 4.0 * BIAS


def test_the_reason_is_the_tolerance_where_that_hides_the_effect(demo):
    found = visible(joint_effects(with_tolerance(demo, 50.0), SAME))
    assert found.status == "not_seen"
    assert found.reason.endswith("may be errors of the joint's sensors within their tolerances.")


def told(size: float) -> set[str]:
    """What a diagnosis names where the torque sensor reads this much too high, its tolerance being `BIAS`."""
    joint = Joint(duration=8.0, period=4e-3, torque_noise=0.25, sensor=lambda m: np.full_like(m.q, size))
    runs = [record(joint, name, 0.9 * k, k) for k, name in enumerate(("one", "two", "held"))]
    options = DiagnosisOptions(effects=SAME, assess_residual=False)
    return {e.id for e in diagnose_joint(runs[:2], runs[2:], rig_with_tolerance(joint), "joint", options).effects}


def rig_with_tolerance(joint: Joint) -> Rig:
    document = {"joint": "joint", "drive": joint.drive, "declared": {"rotor_inertia": joint.inertia}}
    return parse_rig(document | {"sensors": {"torque": {"bias": f"{BIAS} N*m"}}})


def test_a_diagnosis_names_no_bias_within_the_tolerance():
    assert not told(2.5 * BIAS)


def test_a_diagnosis_names_a_bias_far_beyond_the_tolerance():
    assert told(20.0 * BIAS)
