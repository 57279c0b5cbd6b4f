"""`bench robot` with a few cases, found from files alone; the scoring; what the simulated leg does."""

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.model_file import load_models
from drake_tc.robot.robot import load_robot
from drake_tc.sensing.suite import SensorSuiteSpec
from tests.benchmarks.blind_leg.cases import DECLARED, ROBOT, ROUND, leg_case, zeroed_suite
from tests.benchmarks.blind_leg.recorder import Wrong, random_motion, record_leg
from tests.benchmarks.robot_rigs import SHARED, robot_benchmark, score_report, summary_rows

TIE = [{"id": "link_com", "where": "thigh"}]


def report(shared=(), joints=None):
    return {"shared": list(shared), "joints": joints or {}}


def found(name, where, ties=(), gain=0.5):
    return {"id": name, "where": where, "indistinguishable": list(ties), "heldout_gain": gain, "parameters": {}}


def own(*effects, pairs=()):
    return {
        "effects": [{"id": i, "heldout_gain": g, "parameters": {}} for i, g in effects],
        "indistinguishable": list(pairs),
    }


@pytest.mark.parametrize(
    ("truth", "entry", "first", "exact"),
    [
        (("", ""), report(), True, True),
        (("", ""), report(joints={"knee": own(("stribeck", 0.2))}), False, False),
        (("", ""), {"error": "no", **report()}, False, False),
        (("link_com", "thigh"), report([found("link_mass", "thigh", TIE)]), True, True),
        (("link_com", "shank"), report([found("link_mass", "thigh", TIE)]), False, False),
        (("stribeck", "knee"), report(joints={"knee": own(("stribeck", 0.2))}), True, True),
        (
            ("stribeck", "knee"),
            report(joints={"knee": own(("stribeck", 0.4)), "hip": own(("delay", 0.1))}),
            True,
            False,
        ),
        (("delay", "knee"), report(joints={"knee": own(("lag", 0.4), pairs=[["lag", "delay"]])}), True, True),
        (
            ("stribeck", "knee"),
            report([found("ft_bias", "a", gain=0.95)], {"knee": own(("stribeck", 0.9))}),
            False,
            False,
        ),
    ],
)
def test_scoring(truth, entry, first, exact):
    score = score_report("case", {"id": truth[0], "where": truth[1]}, entry)
    assert (score.first, score.exact) == (first, exact)


def test_a_round_holds_every_kind_and_draws_differ():
    cases = [leg_case(number, 3) for number in range(2 * len(ROUND))]
    assert {case.truth["id"] for case in cases} == set(ROUND)
    assert len({case.name for case in cases}) == len(cases)
    assert cases[0].truth == leg_case(0, 3).truth
    assert cases[0].truth != leg_case(0, 4).truth
    for case in cases:
        changed = [j for j, m in case.models.items() if {e.key for e in m.effects} != set(DECLARED)]
        joint_has = case.truth["id"] and case.truth["id"] not in SHARED
        assert changed == ([case.truth["where"]] if joint_has else [])


@pytest.fixture(scope="module")
def leg():
    robot = load_robot(ROBOT)
    return robot, load_models(robot.actuators)


def test_wrong_links_weigh_on_the_resting_leg_as_statics_says(leg):
    robot, models = leg
    still = random_motion(np.random.default_rng(0), robot, 0.0, robot.posture)
    runs = [
        record_leg(robot, models, SensorSuiteSpec.perfect(), "rest", still, 0.2, wrong)["joint_torque"][-1]
        for wrong in (None, Wrong(mass={"r_shank": 0.5}), Wrong(com={"r_shank": (0.02, 0.0, 0.0)}))
    ]
    knee = robot.joints.index("r_knee")
    pitch = float(robot.posture[knee] + robot.posture[robot.joints.index("r_hip_pitch")])
    x, z = 0.01, -0.14  # centre of mass of the shank in its own axes
    # torque about +y of a weight m g at (x, z) in axes pitched by `pitch`; the motor bears it
    lever = np.cos(pitch) * x + np.sin(pitch) * z
    assert_allclose(runs[1][knee] - runs[0][knee], -0.5 * 9.81 * lever, atol=0.02)  # the servo has not quite settled
    assert_allclose(runs[2][knee] - runs[0][knee], -2.2 * 9.81 * 0.02 * np.cos(pitch), atol=0.02)


def test_the_base_swings_and_the_foot_is_borne(leg):
    robot, models = leg
    rng = np.random.default_rng(1)
    swing = record_leg(robot, models, zeroed_suite(), "swing", random_motion(rng, robot, 0.1, robot.posture), 0.6)
    assert np.abs(swing["imu"][:, :2]).max() > 0.3  # rad/s
    ground = record_leg(robot, models, zeroed_suite(), "ground", random_motion(rng, robot, 0.03, robot.posture), 0.5)
    assert ground["force_torque"][100:, 2].min() > 20.0  # N, besides the foot's weight of -9.8 N


@pytest.mark.slow
def test_one_round_is_named_rightly(tmp_path):
    wanted = [number for number, name in enumerate(ROUND) if name in ("deadzone", "ft_bias", "link_mass", "")][:4]
    with ThreadPoolExecutor(1) as pool:
        scores = robot_benchmark(tmp_path, wanted, 11, pool, lambda text, share: None)
    assert [s.name for s in scores if not s.first] == []
    rows = {row.name: row for row in summary_rows(scores)}
    assert rows["right place and effect first"].value == 1.0
    assert rows["nulls quiet"].value == 1.0
    text = (tmp_path / "rigs" / scores[0].name / "rig.yaml").read_text(encoding="utf-8")
    assert "deadzone" not in text  # the truth stands in no file that the diagnosis reads
    assert json.loads((tmp_path / "seed.json").read_text(encoding="utf-8")) == 11
