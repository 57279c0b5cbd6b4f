"""Noise of a robot's joint torques, as the logs so far show it.

The noise s_j [N m] of joint j is the RMS residual of the first fit of the diagnosis: declared models, and the links
where these are fitted, of all joints together. Of its rows in T_j seconds, n_j are independent:

    rate_j = n_j/T_j

The information of a second is rate_j/s_j^2. White noise of the effort leaves it the same whatever width the filters of
the next run have: a wider filter lowers s_j^2 and the rate alike.
"""

from collections.abc import Sequence

import numpy as np

from drake_tc.diagnosis.data.samples import Samples, rms
from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.robot.whole import declared_robot
from drake_tc.errors import ParamsError
from drake_tc.estimation.robot_loads import robot_logs, with_robot_loads
from drake_tc.experiments.design.next_log import declared_fit
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
    logs, train = robot_logs(rig, runs), in_order(runs, rig)
    fits: dict[str, tuple[Evidence, Scored]] = {}
    if logs is None:
        for name in robot.joints:
            alone = declared_fit(prepare_joint(train, [], rig, name))
            fits[name] = alone.evidence, alone.best
    else:
        fit = declared_robot(logs, with_robot_loads(logs, train, rig.joints), [], rig, DiagnosisOptions())
        fits = {name: (fit.joints[name].evidence, fit.joints[name].best) for name in robot.joints}
    values = np.array([_noise(*fits[name]) for name in robot.joints])
    return RobotNoise(values[:, 0], values[:, 1])


def _noise(evidence: Evidence, scored: Scored) -> tuple[float, float]:
    """(noise [N m], independent samples per second)."""
    split = evidence.model.train
    independent = evidence.noise.share * split.rows.index.size
    return rms(evidence.residual(split, scored)) / float(scored.b[0]), independent / _seconds(split.samples)


def _seconds(samples: Samples) -> float:
    """Time in motion [s]."""
    return max(float(np.count_nonzero(samples.moving)) * samples.signals.period, 1e-9)
