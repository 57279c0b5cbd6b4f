"""The page about C: its command, and its ros2_control controller and lerobot loop with the exported files."""

import importlib.util
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import drake_tc
from drake_tc.cli.main import run
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot

pytestmark = pytest.mark.skipif(shutil.which("c++") is None, reason="no C compiler")

ROOT = Path(drake_tc.__file__).parents[1]
LEG = ROOT / "models" / "hrp2_like"
STUB = """
#pragma once
#include <string>
#include <vector>
namespace rclcpp { struct Time {}; struct Duration {}; }
namespace rclcpp_lifecycle { struct State {}; }
namespace controller_interface {
enum class CallbackReturn { SUCCESS, ERROR };
enum class return_type { OK, ERROR };
enum class interface_configuration_type { ALL, INDIVIDUAL, NONE };
struct InterfaceConfiguration { interface_configuration_type type; std::vector<std::string> names; };
struct Loaned { double value; double get_value() const { return value; } void set_value(double v) { value = v; } };
struct ControllerInterface {
  virtual ~ControllerInterface() = default;
  virtual CallbackReturn on_init() = 0;
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) { return CallbackReturn::SUCCESS; }
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual return_type update(const rclcpp::Time &, const rclcpp::Duration &) = 0;
  template <typename T> T auto_declare(const std::string &, const T &value) { return value; }
  std::vector<Loaned> state_interfaces_, command_interfaces_;
};
}
"""


def block(name):
    text = (ROOT / "docs" / "in_c.md").read_text("utf-8")
    return re.search(rf"File `{re.escape(name)}`:\n\n```\w+\n(.*?)```", text, flags=re.DOTALL).group(1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("c")
    model, robot = LEG / "hrp2_like_leg_actuators.yaml", LEG / "hrp2_like_leg.yaml"
    out = path / "arm_control.c"
    assert run(["export", str(model), "--to", "c", "--robot", str(robot), "--kp", "2", "--out", str(out)]) == 0
    return path


def test_the_ros2_control_controller_compiles(folder):
    """Against the few names of the controller interface that it uses."""
    (folder / "controller_interface").mkdir()
    (folder / "controller_interface" / "controller_interface.hpp").write_text(STUB)
    (folder / "arm_controller.cpp").write_text(block("arm_controller.cpp") + "\narm::Compensation made;\n")
    flags = ("-std=c++17", "-Wall", "-Wextra", "-Werror", "-I.", "-c")
    subprocess.run(["c++", *flags, "arm_controller.cpp"], cwd=folder, check=True)


class Arm:
    """A lerobot robot that holds still."""

    def __init__(self, joints, degrees):
        self.observation, self.sent = {f"{name}.pos": x for name, x in zip(joints, degrees, strict=True)}, []

    def get_observation(self):
        return self.observation

    def send_action(self, action):
        self.sent.append(action)


def test_the_lerobot_loop_holds_the_arms_weight(folder):
    """q_d - q = K_tau g(q), enlarged by the dead zone, of joints at rest."""
    library = folder / "arm_control.so"
    cc = ["cc", "-std=c99", "-O2", "-shared", "-fPIC", "arm_control.c", "-o", str(library), "-lm"]
    subprocess.run(cc, cwd=folder, check=True)
    (folder / "arm_in_lerobot.py").write_text(block("arm_in_lerobot.py"))
    spec = importlib.util.spec_from_file_location("arm_in_lerobot", folder / "arm_in_lerobot.py")
    page = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(page)
    robot = load_robot(LEG / "hrp2_like_leg.yaml")
    arm = Arm(robot.joints, np.degrees(robot.posture))
    page.float_arm(arm, robot.joints, str(library), 0.7)  # longer than the guard's start
    assert len(arm.sent) in (700, 701)  # sums of the period end before or behind the duration
    first = np.radians([arm.sent[0][f"{name}.pos"] for name in robot.joints])
    np.testing.assert_allclose(first, robot.posture, atol=1e-6)
    plant = make_plant(robot, 0.0)
    context = plant.CreateDefaultContext()
    places = [plant.GetJointByName(name).position_start() for name in robot.joints]
    q = np.zeros(plant.num_positions())
    q[places] = robot.posture
    plant.SetPositions(context, q)
    gravity = -plant.CalcGravityGeneralizedForces(context)[places]
    knee = robot.joints.index("r_knee")
    lead = np.radians(arm.sent[-1]["r_knee.pos"]) - robot.posture[knee]
    assert abs(gravity[knee]) > 1.0
    np.testing.assert_allclose(lead, 5.1e-5 * gravity[knee] + np.sign(gravity[knee]) * 2e-4, rtol=1e-6)


def test_without_a_file_the_command_says_what_it_needs(capsys):
    assert run(["export", str(LEG / "hrp2_like_leg_actuators.yaml"), "--to", "c"]) == 2
    assert "expected --out NAME.c" in capsys.readouterr().err
