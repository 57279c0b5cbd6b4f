"""A robot from its runs to its result."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.shared.columns_of_runs import columns_over
from drake_tc.diagnosis.problem.shared.momentum import momenta_over
from drake_tc.diagnosis.robot.case import RobotCase
from drake_tc.diagnosis.robot.fitted_links import diagnose_fitted
from drake_tc.diagnosis.robot.result import RobotResult
from drake_tc.diagnosis.robot.shared_causes import diagnose_shared
from drake_tc.diagnosis.robot.whole import diagnose_whole
from drake_tc.diagnosis.selection.engine import Progress
from drake_tc.diagnosis.thresholds import FITTED_LINKS, JOINT, LEAST_REMOVED_OF_ESTIMATED_LOAD
from drake_tc.estimation.coupled_gears import motor_turns
from drake_tc.estimation.robot_loads import RobotLogs, with_robot_loads
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig


def diagnose_robot(
    logs: RobotLogs,
    train_runs: Sequence[Run],
    held_runs: Sequence[Run],
    rig: Rig,
    options: DiagnosisOptions,
    progress: Progress = lambda text, share: None,
    executor: Executor | None = None,
) -> RobotResult:
    """Diagnose a robot. The held-out runs are looked at only after every choice is made.

    Args:
        logs: The robot's model.
        train_runs: As recorded, to fit.
        held_runs: Held-out runs as recorded.
        rig: With a `RobotLoad`.
        options: Of the joints' own diagnosis.
        progress: Told how far it is.
        executor: Diagnoses joints beside each other; None: one after the other, here.

    Raises:
        LogError: a sensor is missing, or a log too short.
        IdentificationError: a joint whose runs cannot identify even the declared model.
    """
    progress("the robot's torques", 0.0)
    train = with_robot_loads(logs, train_runs, rig.joints)
    held = with_robot_loads(logs, held_runs, rig.joints)
    progress("what all joints share", 0.0)
    if (options.robots or options.engine) == "evidence":
        return diagnose_whole(logs, train, held, rig, options, progress, executor)
    if logs.links is not None and options.search == JOINT:
        options = replace(options, search=FITTED_LINKS)
    least = max(options.search.least_removed, LEAST_REMOVED_OF_ESTIMATED_LOAD)
    options = replace(options, search=replace(options.search, least_removed=least))
    turns = None if logs.turns is None else motor_turns(rig.coupled, rig.joints)
    case = RobotCase(train, held, rig, columns_over(logs, [*train, *held], rig), options, progress, executor, turns)
    if logs.links is None:
        return diagnose_shared(case, logs)
    momenta = momenta_over(logs, logs.links, (train, held), rig)
    return diagnose_fitted(replace(case, momenta=momenta), logs, logs.links)
