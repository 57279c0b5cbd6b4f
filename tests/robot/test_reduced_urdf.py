"""Locking joints in the URDF is the same as holding them still in Drake's own parse of the whole."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from drake_tc.errors import ParamsError
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot
from drake_tc.robot.urdf import reduced_urdf

from .robots import ARM, MIMIC, robot_file

LOCKED = {"slide": 0.17, "spin": 2.3}


def whole(text: str = ARM) -> MultibodyPlant:
    """Drake's own parse, the mesh aside, welded at `base`."""
    plant = MultibodyPlant(1e-3)
    Parser(plant).AddModelsFromString(text, "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    return plant


def same_mechanics(full: MultibodyPlant, reduced: MultibodyPlant, held: dict[str, float], bodies: list[str]) -> None:
    """Mass matrix, bias, gravity, centre of mass and poses agree at random states of the joints that move."""
    random = np.random.default_rng(3)
    moving = [reduced.get_joint(index).name() for index in reduced.GetJointIndices()]
    moving = [name for name in moving if reduced.GetJointByName(name).num_velocities() == 1]
    at = [full.GetJointByName(name).velocity_start() for name in moving]
    small = [reduced.GetJointByName(name).velocity_start() for name in moving]
    contexts = full.CreateDefaultContext(), reduced.CreateDefaultContext()
    for name, value in held.items():
        full.SetPositions(contexts[0], value_at(full, contexts[0], name, value))
    for _ in range(4):
        for name in moving:
            q, v = random.uniform(-1.0, 1.5), random.normal()
            for plant, context in zip((full, reduced), contexts, strict=True):
                plant.SetPositions(context, value_at(plant, context, name, q))
                velocity = plant.GetVelocities(context)
                velocity[plant.GetJointByName(name).velocity_start()] = v
                plant.SetVelocities(context, velocity)
        for term in ("CalcMassMatrix", "CalcBiasTerm", "CalcGravityGeneralizedForces"):
            big, little = (
                getattr(plant, term)(context) for plant, context in zip((full, reduced), contexts, strict=True)
            )
            block = np.ix_(at, at) if big.ndim == 2 else at
            sub = np.ix_(small, small) if big.ndim == 2 else small
            assert_allclose(little[sub], big[block], rtol=1e-11, atol=1e-11 * np.abs(big).max(), err_msg=term)
        com = [p.CalcCenterOfMassPositionInWorld(c) for p, c in zip((full, reduced), contexts, strict=True)]
        assert_allclose(com[1], com[0], atol=1e-12)
        for body in bodies:
            poses = [p.GetBodyByName(body).EvalPoseInWorld(c) for p, c in zip((full, reduced), contexts, strict=True)]
            assert_allclose(poses[1].GetAsMatrix4(), poses[0].GetAsMatrix4(), atol=1e-12, err_msg=body)


def value_at(plant: MultibodyPlant, context, name: str, value: float) -> np.ndarray:
    q = plant.GetPositions(context)
    q[plant.GetJointByName(name).position_start()] = value
    return q


@pytest.mark.parametrize("joints", [["wrist", "shoulder"], ["spin"], ["slide", "shoulder"]])
def test_locked_joints_equal_joints_held_still(tmp_path, joints):
    held = {"slide": 0.17, "spin": 2.3, "shoulder": -0.6, "wrist": 1.1}
    held = {name: value for name, value in held.items() if name not in joints}
    robot = load_robot(robot_file(tmp_path, joints=joints, locked=held))
    full = whole(
        ARM.replace('<visual><geometry><mesh filename="package://nowhere/upper.stl"/></geometry></visual>', "")
    )
    same_mechanics(full, make_plant(robot, 1e-3), held, ["upper", "slider", "wheel", "mark", "hand"])


def test_unlisted_joints_lock_at_zero_or_the_nearest_limit(tmp_path):
    robot = load_robot(robot_file(tmp_path))
    assert dict(robot.locked) == {"slide": 0.05, "spin": 0.0}


def test_a_locked_mimic_joint_follows_its_locked_leader(tmp_path):
    robot = load_robot(robot_file(tmp_path, MIMIC, joints=["shoulder"], locked={"slide": 0.2}))
    assert_allclose(robot.locked["wrist"], -2 * 0.2 + 0.1, rtol=1e-15)


def test_a_mimic_joint_follows_its_leader_where_that_rests_by_default(tmp_path):
    robot = load_robot(robot_file(tmp_path, MIMIC, joints=["shoulder"]))
    assert_allclose(robot.locked["wrist"], -2 * 0.05 + 0.1, atol=1e-15)


def test_tags_that_the_parser_stumbles_over_are_gone(tmp_path):
    text = reduced_urdf(load_robot(robot_file(tmp_path, MIMIC)), visuals=True, collisions=True)
    for word in ("mesh", "mimic", "transmission", "dynamics"):
        assert word not in text
    assert "<box" in text
    assert "<sphere" in text
    assert "<box" not in reduced_urdf(load_robot(tmp_path / "arm.yaml"))


def test_undeclared_prefixes_and_a_link_world_are_no_obstacle(tmp_path):
    text = ARM.replace(
        '<link name="mark"/>',
        '<link name="mark"/><link name="world"/><drake:hint value="1"/>'
        '<joint name="stand" type="fixed"><parent link="world"/><child link="base"/></joint>',
    )
    robot = load_robot(robot_file(tmp_path, text, fixed_base=False))
    plant = make_plant(robot, 1e-3)
    assert plant.num_velocities() == 6 + 2
    assert plant.GetBodyByName("base").is_floating_base_body()


HUNG = (
    '<robot name="arm"><link name="world"/><joint name="stand" type="{}"><parent link="world"/><child link="mount"/>'
    '<origin xyz="0 0 2" rpy="3 0.2 0"/></joint><link name="mount"/><joint name="foot" type="fixed">'
    '<parent link="mount"/><child link="base"/><origin xyz="0 0 0.1" rpy="0 0 1"/></joint>'
)


@pytest.mark.parametrize(("base", "bodies"), [("base", ["base", "hand"]), ("mount", ["mount", "base", "hand"])])
def test_a_base_on_a_link_world_hangs_as_the_urdf_says(tmp_path, base, bodies):
    text = ARM.replace('<robot name="arm">', HUNG.format("fixed"))
    robot = load_robot(robot_file(tmp_path, text, joints=["wrist", "shoulder"], locked=LOCKED, base=base))
    plant = MultibodyPlant(1e-3)
    mesh = '<visual><geometry><mesh filename="package://nowhere/upper.stl"/></geometry></visual>'
    Parser(plant).AddModelsFromString(text.replace(mesh, ""), "urdf")
    plant.Finalize()
    same_mechanics(plant, make_plant(robot, 1e-3), LOCKED, bodies)


def test_a_joint_on_a_link_world_stays_at_0_and_cannot_be_driven(tmp_path):
    text = ARM.replace('<robot name="arm">', HUNG.format("continuous"))
    robot = load_robot(robot_file(tmp_path, text))
    assert robot.unused[0].endswith(
        "not used of stand (line 2): that it moves mount relative to the link 'world' (it is held at 0)."
    )
    with pytest.raises(ParamsError, match="the parent of joint 'stand' is the link 'world', which is reserved"):
        load_robot(robot_file(tmp_path, text, joints=["stand", "wrist"]))


def test_a_floating_base_below_the_root_carries_the_root(tmp_path):
    locked = {"slide": 0.2, "spin": 0.7, "shoulder": 0.4}
    above = make_plant(load_robot(robot_file(tmp_path, joints=["wrist"], locked=locked, fixed_base=False)), 1e-3)
    robot = load_robot(robot_file(tmp_path, joints=["wrist"], locked=locked, fixed_base=False, base="slider"))
    below = make_plant(robot, 1e-3)
    contexts = [plant.CreateDefaultContext() for plant in (above, below)]
    between = [
        plant.CalcRelativeTransform(context, plant.GetFrameByName("base"), plant.GetFrameByName("hand")).GetAsMatrix4()
        for plant, context in zip((above, below), contexts, strict=True)
    ]
    assert_allclose(between[1], between[0], atol=1e-14)
    masses = [p.CalcMassMatrix(c) for p, c in zip((above, below), contexts, strict=True)]
    wrists = [mass[6, 6] - mass[6, :6] @ np.linalg.solve(mass[:6, :6], mass[:6, 6]) for mass in masses]
    assert_allclose(wrists[1], wrists[0], rtol=1e-10)  # what the wrist feels of itself does not know which link floats
