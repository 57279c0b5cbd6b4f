"""Importers of whole robots, on made-up small sets: columns, gains, robot files; an MJCF tree against Drake's own."""

import gzip
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from drake_tc.errors import LogError
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig
from drake_tc.logs.rig_document.document import Condition
from drake_tc.robot.robot import load_robot
from tests.benchmarks.importers import IMPORTERS
from tests.benchmarks.importers.mjcf import urdf_of_mjcf
from tests.benchmarks.importers.so101 import tip_height

MJCF = """<mujoco model="small">
  <compiler angle="radian"/>
  <default>
    <default class="arm">
      <joint axis="0 1 0" range="-1 2"/>
      <default class="turned"><joint axis="1 0 0"/></default>
    </default>
  </default>
  <worldbody>
    <body name="base" childclass="arm">
      <inertial pos="0 0 0" mass="3" diaginertia="0.1 0.1 0.1"/>
      <body name="a" pos="0.1 0.2 0.3" quat="0.9 0.1 -0.2 0.3">
        <inertial pos="0.01 -0.02 0.05" quat="0.8 0.2 0.5 -0.1" mass="1.5" diaginertia="0.02 0.015 0.01"/>
        <joint name="a_joint" class="turned"/>
        <body name="b" pos="0 0 -0.2">
          <inertial pos="0 0.01 -0.1" mass="0.7" fullinertia="0.01 0.012 0.004 0.001 -0.002 0.0005"/>
          <joint name="b_joint"/>
        </body>
      </body>
      <body name="c" pos="-0.1 0 0">
        <inertial pos="0 0 0.1" mass="0.4" diaginertia="0.003 0.003 0.001"/>
        <joint name="c_joint" axis="0 0 1" range="-0.5 0.5"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""

JOINTS = "".join(
    f'<link name="l{i}"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
    "</inertial></link>"
    f'<joint name="{{}}" type="revolute"><parent link="{parent}"/><child link="l{i}"/><axis xyz="0 1 0"/>'
    f'<origin xyz="0.0{i} 0.02 -0.1" rpy="0.{i} 0.2 -0.{i}"/>'
    '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
    for i, parent in enumerate(["base_link", "l0", "l1", "l2", "l3", "l4"])
)


TIP = """<link name="gripper_frame_link"/><joint name="tip" type="fixed"><parent link="l4"/>
<child link="gripper_frame_link"/><origin xyz="0.1 0.02 0.3" rpy="0.1 -0.2 0.3"/></joint>"""


def urdf_of(joints: list[str]) -> str:
    return f'<robot name="r"><link name="base_link"/>{JOINTS.format(*joints)}{TIP}</robot>'


def write_urdf(path: Path, joints: list[str]) -> None:
    text = urdf_of(joints)
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())


def write_run(path: Path, columns: list[str], rng: np.random.Generator) -> pd.DataFrame:
    table = pd.DataFrame({name: np.cumsum(rng.normal(0.0, 0.01, 40)) for name in columns})
    table.insert(0, "time", 3.0 + 0.01 * np.arange(40))
    table.to_csv(path, index=False)
    return table


def plant_of(text: str, file_type: str) -> MultibodyPlant:
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(text, file_type)
    if file_type == "urdf":  # an MJCF body without a joint is welded to the world
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    return plant


def test_a_converted_tree_moves_as_drake_reads_the_mjcf() -> None:
    text, base, hinges = urdf_of_mjcf(MJCF, "small.xml")
    assert base == "base" and hinges == ["a_joint", "b_joint", "c_joint"]
    ours, theirs = plant_of(text, "urdf"), plant_of(MJCF, "xml")
    rng = np.random.default_rng(2)
    for _ in range(5):
        sides = []
        values = dict(zip(hinges, rng.uniform(-1.0, 1.0, (3, 3)), strict=True))
        for plant in (ours, theirs):
            context, order = plant.CreateDefaultContext(), []
            q, v, vdot = (np.zeros(plant.num_velocities()) for _ in range(3))
            for name, state in values.items():
                place = plant.GetJointByName(name).velocity_start()
                q[place], v[place], vdot[place] = state
                order.append(place)
            plant.SetPositions(context, q)
            plant.SetVelocities(context, v)
            gravity = plant.CalcGravityGeneralizedForces(context)
            bias = plant.CalcBiasTerm(context)
            tau = plant.CalcMassMatrix(context) @ vdot + bias - gravity
            sides.append(tau[order])
        assert_allclose(sides[0], sides[1], rtol=1e-7, atol=1e-9)  # the URDF has nine digits
    for name, (low, high) in {"a_joint": (-1, 2), "b_joint": (-1, 2), "c_joint": (-0.5, 0.5)}.items():
        joint = ours.GetJointByName(name)
        assert_allclose([joint.position_lower_limits()[0], joint.position_upper_limits()[0]], [low, high])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<mujoco", "not XML"),
        ("<robot/>", "a body in its worldbody"),
        ("<mujoco><worldbody><body name='a'/></worldbody></mujoco>", "no hinge"),
        (MJCF.replace('pos="0 0 -0.2"', 'pos="0 0"'), "expected 3 numbers"),
        (MJCF.replace('axis="0 0 1" range', 'type="slide" range'), "is a slide"),
    ],
)
def test_what_is_not_a_tree_of_hinges_is_refused(text: str, said: str) -> None:
    with pytest.raises(LogError, match=said):
        urdf_of_mjcf(text, "small.xml")


def test_ur10e_reads_currents_and_names_the_loaded_run(tmp_path: Path) -> None:
    source, out, rng = tmp_path / "set", tmp_path / "out", np.random.default_rng(1)
    source.mkdir()
    names = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint"]
    write_urdf(source / "ur10e.urdf.gz", [*names, "wrist_3_joint"])
    columns = [f"{key}_{i}" for key in ("q", "qd", "current") for i in range(1, 7)]
    table = write_run(source / "exc_a.csv", columns, rng)
    (rig_file,) = IMPORTERS["ur10e"](source, out)
    write_run(source / "exc_0131_load.csv", columns, rng)
    assert [path.name for path in IMPORTERS["ur10e"](source, out)] == ["rig.yaml", "rig_load.yaml"]
    rig, loaded = load_rig(rig_file), load_rig(out / "rig_load.yaml")
    assert rig.load["elbow_joint"] == RobotLoad("fitted", gain_tolerance=0.1)
    assert loaded.load["elbow_joint"] == RobotLoad("fitted", gain_tolerance=0.1, payload=("exc_0131_load",))
    assert_allclose(1.0 / rig.drive_gain["elbow_joint"], 9.839, rtol=1e-5)  # README: N m/A at the joint
    log = pd.read_parquet(out / "exc_a.parquet")
    assert_allclose(log["elbow_joint/current"], table["current_3"], rtol=0)
    assert_allclose(log["wrist_3_joint/velocity"], table["qd_6"], rtol=0)
    assert load_robot(out / "robot.yaml").joints == rig.joints
    assert len(load_runs(sorted(out.glob("*.parquet")), loaded)) == 2


def test_the_height_of_the_tip_is_that_of_drakes_kinematics() -> None:
    rng = np.random.default_rng(5)
    angles = {name: rng.uniform(-1.0, 1.0, 4) for name in "abcde"}
    heights = tip_height(urdf_of([*"abcdef"]), angles, "small.urdf")
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(urdf_of([*"abcdef"]), "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link"))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    for k, height in enumerate(heights):
        for name, values in angles.items():
            plant.GetJointByName(name).set_angle(context, values[k])
        pose = plant.GetFrameByName("gripper_frame_link").CalcPoseInWorld(context)
        assert_allclose(height, pose.translation()[2], rtol=0, atol=1e-12)
    with pytest.raises(LogError, match="no link 'gripper_frame_link'"):
        tip_height('<robot name="r"><link name="base_link"/></robot>', angles, "small.urdf")


def test_so101_reads_commands_and_locks_the_jaw(tmp_path: Path) -> None:
    source, out = tmp_path / "set", tmp_path / "out"
    source.mkdir()
    names = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
    write_urdf(source / "so101_new_calib.urdf", names)
    columns = [f"{key}_{i}" for key in ("cmd", "pos", "vel", "cur") for i in range(1, 7)]
    table = write_run(source / "sweep.csv", columns, np.random.default_rng(3))
    rig_file, free = IMPORTERS["so101"](source, out)
    rig = load_rig(rig_file)
    assert rig.joints == tuple(names[:5]) and set(rig.drive.values()) == {"position_servo"}
    assert load_robot(out / "robot.yaml").locked == {"gripper": 0.0}
    # README of the set: 7.7 N m/rad by the proportional law
    assert_allclose(1.0 / rig.drive_gain["elbow_flex"], 7.7, rtol=0.01)
    log = pd.read_parquet(out / "sweep.parquet")
    assert_allclose(log["wrist_roll/position_command"], table["cmd_5"], rtol=0)
    height = tip_height(urdf_of(names), {joint: log[f"{joint}/position"].to_numpy() for joint in names[:5]}, "")
    assert load_rig(free).valid == (Condition("tip_height", ">", -0.02),)
    assert_allclose(log["tip_height"], height, atol=1e-12)


def test_go2_makes_its_robot_from_the_mjcf(tmp_path: Path) -> None:
    source, out = tmp_path / "set", tmp_path / "out"
    source.mkdir()
    (source / "go2.xml").write_text(MJCF)
    columns = [f"{key}_{joint}" for key in ("q", "q_cmd") for joint in "abc"]
    table = write_run(source / "traj_0.csv", columns, np.random.default_rng(4))
    (rig_file,) = IMPORTERS["go2"](source, out)
    rig = load_rig(rig_file)
    assert rig.joints == ("a", "b", "c") and load_robot(out / "robot.yaml").joints == rig.joints
    assert_allclose(list(rig.drive_gain.values()), 1.0 / 20.0, rtol=1e-12)  # README: Kp = 20 N m/rad
    log = pd.read_parquet(out / "traj_0.parquet")
    assert_allclose(log["b/position_command"], table["q_cmd_b"], rtol=0)
    (source / "traj_0.csv").write_text("time,q_a\n0,1\n")
    with pytest.raises(LogError, match="no column 'q_cmd_a'"):
        IMPORTERS["go2"](source, out)
