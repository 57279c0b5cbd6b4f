"""A torque loop to copy and change: a leg that swings, without joint-torque sensors.

    reference --> inverse_dynamics --> torque_control --> guard --> actuators --> plant --> encoder, imu, force_torque
                       ^                    ^               ^                                      |
                       |--- torque_estimator|               |-- fault_monitor <---- raw readings --|
                                 ^--------- filter <-----------------------------------------------|

    python -m drake_tc.diagrams.torque_loop                        # swings the leg, prints the tracking errors
    drake-tc graph drake_tc.diagrams.torque_loop:build --out loop.svg
    drake-tc simulate drake_tc.diagrams.torque_loop:build --duration 2.6 --out out/loop

`docs/your_own_diagram.md` explains each line, and how a stage is replaced by a system of your own. `hrp2_leg.py` runs
the same loop from files of scenarios.
"""

from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from drake_tc.actuation.model_file import load_models
from drake_tc.control.gains import TorqueGains
from drake_tc.control.trajectories import knot_trajectory
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.torque.scenario import TorqueLoopSpec
from drake_tc.loops.torque.wiring import add_torque_loop
from drake_tc.robot.robot import load_robot

ROBOT = Path(__file__).parents[1] / "models" / "hrp2_like" / "hrp2_like_leg.yaml"
PERIOD, DURATION = 1e-3, 2.6
"""Of control, sensors and plant, and of the motion [s]."""
TIMES = (0.8, 1.15, 1.55, 2.0)
KNOTS = {
    "r_hip_pitch": (-0.45, -0.95, -1.3, -1.05),
    "r_knee": (0.87, 1.65, 1.75, 1.3),
    "r_ankle_pitch": (-0.42, -0.6, -0.5, -0.25),
}
"""Where the joints are at these times [s, rad]; the others stay at 0."""


def build() -> Diagram:
    """The diagram. Its default context has the leg at rest at the first knot."""
    robot = load_robot(ROBOT)
    models = load_models(str(robot.actuators))
    builder = DiagramBuilder()
    plant: Any = add_robot_plant(builder, robot, PERIOD)
    knots = np.array([KNOTS.get(joint, (0.0,) * len(TIMES)) for joint in robot.joints])
    for joint, position in zip(robot.joints, knots[:, 0], strict=True):
        plant.GetJointByName(joint).set_default_angle(position)
    motion = knot_trajectory(TIMES, knots.T)
    gains = TorqueGains.from_servo(models, k6=1.0, k7=0.01, kp=2.0, kf=np.zeros(6))
    loop = add_torque_loop(builder, plant, robot, models, motion, TorqueLoopSpec(dt=PERIOD, tare=0.0), gains=gains)
    for name in ("joint_state", "reference"):
        LogVectorOutput(loop.signals[name], builder, PERIOD).set_name(f"log_{name}")
    return builder.Build()


def main() -> None:
    """Swing the leg, and print the RMS tracking error of each joint."""
    diagram: Any = build()
    robot, simulator = load_robot(ROBOT), Simulator(diagram)
    simulator.AdvanceTo(DURATION)
    context, names = simulator.get_context(), ("log_joint_state", "log_reference")
    state, reference = (diagram.GetSubsystemByName(name).FindLog(context).data() for name in names)
    n = len(robot.joints)
    for joint, error in zip(robot.joints, reference[:n, 700:] - state[:n, 700:], strict=True):
        print(f"{joint:<16}{1e3 * np.sqrt(np.mean(error**2)):8.2f} mrad")


if __name__ == "__main__":
    main()
