"""Small robots for the tests, written as text."""

from pathlib import Path
from typing import Any

from robot_files import write_robot

ARM = """<?xml version="1.0"?>
<robot name="arm">
  <link name="base">
    <inertial><mass value="3"/>
      <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>
  </link>
  <link name="upper">
    <inertial><origin xyz="0.1 0.02 -0.1" rpy="0.2 0.1 0.3"/><mass value="2"/>
      <inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0.002" izz="0.015"/></inertial>
    <visual><geometry><mesh filename="package://nowhere/upper.stl"/></geometry></visual>
    <visual><geometry><box size="0.1 0.1 0.2"/></geometry></visual>
    <collision><geometry><sphere radius="0.05"/></geometry></collision>
  </link>
  <link name="slider">
    <inertial><origin xyz="0 0.05 0.02"/><mass value="0.7"/>
      <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.002"/></inertial>
  </link>
  <link name="wheel">
    <inertial><origin xyz="0.03 0 0"/><mass value="0.4"/>
      <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
  </link>
  <link name="mark"/>
  <link name="hand">
    <inertial><origin xyz="0 0 -0.05"/><mass value="0.5"/>
      <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0.1 0.3" rpy="0.1 -0.2 0.4"/><axis xyz="0 2 0"/>
    <limit lower="-1" upper="2" velocity="3" effort="40"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="upper"/><child link="slider"/><origin xyz="0.2 0 -0.1" rpy="0 0.5 0"/><axis xyz="1 1 0"/>
    <limit lower="0.05" upper="0.3" velocity="0" effort="0"/>
  </joint>
  <joint name="spin" type="continuous">
    <parent link="slider"/><child link="wheel"/><origin xyz="0 0.1 0" rpy="0.3 0 0"/><axis xyz="0.3 -0.4 1"/>
    <dynamics damping="2" friction="1"/>
  </joint>
  <joint name="mark_joint" type="fixed">
    <parent link="wheel"/><child link="mark"/><origin xyz="0 0 0.2" rpy="0 1.5707963267948966 0.3"/>
  </joint>
  <joint name="wrist" type="revolute">
    <parent link="mark"/><child link="hand"/><origin xyz="0.01 0 0"/><axis xyz="1 0 0"/>
    <limit lower="-2" upper="2" velocity="5" effort="9"/>
  </joint>
</robot>
"""
"""Shoulder, slide, spin, wrist in a row; masses off every axis, a link without inertia, a mesh that is nowhere."""

MIMIC = ARM.replace(
    '<axis xyz="1 0 0"/>', '<axis xyz="1 0 0"/><mimic joint="slide" multiplier="-2" offset="0.1"/>'
).replace('<joint name="mark_joint" type="fixed">', '<joint name="mark_joint" type="fixed"><mimic joint="shoulder"/>')
"""The wrist follows the slide, and a fixed joint claims to follow the shoulder."""


def robot_file(folder: Path, text: str = ARM, **changes: Any) -> Path:
    """A robot file for the URDF `text` in `folder`; a change to None takes the key away."""
    return write_robot(folder, text, **{"joints": ["wrist", "shoulder"], **changes})
