"""Sign conventions of F/T sensor and accelerometer against Drake's own sensors, and zeroing from the rig file."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.framework import DiagramBuilder

from drake_tc.errors import LogError, RigError
from drake_tc.estimation.robot_loads import robot_logs, with_robot_loads
from drake_tc.logs.record import Run
from drake_tc.logs.rig import load_rig, parse_rig, rig_document
from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import load_robot
from drake_tc.sensing.suite import SensorSuiteSpec, add_sensors

from .small_robot import ROBOT, write_robot

JOINTS = ("turn", "push", "bend")
AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")
HAND_WEIGHT = 0.7 * 9.81
PERIOD, ROWS = 2e-3, 400


def _rig(folder, sensors=None):
    write_robot(folder)
    (folder / "arm.yaml").write_text(ROBOT.replace("fixed_base: false", "fixed_base: true"), encoding="utf-8")
    document = {"robot": "arm.yaml", "drive": "current"} | ({"sensors": sensors} if sensors else {})
    (folder / "rig.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
    return load_rig(folder / "rig.yaml")


def _at_rest(folder, support):
    """(imu (6,), wrench (6,), actuation (n,), R_WS): Drake's sensors with `support` [N] upwards on the hand."""
    robot = load_robot(folder / "arm.yaml")
    builder = DiagramBuilder()
    plant = MultibodyPlant(1e-3)
    add_robot(plant, robot)
    plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    builder.AddNamedSystem("plant", plant)
    sensors = add_sensors(builder, plant, robot, SensorSuiteSpec.perfect(), 1e-3)
    builder.ExportInput(plant.get_actuation_input_port(), "actuation")
    builder.ExportInput(plant.get_applied_spatial_force_input_port(), "external")
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyContextFromRoot(context)
    hand = plant.GetBodyByName("hand")
    push = SpatialForce(np.zeros(3), np.array([0.0, 0.0, support]))
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(own, forces)
    hand.AddInForceInWorld(own, push, forces)
    effort = plant.CalcInverseDynamics(own, np.zeros(plant.num_velocities()), forces)
    external = ExternallyAppliedSpatialForce()
    external.body_index, external.p_BoBq_B, external.F_Bq_W = hand.index(), np.zeros(3), push
    diagram.GetInputPort("actuation").FixValue(context, plant.MakeActuationMatrix().T @ effort)
    diagram.GetInputPort("external").FixValue(context, [external])
    read = [
        sensor.GetOutputPort("reading").Eval(sensor.GetMyContextFromRoot(context)).copy()
        for sensor in (sensors.imu, sensors.force_torque)
    ]
    R_WS = hand.EvalPoseInWorld(own).rotation().matrix() @ robot.force_torque[0].pose.transform.rotation().matrix()
    return (*read, plant.MakeActuationMatrix().T @ effort, R_WS, robot)


def _run(imu, wrench, name="rest", noise=None):
    columns = {f"{j}/{c}": np.zeros(ROWS) for j in JOINTS for c in ("position", "current")}
    columns |= {f"imu_chest/{a}": np.full(ROWS, value) for a, value in zip(AXES, imu, strict=True)}
    columns |= {f"ft_wrist/{a}": np.full(ROWS, value) for a, value in zip(WRENCH, wrench, strict=True)}
    return Run(name, None, PERIOD * np.arange(ROWS), PERIOD, columns, np.zeros(ROWS, np.int64))


@pytest.mark.parametrize("support", [0.0, 60.0])
def test_the_signs_of_the_rig_page_are_those_of_drake(tmp_path, support):
    rig = _rig(tmp_path)
    imu, wrench, actuation, R_WS, robot = _at_rest(tmp_path, support)
    # at rest, the proper acceleration points upwards
    R_WI = robot.imu[0].pose.transform.rotation().matrix()  # the base is at its reference orientation
    assert_allclose(R_WI @ imu[3:], [0.0, 0.0, 9.81], atol=1e-9)
    # a hand that the ground supports pushes the arm up; one that hangs pulls it down
    assert_allclose(R_WS @ wrench[:3], [0.0, 0.0, support - HAND_WEIGHT], atol=1e-9)
    run = _run(imu, wrench)
    (loaded,) = with_robot_loads(robot_logs(rig, [run]), [run], rig.joints)
    for joint, torque in zip(JOINTS, actuation, strict=True):
        assert_allclose(loaded.columns[f"{joint}/torque"], torque, rtol=1e-8, atol=1e-8)


def test_a_sensor_is_zeroed_where_the_rig_file_says_that_nothing_touches_it(tmp_path):
    rig = _rig(tmp_path, {"ft_wrist": {"tare": [0.1, "400 ms"]}})
    imu, free, actuation, _, _ = _at_rest(tmp_path, 0.0)
    _, touched, pressed, _, _ = _at_rest(tmp_path, 25.0)
    bias = np.array([3.0, -2.0, 5.0, 0.1, 0.2, -0.3])
    run = _run(imu, free + bias)
    later = run.time > 0.6
    columns = dict(run.columns)
    for axis, value in zip(WRENCH, touched + bias, strict=True):
        columns[f"ft_wrist/{axis}"] = np.where(later, value, columns[f"ft_wrist/{axis}"])
    run = replace(run, columns=columns)
    logs = robot_logs(rig, [run])
    (loaded,) = with_robot_loads(logs, [run], rig.joints)
    for joint, before, after in zip(JOINTS, actuation, pressed, strict=True):
        torque = loaded.columns[f"{joint}/torque"]
        assert_allclose(torque[~later], before, rtol=1e-7, atol=1e-7)
        assert_allclose(torque[later], after, rtol=1e-7, atol=1e-7)
    (note,) = loaded.notes
    assert note.startswith("Sensor ft_wrist was zeroed between 0.1 and 0.4 s: [3, -2, 5, 0.1, 0.2, -0.3] (N, N*m)")


def test_a_run_without_the_stretch_is_refused(tmp_path):
    rig = _rig(tmp_path, {"ft_wrist": {"tare": [2.0, 4.0]}})
    run = _run(np.zeros(6), np.zeros(6))
    with pytest.raises(LogError, match=r"rest: sensors: ft_wrist: tare: no usable stretch of more than .* 2 and 4 s"):
        with_robot_loads(robot_logs(rig, [run]), [run], rig.joints)


def test_the_tare_is_checked_and_written_back(tmp_path):
    rig = _rig(tmp_path, {"ft_wrist": {"tare": [0, 1.5]}})
    assert rig.tares == {"ft_wrist": (0.0, 1.5)}
    assert parse_rig(rig_document(rig)).tares == rig.tares
    for tare, said in (([2, 1], "expected begin < end"), ([1], "expected a list of two values, begin and end")):
        with pytest.raises(RigError, match=f"sensors.ft_wrist.tare: {said}"):
            _rig(tmp_path, {"ft_wrist": {"tare": tare}})
