"""The column of an F/T sensor's gain against loads from readings that were scaled."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.shared.columns_of_runs import columns_over
from drake_tc.estimation.robot_loads import robot_logs, with_robot_loads
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig
from drake_tc.loops.recording import write_log

from ..small_robot import write_robot

JOINTS = ("turn", "push", "bend")
GAIN = 1.1
RIG = "robot: arm.yaml\ndrive: position_servo\nload: {robot: estimate}\ndeclared: [rotor_inertia]\n"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A slow motion during which the sensor reads a force that changes from sample to sample."""
    folder, rng = tmp_path_factory.mktemp("small"), np.random.default_rng(3)
    write_robot(folder)
    (folder / "rig.yaml").write_text(RIG, encoding="utf-8")
    time = np.arange(1500) * 1e-3
    columns = {"time": time}
    for number, joint in enumerate(JOINTS):
        columns[f"{joint}/position"] = 0.2 * np.sin(2.0 * np.pi * (0.3 + 0.1 * number) * time)
        columns[f"{joint}/position_command"] = columns[f"{joint}/position"] + 0.01
    for axis in ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"):
        columns[f"imu_chest/{axis}"] = 1e-3 * rng.standard_normal(time.size) + (9.81 if axis == "accel_z" else 0.0)
    for axis in ("fx", "fy", "fz", "tx", "ty", "tz"):
        columns[f"ft_wrist/{axis}"] = 5.0 * rng.standard_normal(time.size)
    write_log(columns, folder / "log.npz")
    rig = load_rig(folder / "rig.yaml")
    runs = load_runs([folder / "log.npz"], rig)
    return robot_logs(rig, runs), rig, runs


def test_the_gains_columns_are_the_change_of_the_loads_whatever_the_readings(recorded):
    logs, rig, runs = recorded
    scaled = [
        replace(r, columns={k: v / GAIN if k.startswith("ft_") else v for k, v in r.columns.items()}) for r in runs
    ]
    first, second = (with_robot_loads(logs, each, rig.joints)[0] for each in (runs, scaled))
    causes = columns_over(logs, [first], rig)
    gain = next(c for c in causes.causes if c.id == "ft_gain").columns
    inside = first.segment >= 0
    for joint in JOINTS:
        own = causes.of(first.name, joint, first.time - first.time[0])[inside][:, gain].sum(axis=1) * (1.0 - 1.0 / GAIN)
        change = (first.columns[f"{joint}/torque"] - second.columns[f"{joint}/torque"])[inside]
        assert np.std(change) > 0.1
        assert_allclose(own, change, atol=5e-3 * np.std(change))  # lever arms between grid points
