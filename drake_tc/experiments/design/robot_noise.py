"""Noise of a robot's joint torques, as the logs so far show it.

Where links are fitted, the noise s_j [N m] of joint j is the RMS residual of the first fit of the diagnosis: declared
models and links of all joints together. Of its N_j rows in T_j seconds, n_j are independent:

    rate_j = n_j/T_j = (n_j/N_j) N_j/T_j

A fit with the links of the robot's file would count the error of these links as noise. The information of a second is
rate_j/s_j^2. White noise of the effort leaves it the same whatever width the filters of the next run have: a wider
filter lowers s_j^2 and the rate alike.
"""

from collections.abc import Sequence

import numpy as np

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.shared.causes import columns_over
from drake_tc.diagnosis.robot.case import RobotCase
from drake_tc.diagnosis.robot.start import as_commanded, in_wide_enough_band
from drake_tc.diagnosis.run import in_order
from drake_tc.estimation.coupled_gears import motor_turns
from drake_tc.estimation.robot_loads import robot_logs, with_robot_loads
from drake_tc.experiments.design.known import joint_from_logs
from drake_tc.experiments.design.robot_goal import RobotNoise
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.robot.robot import Robot


def robot_noise(rig: Rig, robot: Robot, runs: Sequence[Run]) -> RobotNoise:
    """Noise and independent samples per second of each joint, in the order of the robot's joints.

    Args:
        rig: Of the logs, with a robot.
        robot: The same robot.
        runs: The logs so far, as read.

    Raises:
        LogError: A column that the robot's model needs is missing.
        IdentificationError: Logs that do not identify the declared models.
    """
    logs = robot_logs(rig, runs)
    if logs is None or logs.links is None:
        joints = {name: joint_from_logs(rig, runs, name)[0] for name in rig.joints}
        known = {name: (each.noise, each.independent_per_second) for name, each in joints.items()}
    else:
        train = with_robot_loads(logs, in_order(runs, rig), rig.joints)
        turns = None if logs.turns is None else motor_turns(rig.coupled, rig.joints)
        causes = columns_over(logs, train, rig)
        case = RobotCase(train, [], rig, causes, DiagnosisOptions(), lambda text, share: None, None, turns)
        links = as_commanded(in_wide_enough_band(case)).links
        known = {}
        for j, rows in enumerate(links.rows):
            samples = rows.samples
            seconds = max(float(np.count_nonzero(samples.moving)) * samples.signals.period, 1e-9)
            rate = float(links.fitted.effective[j]) * rows.target.size / seconds
            known[rows.joint] = float(links.fitted.sigma[j]), rate
    values = np.array([known[name] for name in robot.joints])
    return RobotNoise(values[:, 0], values[:, 1])
