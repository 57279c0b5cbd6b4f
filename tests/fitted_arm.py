"""A simulated arm of three joints with current drives, its logs and its rig file: links fitted beside the joints."""

import numpy as np
import yaml
from pydrake.multibody.tree import MultibodyForces, SpatialInertia, UnitInertia
from robot_files import joint_tag, link_tag, urdf, write_robot

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.effects.library import effect
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot

URDF = urdf(
    link_tag("column", (0, 0, 0.1), 4, (0.05, 0.05, 0.03)),
    link_tag("boom", (0.2, 0, 0), 2, (0.005, 0.03, 0.03)),
    link_tag("fore", (0.15, 0.01, 0), 1.2, (0.002, 0.012, 0.012)),
    joint_tag("turn", "base", "column", axis=(0, 0, 1)),
    joint_tag("lift", "column", "boom", xyz=(0.3, 0, 0.2), axis=(0, 1, 0)),
    joint_tag("fold", "boom", "fore", xyz=(0.4, 0, 0), axis=(0, 1, 0)),
)
JOINTS = ("turn", "lift", "fold")
GAIN, ROTOR = np.array([0.1, 0.2, 0.15]), np.array([0.4, 0.3, 0.1])
VISCOUS, COULOMB = np.array([1.5, 1.0, 0.6]), np.array([1.0, 0.8, 0.5])
NOISE, STEP, PERIOD, SECONDS = 0.02, 1e-5, 0.01, 15.0
PAYLOAD, PLACE = 1.2, np.array([0.35, 0.05, 0.0])
"""Mass [kg] and place in the last link [m] of a point mass."""
RIG = {
    "robot": "arm.yaml",
    "drive": "current",
    "load": {"robot": "fitted", "tolerance": 0.3},
    "declared": ["rotor_inertia"],
    "drive_gain": dict(zip(JOINTS, GAIN.tolist(), strict=True)),
}
KNOWN = {
    "load": {"robot": "inverse_dynamics"},
    "declared": {joint: {"rotor_inertia": rotor} for joint, rotor in zip(JOINTS, ROTOR.tolist(), strict=True)},
}
"""Changes of the rig file for links that are taken as the URDF has them, with known rotors."""
NEAR = DiagnosisOptions(effects=(effect("load_dependent_friction"), effect("effort_bias")), assess_residual=False)
"""A joint's effects that resemble what is wrong with a robot."""


def torques(robot, q, v, vdot, payload):
    """(T, 3) by Drake."""
    plant = make_plant(robot, 0.0)
    context = plant.CreateDefaultContext()
    if payload:
        fore = plant.GetBodyByName("fore")
        total = fore.CalcSpatialInertiaInBodyFrame(context)
        total += SpatialInertia(payload, PLACE, UnitInertia.PointMass(PLACE))
        fore.SetSpatialInertiaInBodyFrame(context, total)
    out = np.empty_like(q)
    for row, (a, b, c) in enumerate(zip(q, v, vdot, strict=True)):
        plant.SetPositions(context, a)
        plant.SetVelocities(context, b)
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        out[row] = plant.CalcInverseDynamics(context, c, forces)
    return out


def record(folder, robot, name, seed, payload=0.0, late=(0.0, 0.0, 0.0), behind=(0.0, 0.0, 0.0)):
    """A run in which each drive acts `late` [s]: the current is that of the torque so much later.

    Each encoder tells the angle of `behind` [s] ago.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, SECONDS, PERIOD)
    omega = 2.0 * np.pi * np.array([0.15, 0.35, 0.8])
    angle = time[:, None, None] * omega + rng.uniform(0.0, 2.0 * np.pi, (3, 3))
    size = np.array([0.5, 0.3, 0.08])

    def motion(shift):
        later = angle + shift * omega
        return np.sin(later) @ size, np.cos(later) @ (size * omega), -np.sin(later) @ (size * omega**2)

    q = motion(0.0)[0]
    drive = np.empty_like(q)
    for shift in set(late):
        at, v, a = motion(shift)
        asked = torques(robot, at, v, a, payload) + ROTOR * a + VISCOUS * v + COULOMB * np.tanh(v / 1e-3)
        drive[:, np.array(late) == shift] = asked[:, np.array(late) == shift]
    columns = {"time": time}
    for i, joint in enumerate(JOINTS):
        columns[f"{joint}/position"] = np.round(motion(-behind[i])[0][:, i] / STEP) * STEP
        columns[f"{joint}/current"] = GAIN[i] * (drive[:, i] + NOISE * rng.standard_normal(time.size))
    np.savez(folder / f"{name}.npz", **columns)
    return folder / f"{name}.npz"


def rig_file(folder, **changes):
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(RIG | changes), encoding="utf-8")
    return path


def diagnosed_as_known(folder, seed, true=URDF, payload=0.0, change=lambda log: log, **rig_keys):
    """What is found in three logs of the arm `true` with the links of `URDF`; the last log is held out.

    `change` is done to each log before it is read.
    """
    (folder / "true").mkdir()
    robot = load_robot(write_robot(folder / "true", true, JOINTS))
    write_robot(folder, URDF, JOINTS)
    logs = [change(record(folder, robot, f"run_{number}", 10 * seed + number, payload)) for number in range(3)]
    return close_loop(rig_file(folder, **KNOWN | rig_keys), logs[:2], logs[2:], NEAR)
