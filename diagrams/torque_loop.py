"""A torque loop wired system by system, to copy and change: a leg that swings, without joint-torque sensors.

    reference --> inverse_dynamics --> torque_control --> guard --> actuators --> plant --> encoder, imu, force_torque
                       ^                    ^               ^                                      |
                       |--- torque_estimator|               |-- fault_monitor <---- raw readings --|
                                 ^--------- filter <-----------------------------------------------|

    python -m drake_tc.diagrams.torque_loop                        # swings the leg, prints the tracking errors
    drake-tc graph drake_tc.diagrams.torque_loop:build --out loop.svg
    drake-tc simulate drake_tc.diagrams.torque_loop:build --duration 2.6 --out out/loop

`hrp2_leg.py` runs the same loop from files of scenarios, with more options.
"""

from pathlib import Path
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Demultiplexer, LogVectorOutput, TrajectorySource

from drake_tc.actuation.model_file import models_of_joints
from drake_tc.actuation.wiring import add_actuators
from drake_tc.control.gains import TorqueGains
from drake_tc.control.guard import CommandGuard
from drake_tc.control.inverse_dynamics import InverseDynamics
from drake_tc.control.torque_control import TorqueControl
from drake_tc.control.trajectories import knot_trajectory
from drake_tc.estimation.joint_torque import JointTorqueEstimator
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.loops.loop_builder import LoopBuilder
from drake_tc.robot.plant import add_robot, joint_limits
from drake_tc.robot.robot import load_robot
from drake_tc.sensing.suite import SensorSuiteSpec, add_sensors
from drake_tc.sensor_validation.fault_monitor import FaultMonitor
from drake_tc.sensor_validation.monitor_spec import MonitorSpec

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
    n, models = len(robot.joints), models_of_joints(str(robot.actuators), robot.joints)

    # The simulated robot: plant, actuators with friction, and sensors.
    builder = DiagramBuilder()
    plant: Any = builder.AddNamedSystem("plant", MultibodyPlant(PERIOD))
    add_robot(plant, robot)
    plant.SetUseSampledOutputPorts(False)  # sensors read the state of now
    plant.Finalize()
    actuators = add_actuators(builder, plant, models, PERIOD)
    sensors: Any = add_sensors(builder, plant, robot, SensorSuiteSpec.realistic(), PERIOD)
    encoder, imu = sensors.encoder.GetOutputPort("reading"), sensors.imu.GetOutputPort("reading")
    wrench = sensors.force_torque.GetOutputPort("reading")

    # What is estimated: joint motions, and joint torques and contact wrenches from encoders, IMU and F/T sensors.
    loop = LoopBuilder(builder, None, plant, PERIOD)
    estimates = loop.filtered_readings(sensors, window=80, orders=(2, 1))
    model = TorqueModel(robot, angular_acceleration="zero")  # of the base, which is welded
    estimator = loop.add("torque_estimator", JointTorqueEstimator(model), **estimates)

    # What is wanted: [q_d; qdot_d; qddot_d], and the torques for it.
    table = np.array([KNOTS.get(joint, (0.0,) * len(TIMES)) for joint in robot.joints])
    for joint, position in zip(robot.joints, table[:, 0], strict=True):
        plant.GetJointByName(joint).set_default_angle(position)
    source = builder.AddNamedSystem("reference", TrajectorySource(knot_trajectory(TIMES, table.T), 2))
    reference = source.get_output_port()
    split = builder.AddNamedSystem("reference_velocity", Demultiplexer([n, n, n]))
    builder.Connect(reference, split.get_input_port())
    gain = np.array([model.drive.gain for model in models.values()])
    kp, nil = np.full(n, 2.0), np.zeros(n)
    gains = TorqueGains(kp, nil, 1.0 / (gain * (1.0 + kp)), 0.01 / (gain * (1.0 + kp)), np.zeros(6))
    known = {"joint_estimate": estimates["joint_estimate"], "position": encoder}
    law = InverseDynamics(robot, gains, configuration="reference", position_error="encoder", force_task=False)
    dynamics = loop.add("inverse_dynamics", law, reference=reference, **known)

    # From torques to the commands of the drives, and what watches over them.
    control = loop.add(
        "torque_control",
        TorqueControl(list(models.values()), gains, joint_limits(robot).effort, PERIOD),
        estimated_torque=estimator.GetOutputPort("estimated_torque"),
        reference=reference,
        **known,
        **{name: dynamics.GetOutputPort(name) for name in ("desired_torque", "torque_terms")},
    )
    touch = estimator.GetOutputPort("contact_wrench")
    readings = {"encoder": encoder, "imu": imu, "wrench": wrench, "contact_wrench": touch}
    monitor = FaultMonitor(robot, MonitorSpec(), PERIOD)
    loop.add("fault_monitor", monitor, reference_velocity=split.get_output_port(1), **readings)
    command, fault = control.GetOutputPort("command"), monitor.GetOutputPort("any_fault")
    guard = loop.add("guard", CommandGuard(n, PERIOD), command=command, position=encoder, fault=fault)
    builder.Connect(guard.GetOutputPort("command"), actuators.GetInputPort("command"))

    for name, port in (("state", plant.get_state_output_port()), ("wanted", reference)):
        LogVectorOutput(port, builder, PERIOD).set_name(name)
    return builder.Build()


def main() -> None:
    """Swing the leg, and print the RMS tracking error of each joint."""
    diagram: Any = build()
    robot, simulator = load_robot(ROBOT), Simulator(diagram)
    simulator.AdvanceTo(DURATION)
    logs = [diagram.GetSubsystemByName(name).FindLog(simulator.get_context()) for name in ("state", "wanted")]
    state, wanted = (log.data() for log in logs)
    n = len(robot.joints)
    for joint, error in zip(robot.joints, wanted[:n, 700:] - state[:n, 700:], strict=True):
        print(f"{joint:<16}{1e3 * np.sqrt(np.mean(error**2)):8.2f} mrad")


if __name__ == "__main__":
    main()
