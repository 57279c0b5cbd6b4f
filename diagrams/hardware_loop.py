"""A torque controller against a robot in another process, on LCM or behind two functions of your own.

    python -m drake_tc.diagrams.hardware_loop robot                              # one shell: the simulated robot
    drake-tc run drake_tc.diagrams.hardware_loop:controller --duration 5         # another one: the controller
    drake-tc run drake_tc.diagrams.hardware_loop:controller --robot drake_tc.diagrams.hardware_loop:link --duration 2
    drake-tc graph drake_tc.diagrams.hardware_loop:controller --out controller.svg

`controller` is the Diagram from readings to commands, `robot` the other end. `link` runs both in one process, as a
driver in Python would. `docs/your_own_driver.md` explains each line.
"""

import sys
from pathlib import Path

import numpy as np

from drake_tc.actuation.model_file import load_models
from drake_tc.control.trajectories import knot_trajectory
from drake_tc.hardware.simulated_robot import LockStepLink, SimulatedRobot, serve
from drake_tc.loops.built_loop import Controller
from drake_tc.loops.torque.scenario import TorqueLoopSpec
from drake_tc.loops.torque.wiring import torque_controller
from drake_tc.robot.robot import load_robot

ROBOT = Path(__file__).parents[1] / "models" / "hrp2_like" / "hrp2_like_leg.yaml"
SPEC = TorqueLoopSpec(dt=1e-3, tare=0.3)
TIMES = (1.0, 1.5, 2.0, 2.5)
SWING = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, -0.3, 0.5, -0.2, 0.0]])
"""Away from the posture and back, twice [rad]."""


def controller() -> Controller:
    """The torque control of a leg: position, imu and force_torque in, command of the position servos out."""
    robot = load_robot(ROBOT)
    models = load_models(str(robot.actuators))
    motion = knot_trajectory(TIMES, robot.posture + SWING[[0, 1, 0, 1]])
    return torque_controller(robot, models, motion, SPEC, fused=True)


def robot() -> SimulatedRobot:
    """The leg, its drives and its sensors."""
    described = load_robot(ROBOT)
    return SimulatedRobot(described, load_models(str(described.actuators)), SPEC)


def link() -> LockStepLink:
    """The leg in the process of the controller."""
    return LockStepLink(robot())


if __name__ == "__main__":
    if sys.argv[1:2] != ["robot"] or len(sys.argv) > 3:
        sys.exit("expected: python -m drake_tc.diagrams.hardware_loop robot [real-time priority]")
    served = serve(robot(), priority=int(sys.argv[2]) if sys.argv[2:] else 0)
    print(f"{served.ticks} ticks, {served.commands} commands, {served.overruns} overruns")
