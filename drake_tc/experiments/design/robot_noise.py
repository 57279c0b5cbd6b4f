"""Noise of a robot's joint torques, as the logs so far show it.

Where links are fitted, the noise s_j [N m] of joint j is the RMS residual of the first fit of the diagnosis: declared
models and links of all joints together. Of its rows in T_j seconds, n_j are independent:

    rate_j = n_j/T_j

A fit with the links of the robot's file would count the error of these links as noise. The information of a second is
rate_j/s_j^2. White noise of the effort leaves it the same whatever width the filters of the next run have: a wider
filter lowers s_j^2 and the rate alike.
"""

from collections.abc import Sequence

import numpy as np

from drake_tc.diagnosis.data.samples import Samples, rms
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.robot.whole import declared_robot
from drake_tc.errors import ParamsError
from drake_tc.estimation.robot_loads import RobotLogs, robot_logs, with_robot_loads
from drake_tc.experiments.check.joint import joint_effects
from drake_tc.experiments.check.run import with_loads
from drake_tc.experiments.design.robot_goal import RobotNoise
from drake_tc.logs.prepare import in_order
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
        ParamsError: The rig file does not list all joints of the robot.
        LogError: A column that the robot's model needs is missing.
        IdentificationError: Logs that do not identify the declared models.
    """
    missing = [name for name in robot.joints if name not in rig.joints]
    if missing:
        raise ParamsError(
            f"{rig.source or 'rig'}: joints: {', '.join(missing)} missing; the noise of all joints of the robot is "
            "needed: list all of them, or design without logs"
        )
    logs = robot_logs(rig, runs)
    known = _of_known_links(rig, runs) if logs is None or logs.links is None else _of_fitted_links(rig, runs, logs)
    values = np.array([known[name] for name in robot.joints])
    return RobotNoise(values[:, 0], values[:, 1])


def _of_known_links(rig: Rig, runs: Sequence[Run]) -> dict[str, tuple[float, float]]:
    """Joint to (noise [N m], independent samples per second), each joint by itself with the loads of the robot."""
    loaded, used = with_loads(rig, runs)
    out = {}
    for joint in rig.joints:
        prepared = prepare_joint(loaded, [], used, joint)
        noise = joint_effects(prepared).noise
        out[joint] = noise.left, noise.independent / _seconds(prepared.train.samples)
    return out


def _of_fitted_links(rig: Rig, runs: Sequence[Run], logs: RobotLogs) -> dict[str, tuple[float, float]]:
    """The same of all joints together, whose links are fitted."""
    train = with_robot_loads(logs, in_order(runs, rig), rig.joints)
    fit = declared_robot(logs, train, [], rig, DiagnosisOptions())
    out = {}
    for name, joint in fit.joints.items():
        split = joint.evidence.model.train
        noise = rms(joint.evidence.residual(split, joint.best)) / float(joint.best.b[0])
        independent = joint.evidence.noise.share * split.rows.index.size
        out[name] = noise, independent / _seconds(split.samples)
    return out


def _seconds(samples: Samples) -> float:
    """Time in motion [s]."""
    return max(float(np.count_nonzero(samples.moving)) * samples.signals.period, 1e-9)
