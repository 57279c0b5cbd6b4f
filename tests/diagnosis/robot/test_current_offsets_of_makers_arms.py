"""Simulated arms of several makers whose currents have zeros within their data sheet: quiet, and still right."""

import json

import numpy as np
import pytest
import yaml

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from tests.benchmarks.blind_arm.arms import ARMS
from tests.benchmarks.blind_arm.cases import record_case, sound_case
from tests.benchmarks.interval_coverage import final_parameters, friction_intervals

SEED = 940
OF_RATED = 0.01
"""Tolerance of each current's zero, over the current that makes the joint's rated torque."""


@pytest.mark.slow
@pytest.mark.parametrize("arm", ARMS, ids=lambda arm: arm.name)
def test_offsets_of_currents_within_tolerance_are_not_named_and_friction_is_right(arm, tmp_path):
    """All zeros are off, each by a draw from its tolerance; without a tolerance several joints would have an effect."""
    case = sound_case(arm, SEED)
    truth = record_case(case, tmp_path)
    rng = np.random.default_rng([SEED, ARMS.index(arm)])
    size = {j: OF_RATED * rated * case.joints[j].gain for j, rated in zip(arm.joints, arm.effort, strict=True)}
    offset = {joint: tolerance * rng.standard_normal() for joint, tolerance in size.items()}
    runs = sorted(tmp_path.glob("run_*.npz"))
    for path in runs:
        with np.load(path) as log:
            columns = dict(log)
        np.savez(path, **columns | {f"{j}/current": columns[f"{j}/current"] + by for j, by in offset.items()})
    rig = yaml.safe_load((tmp_path / "rig.yaml").read_text())
    rig["sensors"] = {joint: {"current": {"bias": float(tolerance)}} for joint, tolerance in size.items()}
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig))
    held = [path for path in runs if "held" in path.name]
    result = close_loop(tmp_path / "rig.yaml", [path for path in runs if path not in held], held, DiagnosisOptions())
    assert {j: [e.id for e in found.effects] for j, found in result.joints.items()} == {j: [] for j in arm.joints}
    assert not result.shared
    inside = friction_intervals(truth, json.loads(json.dumps({"final_parameters": final_parameters(result)})))
    assert len(inside) == 2 * len(arm.joints)
    assert sum(inside) >= len(inside) - 2
