"""Every cause that the torques of one robot can have."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.problem.shared.body_motion import Structure, joint_is_prismatic
from drake_tc.diagnosis.problem.shared.causes import (
    AXES,
    LINK_INERTIA_ID,
    LINK_PARAMETERS_ID,
    PAYLOAD_ID,
    Cause,
)
from drake_tc.estimation.robot_loads import RobotLogs
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.rig import Rig
from drake_tc.robot.link_parameters import UNITS, LinkModel, link_model
from drake_tc.robot.rigid_regressor import LINK_PARAMETERS

HEAVIEST = 10.0
"""Error of a link's mass, over the mass of all links, at most: what is larger is an error of a unit."""
FARTHEST = 1.0
"""Of a link's centre of mass from where the robot's file has it, and of a payload's from the link's origin [m]."""
INERTIA_TOLERANCE = 0.2
"""Of a link's moments of inertia where its mass or centre is wrong, over those of its mass at its size."""


def list_causes(logs: RobotLogs, structure: Structure, rig: Rig) -> tuple[Cause, ...]:
    """Every cause that this robot's torques can have, with the rig's tolerances."""
    found: list[Cause] = []

    def add(
        name: str,
        where: str,
        parts: Sequence[tuple[str, str]],
        tolerance: Sequence[float] = (),
        possible: tuple[float, float] = (-np.inf, np.inf),
    ) -> None:
        first = found[-1].columns.stop if found else 0
        names, units = zip(*parts, strict=True)
        place = slice(first, first + len(parts))
        found.append(Cause(name, where, names, units, place, tuple(tolerance), possible=possible))

    load = next(iter(rig.load.values()))
    if logs.links is not None and isinstance(load, RobotLoad):
        spread = logs.links.deviations(load.tolerance).reshape(-1, len(UNITS))
        for name, each in zip(logs.links.tree.links, spread, strict=True):
            add(LINK_PARAMETERS_ID, name, list(zip(LINK_PARAMETERS, UNITS, strict=True)), each.tolist())
        for run in load.payload:
            spread_of = logs.links.payload_deviations.tolist()
            add(PAYLOAD_ID, run, list(zip(LINK_PARAMETERS, UNITS, strict=True)), spread_of)
        return tuple(found)
    heaviest = HEAVIEST * sum(link.mass for link in structure.links)
    for link in structure.links:
        add("link_mass", link.name, [("mass", "kg")], possible=(-link.mass, heaviest))
    for link in structure.links:
        add("link_com", link.name, [(f"com_{a}", "m") for a in AXES], possible=(-FARTHEST, FARTHEST))
    if encoders_alone(logs):
        for joint, slides in zip(logs.robot.joints, joint_is_prismatic(logs.model), strict=True):
            offset = rig.joint_sensors(joint).encoder_offset
            add("encoder_offset", joint, [("offset", "m" if slides else "rad")], [offset] if offset else ())
        links = link_model(logs.robot)
        for carrier in links.outermost:
            found.append(_payload(carrier, links, structure, logs.robot.joints, found[-1].columns.stop))
        spread = links.deviations(INERTIA_TOLERANCE).reshape(-1, len(UNITS))[:, 4:]
        for name, each in zip(links.tree.links, spread, strict=True):
            add(LINK_INERTIA_ID, name, list(zip(LINK_PARAMETERS[4:], UNITS[4:], strict=True)))
            found[-1] = replace(found[-1], prior=tuple(each.tolist()))
    turns = [(f"turn_{a}", "rad") for a in AXES]
    for mount in logs.robot.force_torque:
        known = rig.force_torque_tolerance(mount.name)
        biases = [(f"force_{a}", "N") for a in AXES] + [(f"torque_{a}", "N*m") for a in AXES]
        add("ft_bias", mount.name, biases, [known.force_bias] * 3 + [known.torque_bias] * 3)
        add("ft_gain", mount.name, [("force", "-"), ("torque", "-")], [known.gain] * 2)
        add("ft_alignment", mount.name, turns, [known.alignment] * 3)
    if logs.reads_imu:
        name = logs.robot.imu[0].name
        imu = rig.imu_tolerance(name)
        biases = [(f"accel_{a}", "m/s^2") for a in AXES] + [(f"gyro_{a}", "rad/s") for a in AXES]
        add("imu_bias", name, biases, [imu.accel_bias] * 3 + [imu.gyro_bias] * 3)
        add("imu_gain", name, [("accel", "-")], [imu.gain])
        add("imu_alignment", name, turns, [imu.alignment] * 3)
    return tuple(found)


def encoders_alone(logs: RobotLogs) -> bool:
    """Whether the loads are made of the joints' positions alone: other sensors would show a wrong encoder too."""
    return logs.robot.fixed_base and not logs.reads_imu and not logs.robot.force_torque


def _payload(carrier: str, links: LinkModel, structure: Structure, joints: Sequence[str], first: int) -> Cause:
    """What an outermost link carries beyond the robot's file; a wrong mass or centre of it is a special case."""
    joint = links.tree.joints[links.tree.links.index(carrier)]
    own = [link.name for link in structure.links if link.loads[joints.index(joint)]]  # nothing else hangs on it
    return Cause(
        "payload",
        carrier,
        LINK_PARAMETERS,
        UNITS,
        slice(first, first + len(UNITS)),
        prior=tuple(links.payload_deviations.tolist()),
        special=frozenset(f"{name}@{link}" for name in ("link_mass", "link_com") for link in own),
    )
