"""`bench arms --known-links`: what the simulated arms do, what their files say, how reports are scored."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.testing import assert_allclose
from optional import skip_without_robots
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot
from tests.benchmarks.arm_rigs import known_arm_benchmark
from tests.benchmarks.blind_arm.arms import Body, arm_named, attach, moving_links
from tests.benchmarks.blind_arm.known_links import (
    KNOWN_ROUND,
    known_case,
    named_set_up,
    record_known_case,
)


def weights(plant, context, q):
    """(n,) torques that hold the arm still."""
    plant.SetPositions(context, q)
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    return plant.CalcInverseDynamics(context, 0.0 * q, forces)


def test_what_a_link_carries_hangs_at_its_place(tmp_path):
    """The weight's moment about each joint, by the Jacobian of its centre: J' m g."""
    skip_without_robots()
    (tmp_path / "arm.yaml").write_text(arm_named("panda").robot_file(), encoding="utf-8")
    robot = load_robot(tmp_path / "arm.yaml")
    plant = make_plant(robot, 0.0)
    context = plant.CreateDefaultContext()
    link = moving_links(plant, robot)[-1]
    centre, q = np.array([0.03, -0.05, 0.12]), np.random.default_rng(1).uniform(-1.0, 1.0, 7)
    empty = weights(plant, context, q)
    attach(plant, context, link, Body(0.9, centre, 0.04))
    loaded = weights(plant, context, q)
    jacobian = plant.CalcJacobianTranslationalVelocity(
        context,
        JacobianWrtVariable.kV,
        plant.GetFrameByName(link),
        centre,
        plant.world_frame(),
        plant.world_frame(),
    )
    gravity = plant.gravity_field().gravity_vector()
    assert_allclose(loaded - empty, -jacobian.T @ (0.9 * gravity), atol=1e-9)  # torques of some N m


def test_a_record_has_the_wrong_zero_and_nothing_else(tmp_path, monkeypatch):
    """Against the same case without an offset, whose draws are the same."""
    skip_without_robots()
    monkeypatch.setattr("tests.benchmarks.blind_arm.known_links.SECONDS", 2.0)
    number = KNOWN_ROUND.index("encoder_offset")
    case = known_case(number, 3)
    truth = record_known_case(case, tmp_path / "wrong")
    assert (truth["id"], truth["where"]) == ("encoder_offset", case.where)
    assert np.deg2rad(2.0) <= abs(truth["estimated"]["offset"]) <= np.deg2rad(5.0)
    case.offsets.clear()
    monkeypatch.setattr("tests.benchmarks.blind_arm.known_links.OF_THE_ARM", ())
    object.__setattr__(case, "kind", "")
    record_known_case(case, tmp_path / "right")
    wrong, right = (np.load(tmp_path / side / "run_2.npz") for side in ("wrong", "right"))
    for name in right:
        added = truth["estimated"]["offset"] if name == f"{case.where}/position" else 0.0
        assert_allclose(wrong[name] - right[name], added, rtol=0, atol=5e-5)  # a step of the encoder


def test_errors_of_the_set_up_count_as_what_they_name():
    errors = [
        {"kind": "payload", "carrier": "hand", "joints": []},
        {"kind": "zero", "carrier": None, "joints": ["lift"]},
        {"kind": "gravity", "carrier": None, "joints": []},
    ]
    report = named_set_up({"set_up": {"errors": errors}, "shared": [], "final_parameters": {"lift": {}}})
    pairs = [(entry["id"], entry["where"]) for entry in report["shared"]]
    assert pairs == [("payload", "hand"), ("encoder_offset", "lift"), ("gravity", "")]
    assert report["final_parameters"] == {}
    plain = {"set_up": None, "shared": [{"id": "link_mass"}], "final_parameters": {"lift": {}}}
    assert named_set_up(plain) == plain


@pytest.mark.slow
def test_a_few_arms_are_diagnosed_from_their_files(tmp_path):
    skip_without_robots()
    wanted = [KNOWN_ROUND.index(kind) for kind in ("payload", "encoder_offset", "")]
    with ThreadPoolExecutor(1) as pool:
        scores = known_arm_benchmark(tmp_path, wanted, 12, pool, lambda text, share: None)
    assert [s.robot.failure for s in scores if s.robot.failure] == []
    assert [s.robot.name for s in scores if not s.robot.exact] == []
