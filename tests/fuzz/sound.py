"""Sound files from which cases are made: rigs, logs, robots, models, scenarios, data sets."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from robot_files import joint_tag, link_tag, urdf

from drake_tc.types import FloatArray

REPOSITORY = Path(__file__).resolve().parents[2]
GRAVITY = 9.81


@dataclass(frozen=True)
class Sound:
    """Documents and columns; nothing in them is ever changed.

    Attributes:
        joint: Columns of a log of one joint.
        joint_rig: Its rig file.
        motor: The same motion under a voltage.
        arm: Columns of a log of two joints, IMU and F/T sensor.
        arm_rig, arm_robot, arm_urdf: Of that.
        scenarios: Diagram to scenario document of one scenario, with absolute paths.
        controller, actuators, model: Documents of these files.
        sheet: Motor data sheet.
        base, base_rig: Columns of a log of a humanoid that stands, and the rig file of `estimate-base`.
    """

    joint: dict[str, FloatArray]
    joint_rig: dict[str, Any]
    motor: dict[str, FloatArray]
    arm: dict[str, FloatArray]
    arm_rig: dict[str, Any]
    arm_robot: dict[str, Any]
    arm_urdf: str
    scenarios: dict[str, dict[str, Any]]
    controller: dict[str, Any]
    actuators: dict[str, Any]
    model: dict[str, Any]
    sheet: dict[str, Any]
    base: dict[str, FloatArray]
    base_rig: dict[str, Any]


def _joint(rows: int = 600, period: float = 2e-3) -> dict[str, FloatArray]:
    """q_d = q + K (tau + I a + d v + c sign v) of a joint that is pushed by hand."""
    t, w, rng = np.arange(rows) * period, 9.0, np.random.default_rng(0)
    q, v, a = 0.6 * np.sin(w * t), 0.6 * w * np.cos(w * t), -0.6 * w * w * np.sin(w * t)
    tau = 20.0 * np.sin(13.1 * t + 1.0)
    command = q + 2e-3 * (tau + 0.3 * a + 3.0 * v + 2.0 * np.sign(v))
    return {
        "time": t,
        "elbow/position": q + 1e-5 * rng.normal(size=rows),
        "elbow/position_command": command,
        "elbow/torque": tau + 0.05 * rng.normal(size=rows),
    }


def _motor(rows: int = 1500, period: float = 2e-3) -> dict[str, FloatArray]:
    """v = 0.15 (tau + c sign v + d v + I a) of a motor."""
    t, rng = np.arange(rows) * period, np.random.default_rng(2)
    q, v, a = 0.5 * np.sin(9.0 * t), 4.5 * np.cos(9.0 * t), -40.5 * np.sin(9.0 * t)
    tau = 12.0 * np.sin(3.1 * t + 1.0)
    volts = 0.15 * (tau + 3.0 * np.sign(v) + (1.5 + 0.04**2 * 1e4 / 0.6) * v + 0.12 * a)
    return {"time": t, "elbow/position": q, "elbow/voltage": volts + 1e-3 * rng.normal(size=rows), "elbow/torque": tau}


def _arm(rows: int = 400, period: float = 2e-3) -> dict[str, FloatArray]:
    """Two joints that swing; the IMU and the F/T sensor read as if they hung still."""
    t, rng = np.arange(rows) * period, np.random.default_rng(1)
    columns = {"time": t}
    for number, joint in enumerate(("hip", "knee")):
        q = 0.4 * np.sin((5.0 + number) * t)
        columns[f"{joint}/position"] = q + 1e-5 * rng.normal(size=rows)
        columns[f"{joint}/current"] = 3.0 * np.sin((5.0 + number) * t + 0.4) + 0.01 * rng.normal(size=rows)
    for axis, value in zip("xyz", (0.0, 0.0, GRAVITY), strict=True):
        columns[f"imu_base/gyro_{axis}"] = 1e-3 * rng.normal(size=rows)
        columns[f"imu_base/accel_{axis}"] = value + 1e-2 * rng.normal(size=rows)
    for axis in ("fx", "fy", "fz", "tx", "ty", "tz"):
        columns[f"ft_tip/{axis}"] = rng.normal(size=rows)
    return columns


def _urdf() -> str:
    return urdf(
        link_tag("thigh", (0, 0, -0.2), 2.0, (0.02, 0.02, 0.002)),
        link_tag("shank", (0, 0, -0.2), 1.5, (0.015, 0.015, 0.002)),
        link_tag("foot", (0, 0, -0.02), 0.5, (0.001, 0.001, 0.001)),
        joint_tag("hip", "base", "thigh", axis=(0, 1, 0)),
        joint_tag("knee", "thigh", "shank", axis=(0, 1, 0), xyz=(0, 0, -0.4)),
        joint_tag("foot_mount", "shank", "foot", axis=(0, 0, 1), xyz=(0, 0, -0.4), kind="fixed"),
    )


def _standing(rows: int = 60, period: float = 1e-2) -> dict[str, FloatArray]:
    """A humanoid at rest; each foot carries half of it."""
    t, rng = np.arange(rows) * period, np.random.default_rng(3)
    columns = {"time": t}
    for joint in _document("models/hrp2_like/hrp2_like.yaml")["joints"]:
        columns[f"{joint}/position"] = 1e-4 * rng.normal(size=rows)
    for axis, value in zip("xyz", (0.0, 0.0, GRAVITY), strict=True):
        columns[f"imu_torso/gyro_{axis}"] = 1e-3 * rng.normal(size=rows)
        columns[f"imu_torso/accel_{axis}"] = value + 1e-2 * rng.normal(size=rows)
    for side in ("left", "right"):
        for axis in ("fx", "fy", "fz", "tx", "ty", "tz"):
            columns[f"ft_{side}_ankle/{axis}"] = 250.0 * (axis == "fz") + rng.normal(size=rows)
    return columns


def _base_rig(robot: Path) -> dict[str, Any]:
    contacts = {
        side: {
            "link": f"{side[0]}_foot",
            "xyz": [0.0, 0.0, -0.055],
            "sole": [-0.1, 0.1, -0.05, 0.05],
            "sensor": f"{side}_ankle",
            "make": 30.0,
            "break": 20.0,
        }
        for side in ("left", "right")
    }
    return {"robot": str(robot), "contacts": contacts, "start": {"position": [0.0, 0.0, 0.6], "yaw": 0.0}}


def _document(path: str) -> dict[str, Any]:
    return dict(yaml.safe_load((REPOSITORY / path).read_text(encoding="utf-8")))


def _absolute(document: dict[str, Any], folder: Path, *keys: str) -> dict[str, Any]:
    found = {key: str((folder / document[key]).resolve()) for key in keys if key in document}
    return document | found


def sound() -> Sound:
    """All of it."""
    diagrams, models = REPOSITORY / "diagrams", REPOSITORY / "models"
    scenarios = {}
    for name, scenario in (("hrp2_leg", "hanging"), ("sea_joint", "held"), ("humanoid_tsid", "balance")):
        fields = _document(f"diagrams/{name}.scenario.yaml")[scenario]
        scenarios[name] = {scenario: _absolute(fields, diagrams, "robot", "model", "actuators", "controller")}
    scenarios["hrp2_leg"]["hanging"]["model"] = str(models / "hrp2_like" / "hrp2_like_leg_asymmetric.yaml")
    return Sound(
        joint=_joint(),
        joint_rig={"joint": "elbow", "drive": "position_servo", "declared": {"rotor_inertia": 0.3}},
        motor=_motor(),
        arm=_arm(),
        arm_rig={"robot": "arm.yaml", "drive": "current", "load": {"robot": "estimate"}, "drive_gain": 0.1},
        arm_robot={
            "name": "arm",
            "urdf": "arm.urdf",
            "base": "base",
            "fixed_base": True,
            "joints": ["hip", "knee"],
            "imu": {"base": {"link": "base", "xyz": [0.0, 0.0, 0.05]}},
            "force_torque": {"tip": {"joint": "foot_mount"}},
        },
        arm_urdf=_urdf(),
        scenarios=scenarios,
        controller=_absolute(_document("models/hrp2_like/hrp2_like_tsid.yaml"), models / "hrp2_like", "robot"),
        actuators=_document("models/coman_like/coman_like_actuators.yaml"),
        model=_document("models/hrp2_like/hrp2_like_leg_asymmetric.yaml"),
        sheet={
            "motors": {
                "all": {
                    "torque_constant": 0.043,
                    "back_emf": 0.043,
                    "resistance": 0.55,
                    "rotor_inertia": 1e-5,
                    "gear_ratio": 100.0,
                    "coulomb": 1.0,
                    "viscous": 1.0,
                    "stiffness": 200.0,
                    "voltage_limit": 24.0,
                }
            },
            "widths": {"torque_constant": 0.1},
        },
        base=_standing(),
        base_rig=_base_rig(models / "hrp2_like" / "hrp2_like.yaml"),
    )
