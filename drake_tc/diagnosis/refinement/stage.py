"""The stage of `close-loop` that refines a joint's model on the free runs of its training runs.

Every choice is made on the training runs alone. The refined model is accepted where

1. refined on the other runs, it follows each left-out run in turn better: the mean absolute position error over all of
   them falls by at least `LEAST_GAIN`,
2. refined on all of them, it follows the whole training runs better by the same share, and
3. its numbers are physically possible, as far as those of the equation error were.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.recorded_run import with_load_placed
from drake_tc.diagnosis.data.preparation import context_of
from drake_tc.diagnosis.refinement.balance import equation_errors
from drake_tc.diagnosis.refinement.trials import trials_of, whole_runs
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.models import model_of
from drake_tc.diagnosis.result.refinement import RefinedParameter, Refinement, named_values
from drake_tc.diagnosis.thresholds import LEAST_FREE_RUN_GAIN, RESOLVED_FREE_RUN
from drake_tc.effects.base import Context
from drake_tc.effects.plausibility import implausible, plausible_range
from drake_tc.identification.free_parameters import DRIVE, FreeParameters, free_parameters
from drake_tc.identification.output_error import (
    FreeRunErrors,
    OutputErrorOptions,
    Trial,
    refine_on_free_runs,
    trial_error,
)
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig

Progress = Callable[[str, float], None]
MOST_FOLDS = 4
OPTIONS = OutputErrorOptions()


def refine_joint(
    result: JointResult,
    rig: Rig,
    train: Sequence[Run],
    executor: Executor | None = None,
    progress: Progress = lambda text, share: None,
) -> Refinement:
    """Refine the model after on the free runs of the training runs, or say why it stays as it is.

    Args:
        result: The joint's diagnosis.
        rig: Says drive and load.
        train: The training runs, with the loads that the model after was fitted to.
        executor: Runs the simulations beside each other; None runs them here.
        progress: Told how far it is.
    """
    progress("output error", 0.0)
    model = model_of(result, final=True)
    context = _context(result, rig, model)
    trials = trials_of(train, rig, result.joint, OPTIONS.step)
    if not _can_run(model, trials):
        return Refinement("nothing_to_simulate")
    free = free_parameters(model, _ranges(result, model, context))
    if not free.entries:
        return Refinement("nothing_to_refine")
    whole = whole_runs(train, rig, result.joint, OPTIONS.step)
    before = mean_absolute(model, whole)
    resolution = result.train.samples.resolution
    if before <= RESOLVED_FREE_RUN * max(resolution.position_step, resolution.position_noise):
        return Refinement("resolved", train=(before, before))
    return _refined(result, free, (trials, whole), before, context, _Search(executor, progress))


class _Search:
    """How the searches of one joint run, and how far they are."""

    def __init__(self, executor: Executor | None, progress: Progress) -> None:
        self.executor, self._progress = executor, progress
        self._done, self.expected = 0, 1

    def step(self) -> None:
        """One Gauss-Newton step is done."""
        self._done += 1
        self._progress("output error", min(self._done / self.expected, 0.95))


def _refined(
    result: JointResult,
    free: FreeParameters,
    runs: tuple[Sequence[Trial], Sequence[Trial]],
    before: float,
    context: Context,
    search: _Search,
) -> Refinement:
    trials, whole = runs
    errors = FreeRunErrors(free, trials, OPTIONS.step, search.executor)
    folds = folds_of(trials)
    search.expected = 2 * OPTIONS.evaluations * (len(folds) + 1)
    validated = _cross_validated(errors, folds, search)
    if validated is not None and not _better(validated):
        return Refinement("no_gain", train=(before, before), cross_validated=validated)
    refined = refine_on_free_runs(errors, range(len(trials)), OPTIONS, search.step).model
    made = Refinement(
        "no_gain",
        parameters=_changes(result, free, refined),
        train=(before, mean_absolute(refined, whole)),
        cross_validated=validated,
    )
    if made.train is None or not _better(made.train):
        return made
    objection = _objection(free.model, refined, context)
    if objection:
        return replace(made, status="implausible", why=objection)
    balance = equation_errors(result.final, _fitted_values(result, refined), (result.train, result.heldout))
    made = replace(made, status="accepted", model=refined)
    return made if balance is None else replace(made, error_train=balance[0], error_heldout=balance[1])


def folds_of(trials: Sequence[Trial]) -> list[list[int]]:
    """Numbers of the trials by fold: a run is never split, and there are at most `MOST_FOLDS`; empty for one run."""
    runs = list(dict.fromkeys(t.run for t in trials))
    if len(runs) < 2:
        return []
    count = min(len(runs), MOST_FOLDS)
    fold = {run: k % count for k, run in enumerate(runs)}
    return [[i for i, t in enumerate(trials) if fold[t.run] == k] for k in range(count)]


def _cross_validated(
    errors: FreeRunErrors, folds: Sequence[Sequence[int]], search: _Search
) -> tuple[float, float] | None:
    """(equation error's model, refined) mean absolute error [rad] on trials of the runs left out; None for one run."""
    if not folds:
        return None
    start = errors.free.start
    before, after = [], []
    for fold in folds:
        others = [i for i in range(len(errors.trials)) if i not in fold]
        x = refine_on_free_runs(errors, others, OPTIONS, search.step).x
        before.append(errors.at([start], fold)[0])
        after.append(errors.at([x], fold)[0])
    made = [float(np.mean(np.abs(np.concatenate(parts)))) for parts in (before, after)]
    return made[0], made[1]


def mean_absolute(model: ActuatorModel, trials: Sequence[Trial]) -> float:
    """Of the position error [rad], over all trials; a run that has diverged errs by the recorded span."""
    return float(np.mean(np.abs(np.concatenate([trial_error(model, t, OPTIONS.step) for t in trials]))))


def _better(errors: tuple[float, float]) -> bool:
    return errors[1] <= (1.0 - LEAST_FREE_RUN_GAIN) * errors[0]


def _can_run(model: ActuatorModel, trials: Sequence[Trial]) -> bool:
    if not trials:
        return False
    placed = with_load_placed(model, trials[0].recording)
    if placed is None:
        return False
    actuator, recording = placed
    loaded = recording.load_torque is not None or recording.pendulum is not None
    return loaded and (actuator.inertia > 0.0 or recording.pendulum is not None)


def _context(result: JointResult, rig: Rig, model: ActuatorModel) -> Context:
    """What the training rows span, with the fitted values that other numbers are compared with."""
    named = named_values(model)
    own = {"gain": model.drive.gain, **{k: named[k][k] for k in ("viscous", "coulomb") if k in named}}
    context = context_of(result.train.samples, rig, result.joint)
    if context.load == "unknown":
        torque = result.train.samples.signals.load_torque[result.train.samples.rows]
        context = replace(context, torque_span=(float(torque.min()), float(torque.max())))
    return replace(context, fitted=own)


def _ranges(
    result: JointResult, model: ActuatorModel, context: Context
) -> dict[tuple[str, str], tuple[float, float]]:
    """The physically possible range of each number, and the interval of the drive's gain."""
    out = {(DRIVE, "gain"): result.final_parameters[DRIVE]["gain"].ci95}
    for value in model.effects:
        for parameter in value.effect.parameters:
            out[value.key, parameter.name] = plausible_range(parameter, context)
    return out


def _objection(before: ActuatorModel, after: ActuatorModel, context: Context) -> str:
    """Why the refined numbers are not possible; "" where they are, or where those before were not either."""
    for old, new in zip(before.effects, after.effects, strict=True):
        why = implausible(new.effect, new.parameters, context)
        if why and not implausible(old.effect, old.parameters, context):
            return why
    return ""


def _fitted_values(result: JointResult, model: ActuatorModel) -> dict[str, dict[str, float]]:
    """The model's numbers that the fit has: not a declared inertia, which is part of the balance's target."""
    named = named_values(model)
    return {key: {name: named[key][name] for name in group} for key, group in result.final_parameters.items()}


def _changes(result: JointResult, free: FreeParameters, refined: ActuatorModel) -> tuple[RefinedParameter, ...]:
    old, new = named_values(free.model), named_values(refined)
    resting = {v.key: v.at_bound for v in refined.effects}
    return tuple(
        RefinedParameter(
            e.key,
            e.name,
            result.final_parameters[e.key][e.name].unit,
            old[e.key][e.name],
            new[e.key][e.name],
            e.name in resting.get(e.key, ()),
        )
        for e in free.entries
    )
