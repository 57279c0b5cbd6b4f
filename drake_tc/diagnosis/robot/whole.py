"""A robot from its runs to its result: every joint's own search, beside what the joints share.

1. All joints together with their declared models: which causes that no single joint owns are missing, and how large
   everything is that they share (links that are fitted, errors of sensors within tolerance, the causes).
2. Each joint's own search on these loads, beside what the other joints know of the shared parameters (`joints`); until
   the joints' sets stay the same.
3. The causes once more, beside the joints' effects. A cause stands if all joints together are more probable with it
   than without it, each joint with the set that it needs then.
"""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.shared.columns_of_runs import columns_over
from drake_tc.diagnosis.problem.shared.momentum import momenta_over
from drake_tc.diagnosis.result.set_up import SetUpCheck, is_wrong
from drake_tc.diagnosis.robot.causes import Causes, Named, most_probable
from drake_tc.diagnosis.robot.joints import RobotFit, Shared, declared_fit, searched_fit
from drake_tc.diagnosis.robot.result import RobotResult
from drake_tc.diagnosis.robot.runs import RobotRuns
from drake_tc.diagnosis.robot.told import robot_result
from drake_tc.diagnosis.root_mean_square import rms
from drake_tc.diagnosis.search import Progress
from drake_tc.diagnosis.set_up.find import check_set_up
from drake_tc.estimation.coupled_gears import motor_turns
from drake_tc.estimation.robot_loads import RobotLogs
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.robot.link_parameters import link_model

PASSES = 4
"""Of choosing causes under the noise that the last ones leave."""
SWEEPS = 3
"""Of searching all joints beside what the others know."""


def diagnose_whole(
    logs: RobotLogs,
    train: Sequence[Run],
    held: Sequence[Run],
    rig: Rig,
    options: DiagnosisOptions,
    progress: Progress = lambda text, share: None,
    executor: Executor | None = None,
) -> RobotResult:
    """Diagnose a robot. The held-out runs are looked at only after every choice is made.

    Args:
        logs: The robot's model.
        train: Runs to fit, with loads by the robot's file.
        held: Held-out runs, the same.
        rig: With a `RobotLoad`.
        options: Of the diagnosis.
        progress: Told how far it is.
        executor: Assesses what is left in its workers; None does it here.

    Raises:
        IdentificationError: a joint whose runs cannot identify even the declared model.
    """
    turns = None if logs.turns is None else motor_turns(rig.coupled, rig.joints)
    momenta = None if logs.links is None else momenta_over(logs, logs.links, (train, held), rig)
    runs = RobotRuns(train, held, rig, columns_over(logs, [*train, *held], rig), options, progress, turns, momenta)
    before = without_causes(runs)
    set_up = _set_up(logs, runs, before)
    if is_wrong(set_up):
        none = replace(runs, options=replace(options, effects=(), assess_residual=False))
        fit = searched(replace(before, runs=none))
        return robot_result(logs, before, fit, Named.none(), Causes.of(before), set_up, executor)
    causes = Causes.of(before)
    fit, named = with_causes(before, causes)
    fit = searched(fit)
    again = most_probable(fit, causes)
    if {c.key for c in again.causes} != {c.key for c in named.causes}:
        fit, named = searched(at(fit, causes.shared(again.causes))), again
    if named.causes:
        alone = searched(before)
        if alone.log_odds >= fit.log_odds + causes.prior_odds(named.causes):
            fit, named = alone, Named.none()
    return robot_result(logs, before, fit, named, causes, set_up, executor)


def without_causes(runs: RobotRuns) -> RobotFit:
    """All joints with their declared models and errors within tolerance, links that are fitted among them."""
    zero = np.zeros(runs.width)
    nobody = Shared.within_tolerance(runs.every_cause)
    fit = declared_fit(runs, nobody, zero, tempered=True)
    for _ in range(PASSES if nobody.places.size else 0):
        fit = declared_fit(runs, nobody, fit.moved(), fit, tempered=True)
    return fit


def with_causes(before: RobotFit, causes: Causes) -> tuple[RobotFit, Named]:
    """The most probable causes beside the declared models, each pass under the noise that the last ones leave."""
    named, fit = most_probable(before, causes), before
    for _ in range(PASSES):
        fit = replace(fit, shared=causes.shared(named.causes))
        fit = declared_fit(fit.runs, fit.shared, fit.moved(), fit)
        again = most_probable(fit, causes)
        if {c.key for c in again.causes} == {c.key for c in named.causes}:
            return fit, again
        named = again
    return fit, named


def at(fit: RobotFit, shared: Shared) -> RobotFit:
    """The fit with other shared parameters, its joints as they are."""
    return replace(fit, shared=shared)


def searched(fit: RobotFit) -> RobotFit:
    """All joints with the sets of effects that they lack."""
    for _ in range(SWEEPS):
        before = fit.sets
        fit = searched_fit(fit, fit.moved())
        if fit.sets == before or not fit.shared.places.size:
            break
    return fit


def _set_up(logs: RobotLogs, runs: RobotRuns, before: RobotFit) -> SetUpCheck | None:
    """What the runs say against the set-up; None where this is not looked at or little of every effort is left."""
    links = logs.links
    if links is None:
        if not logs.robot.fixed_base or logs.reads_imu or logs.robot.force_torque:
            return None
        links = link_model(logs.robot)
    left = {name: _share_left(before, name) for name in before.joints}
    return check_set_up(logs, links, runs.train, runs.held, runs.rig, left)


def _share_left(fit: RobotFit, name: str) -> float:
    joint = fit.joints[name]
    train = joint.evidence.model.train
    spread = float(np.std(train.recorded.effort(())))
    return rms(joint.evidence.residual(train, joint.best)) / max(spread, 1e-300)
