"""Simulated legs whose sensors err within their tolerances: nothing of it is named, and intervals hold the truth."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.actuation.model_file import load_models
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.robot.robot import load_robot
from tests.benchmarks.blind_leg.cases import ROBOT, ROUND, leg_case, record_case

DATA_SHEET = {"force": 0.1, "torque": 5e-3, "accel": 0.01, "gyro": 1e-3}
"""Standard deviations of the drawn biases [N, N m, m/s^2, rad/s]; twice and three times that is drawn too."""


def diagnosed(folder, kind, seed, size):
    """A leg with one thing wrong, and sensors with random biases; its truth and the diagnosis from the files."""
    case = leg_case(ROUND.index(kind), seed)
    rng = np.random.default_rng(seed)
    drawn = {name: tuple(map(float, size * t * rng.standard_normal(3))) for name, t in DATA_SHEET.items()}
    suite = replace(case.suite, **{name: replace(getattr(case.suite, name), bias=b) for name, b in drawn.items()})
    record_case(replace(case, suite=suite), folder)
    logs = sorted(folder.glob("run_*.npz"))
    held = [log for log in logs if log.name.startswith("run_held")]
    fit = [log for log in logs if log not in held]
    return case.truth, close_loop(folder / "rig.yaml", fit, held, DiagnosisOptions(assess_residual=False))


def friction_inside(result):
    """Whether the intervals of viscous and Coulomb friction hold the simulated values, joint by joint."""
    known = load_models(load_robot(ROBOT).actuators or "")
    inside = []
    for name, joint in result.joints.items():
        for effect in known[name].effects:
            for parameter, value in effect.parameters.items() if effect.key in ("viscous", "coulomb") else ():
                low, high = joint.final_parameters[effect.key][parameter].ci95
                inside.append(low <= value <= high)
    return inside


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "size"), [(31, 1.0), (32, 3.0)])
def test_biases_within_tolerance_are_not_named(tmp_path, seed, size):
    _, result = diagnosed(tmp_path, "", seed, size)
    assert result.shared == ()
    assert [e.id for joint in result.joints.values() for e in joint.effects] == []
    assert np.mean(friction_inside(result)) >= 0.75  # the joints share the sensors' errors: about two independent draws


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "size"), [(33, 1.0), (34, 2.0)])
def test_a_wrong_mass_is_named_alone_and_its_interval_holds_it(tmp_path, seed, size):
    truth, result = diagnosed(tmp_path, "link_mass", seed, size)
    (cause,) = result.shared
    assert (cause.id, cause.where) == ("link_mass", truth["where"])
    low, high = cause.parameters["mass"].ci95
    assert low <= truth["parameters"]["mass"] <= high
    assert high - low < 0.2 * abs(truth["parameters"]["mass"]) + 0.1  # [kg]; thigh of 3.2, shank of 2.2
    assert [e.id for joint in result.joints.values() for e in joint.effects] == []
