"""Rigs whose loads come from a robot file: what the file may say, and what is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import ModelFile, load_model_file, load_models
from drake_tc.effects.base import Context
from drake_tc.effects.library import effect
from drake_tc.errors import LogError, ParamsError, RigError
from drake_tc.estimation.robot_loads import robot_logs, with_robot_loads
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.record import Run
from drake_tc.logs.rig import load_rig, parse_rig, save_rig

from .small_robot import write_robot

JOINTS = ("turn", "push", "bend")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("rig")
    write_robot(place)
    return place


def rig_file(folder, text):
    path = folder / "rig.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_joints_and_load_follow_from_the_robot(folder):
    rig = load_rig(rig_file(folder, "{robot: arm.yaml, drive: position_servo}"))
    assert rig.joints == JOINTS
    assert set(rig.load.values()) == {RobotLoad("estimate")}
    assert rig.required_columns("turn") == ("turn/position", "turn/position_command")
    again = load_rig(save_rig(rig, folder / "again.yaml"))
    assert (again.joints, again.load, again.robot) == (rig.joints, rig.load, rig.robot)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{robot: nothing.yaml, drive: current}", "no such robot file"),
        ("{joint: turn, drive: current, load: {robot: estimate}}", "requires the key `robot: FILE`"),
        ("{robot: arm.yaml, drive: current, load: {robot: guess}}", "expected one of estimate, inverse_dynamics"),
        ("{robot: arm.yaml, drive: current, load: {turn: torque, push: {robot: estimate}}}", "of all joints"),
        ("{robot: arm.urdf, drive: current}", "robot"),
    ],
)
def test_refusals(folder, text, message):
    with pytest.raises(RigError, match=message.replace("|", r"\|").replace("{", r"\{")):
        load_rig(rig_file(folder, text))


def test_single_joint_rigs_are_as_they_were():
    rig = parse_rig({"joint": "knee", "drive": "current"})
    assert rig.robot is None and rig.load == {"knee": "torque"}
    assert robot_logs(rig, []) is None


def resting(folder, missing=()):
    """A run in which nothing moves, and its rig: the arm hangs, the sensor bears the hand."""
    rig = load_rig(rig_file(folder, "{robot: arm.yaml, drive: position_servo}"))
    size = 400
    columns = {f"{j}/{what}": np.zeros(size) for j in JOINTS for what in ("position", "position_command")}
    columns |= {
        f"imu_chest/{a}": np.zeros(size) for a in ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
    }
    columns |= {f"ft_wrist/{a}": np.zeros(size) for a in ("fx", "fy", "fz", "tx", "ty", "tz")}
    columns = {name: values for name, values in columns.items() if name not in missing}
    return rig, Run("rest", None, 1e-3 * np.arange(size), 1e-3, columns, np.zeros(size, dtype=np.int64))


def test_in_free_fall_nothing_is_loaded_and_forces_act_by_their_levers(folder):
    rig, run = resting(folder)
    logs = robot_logs(rig, [run])
    (loaded,) = with_robot_loads(logs, [run], rig.joints)
    for joint in JOINTS:
        assert_allclose(loaded.columns[f"{joint}/torque"], 0.0, atol=1e-12)
    pushed = dict(run.columns) | {"ft_wrist/fx": np.full(400, 5.0)}
    (loaded,) = with_robot_loads(logs, [Run("pushed", None, run.time, 1e-3, pushed, run.segment)], rig.joints)
    plant = logs.model.model.plant
    context = plant.CreateDefaultContext()
    hand = plant.GetFrameByName("hand")
    mount = logs.robot.force_torque[0].pose.transform
    X_WS = hand.CalcPoseInWorld(context).multiply(mount)
    force = X_WS.rotation().multiply(np.array([5.0, 0.0, 0.0]))
    turn = plant.GetJointByName("turn").frame_on_child().CalcPoseInWorld(context)
    lever = np.cross(X_WS.translation() - turn.translation(), force)
    wanted = -turn.rotation().matrix()[:, 1] @ lever
    assert_allclose(loaded.columns["turn/torque"], wanted, rtol=1e-9)


def test_a_missing_sensor_is_named(folder):
    rig, run = resting(folder, missing=("ft_wrist/ty",))
    with pytest.raises(LogError, match="no column with readings 'ft_wrist/ty'"):
        with_robot_loads(robot_logs(rig, [run]), [run], rig.joints)


def test_a_torque_sensor_that_is_not_there_has_no_error():
    context = Context("position_servo", "robot", frozenset())
    for name in ("torque_sensor_bias", "torque_sensor_gain", "torque_sensor_drift", "payload"):
        assert effect(name).obstacle(context)


def test_model_file_keeps_what_no_joint_owns(tmp_path):
    models = {"turn": ActuatorModel("turn", Drive("current", 0.2), (EffectValue("viscous", {"viscous": 1.0}),))}
    shared = [{"effect": "link_mass", "where": "upper", "mass": 0.4, "ci95": {"mass": [0.3, 0.5]}}]
    ModelFile(models, shared=shared).save(tmp_path / "after.yaml")
    assert load_models(tmp_path / "after.yaml") == models
    assert list(load_model_file(tmp_path / "after.yaml").shared) == shared
    (tmp_path / "bad.yaml").write_text(
        "joints: {turn: {drive: {kind: current, gain: 1}}}\nshared: 3\n", encoding="utf-8"
    )
    with pytest.raises(ParamsError, match="shared: expected a list"):
        load_models(tmp_path / "bad.yaml")
