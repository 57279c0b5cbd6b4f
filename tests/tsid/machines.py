"""Robots of every kind for the tests: floating and welded, joints in the plant's order and in another, slides."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import yaml
from optional import skip_without_robots

import drake_tc.models
from drake_tc.robot.fields import Mount, Pose
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.model import TsidModel

MODELS = Path(drake_tc.models.__file__).parent
ARM = """<robot name="arm">
  <link name="base"><inertial><origin xyz="0.02 0.1 0"/><mass value="3"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0.001" izz="0.02"/></inertial></link>
  <link name="upper"><inertial><origin xyz="0.1 0.02 -0.1" rpy="0.2 0.1 0.3"/><mass value="2"/>
    <inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0.002" izz="0.015"/></inertial></link>
  <link name="slider"><inertial><origin xyz="0 0.05 0.02"/><mass value="0.7"/>
    <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.002"/></inertial></link>
  <link name="hand"><inertial><origin xyz="0 0.01 -0.05"/><mass value="0.5"/>
    <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0.1 0.3" rpy="0.1 -0.2 0.4"/><axis xyz="0 2 0"/>
    <limit lower="-1" upper="2" velocity="3" effort="40"/></joint>
  <joint name="slide" type="prismatic"><parent link="upper"/><child link="slider"/>
    <origin xyz="0.2 0 -0.1" rpy="0 0.5 0"/><axis xyz="1 1 0"/>
    <limit lower="0.05" upper="0.3" velocity="1" effort="50"/></joint>
  <joint name="wrist" type="revolute"><parent link="slider"/><child link="hand"/>
    <origin xyz="0.01 0 0.1" rpy="0.3 0 0"/><axis xyz="1 0.5 0.2"/>
    <limit lower="-2" upper="2" velocity="5" effort="9"/></joint>
</robot>
"""
NAMES = ("humanoid", "shuffled humanoid", "leg", "arm", "arm held by its slider", "floating arm", "talos", "icub")
PLACE = Pose((0.03, -0.01, -0.05), (0.2, -0.1, 0.4))


def arm(folder: Path, **changes: object) -> Robot:
    """Shoulder, slide and wrist, listed in another order than the plant's."""
    (folder / "arm.urdf").write_text(ARM, encoding="utf-8")
    document = {
        "name": "arm",
        "urdf": "arm.urdf",
        "base": "base",
        "fixed_base": True,
        "base_pose": {"xyz": [0.1, -0.2, 0.9], "rpy": [0.3, 0.2, -0.5]},
        "joints": ["wrist", "shoulder", "slide"],
        "rotor_inertia": {"wrist": 0.02, "slide": 1.5},
        **changes,
    }
    path = folder / "arm.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return load_robot(path)


def robot_or_skip(path: Path) -> Robot:
    """A robot of models/, skipped where its package is not installed."""
    if path.parent.name != "hrp2_like":
        skip_without_robots()
    return load_robot(path)


def shuffled(robot: Robot, seed: int = 3) -> Robot:
    """The same robot with its joints listed in another order."""
    order = np.random.default_rng(seed).permutation(len(robot.joints))
    return replace(robot, joints=tuple(robot.joints[i] for i in order), posture=robot.posture[order])


def machine(name: str, folder: Path) -> TsidModel:
    """One of NAMES with two contacts, one of them a point."""
    if "arm" not in name:
        return _machine(name)
    held = "held" in name
    changes = {"base": "slider"} if held else {"fixed_base": "floating" not in name}
    return _model(arm(folder, **changes), ("hand", "base" if held else "slider"))


@cache
def _machine(name: str) -> TsidModel:
    links = {"leg": ("r_foot", "r_foot"), "talos": ("right_sole_link", "left_sole_link"), "icub": ("r_sole", "l_sole")}
    file = {"humanoid": "hrp2_like", "leg": "hrp2_like_leg"}.get(name.split()[-1], name)
    robot = robot_or_skip(MODELS / file.removesuffix("_leg") / f"{file}.yaml")
    return _model(shuffled(robot) if "shuffled" in name else robot, links.get(name, ("r_foot", "l_hand")))


def _model(robot: Robot, pair: tuple[str, str]) -> TsidModel:
    inertia = {joint: 0.01 * (1 + i % 5) for i, joint in enumerate(robot.joints)}
    contacts = [
        Contact("sole", Mount("sole", pair[0], PLACE), "surface", half_length=0.1, half_width=0.05),
        Contact("tip", Mount("tip", pair[1], PLACE), "point"),
    ]
    return TsidModel(robot, contacts, rotor_inertia=robot.rotor_inertia or inertia)


def random_state(model: TsidModel, seed: int, speed: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """q within the joints' limits, a floating base anywhere, v normal."""
    rng = np.random.default_rng(seed)
    limits, q = joint_limits(model.robot), model.start.copy()
    q[model.positions] = rng.uniform(np.maximum(limits.lower, -2.0), np.minimum(limits.upper, 2.0))
    if not model.robot.fixed_base:
        quaternion = rng.normal(size=4)
        q[:7] = [*(quaternion / np.linalg.norm(quaternion)), *rng.normal(size=3)]
    return q, speed * rng.normal(size=model.nv)
