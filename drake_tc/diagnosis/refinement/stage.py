"""The stage of `close-loop` that refines a joint's model on the free runs of its training runs.

Every choice is made on the training runs alone. The refined model is accepted where

1. refined on the other runs, it follows each left-out run in turn better: the mean absolute position error over all of
   them falls by at least `LEAST_GAIN`,
2. refined on all of them, it follows the whole training runs better by the same share, and
3. its numbers are physically possible, as far as those of the equation error were.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.recorded_run import in_plant
from drake_tc.diagnosis.data.preparation import context_of
from drake_tc.diagnosis.problem.columns import Columns, coefficients_by_term, prior_coefficients
from drake_tc.diagnosis.problem.parameters import physical_parameters, shape_places, with_shapes
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.problem.unknown_load import with_torque_span
from drake_tc.diagnosis.refinement.trials import start_of, trials_of, whole_runs
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import JointResult, RefinedParameter, Refinement, named_values
from drake_tc.diagnosis.result.models import model_of
from drake_tc.diagnosis.thresholds import LEAST_FREE_RUN_GAIN, RESOLVED_FREE_RUN
from drake_tc.effects.base import Context
from drake_tc.effects.check import implausible, plausible_range
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
from drake_tc.types import FloatArray

Progress = Callable[[str, float], None]
MOST_FOLDS = 4
OPTIONS, ONE_ROUND = OutputErrorOptions(), OutputErrorOptions(rounds=1)
EXACT = 1e-6
"""Largest relative difference of the numbers that the coefficients give back."""


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
    progress("refinement on free runs", 0.0)
    model = model_of(result, final=True)
    context = _context(result, rig, model)
    trials = trials_of(train, rig, result.joint, OPTIONS.step)
    if not _can_run(model, trials):
        return Refinement("nothing_to_simulate")
    start = start_of(model, context)
    free = free_parameters(start, _ranges(result, start, context))
    if not free.entries:
        return Refinement("nothing_to_refine")
    whole = whole_runs(train, rig, result.joint, OPTIONS.step)
    case = _Case(result, model, context, FreeRunErrors(free, trials, OPTIONS.step, executor), whole, progress)
    before = mean_absolute(model, whole)
    resolution = result.train.samples.resolution
    if before <= RESOLVED_FREE_RUN * max(resolution.position_step, resolution.position_noise):
        return Refinement("resolved", train=(before, before))
    return case.refined(before)


@dataclass(eq=False)
class _Case:
    """One joint's refinement.

    Attributes:
        result: Its diagnosis. model: The model after. context: What the training rows span.
        errors: Free parameters and the stretches that the search follows. whole: The training runs.
        progress: Told how far it is. steps: Gauss-Newton steps so far.
    """

    result: JointResult
    model: ActuatorModel
    context: Context
    errors: FreeRunErrors
    whole: Sequence[Trial]
    progress: Progress
    steps: int = 0

    def refined(self, before: float) -> Refinement:
        """What comes of it; `before`: mean absolute error of the model after on the training runs [rad]."""
        folds = folds_of(self.errors.trials)
        everything = range(len(self.errors.trials))
        first = refine_on_free_runs(self.errors, everything, ONE_ROUND, lambda: self._step(len(folds)))
        own = float(np.mean(np.abs(self.errors.at([first.x], everything)[0])))
        kept = Refinement("no_gain", train=(before, mean_absolute(first.model, self.whole)))
        if not _better((mean_absolute(self.model, self.errors.trials), own)):  # no run left out would do better
            return kept
        validated = self._cross_validated(folds)
        if validated is not None and not _better(validated):
            return replace(kept, cross_validated=validated)
        refined = refine_on_free_runs(self.errors, everything, OPTIONS, lambda: self._step(len(folds))).model
        after = mean_absolute(refined, self.whole)
        changes = _changes(self.result, self.model, self.errors.free, refined)
        made = Refinement("no_gain", parameters=changes, train=(before, after), cross_validated=validated)
        if not _better((before, after)):
            return made
        objection = _objection(self.model, refined, self.context)
        if objection:
            return replace(made, status="implausible", why=objection)
        made = replace(made, status="accepted", model=refined)
        splits = (self.result.train, self.result.heldout)
        named = named_values(refined)  # not a declared inertia, which is part of the balance's target
        fitted = {key: {n: named[key][n] for n in group} for key, group in self.result.final_parameters.items()}
        balance = equation_errors(self.result.final, fitted, splits)
        return made if balance is None else replace(made, error_train=balance[0], error_heldout=balance[1])

    def _cross_validated(self, folds: Sequence[Sequence[int]]) -> tuple[float, float] | None:
        """(model after, refined on the other runs) mean absolute error [rad] on the runs left out; None for one run."""
        if not folds:
            return None
        trials = self.errors.trials
        before, after = [], []
        for fold in folds:
            others = [i for i in range(len(trials)) if i not in fold]
            x = refine_on_free_runs(self.errors, others, ONE_ROUND, lambda: self._step(len(folds))).x
            before += [trial_error(self.model, trials[i], OPTIONS.step) for i in fold]
            after.append(self.errors.at([x], fold)[0])
        made = [float(np.mean(np.abs(np.concatenate(parts)))) for parts in (before, after)]
        return made[0], made[1]

    def _step(self, folds: int) -> None:
        self.steps += 1
        expected = OPTIONS.evaluations * (folds + OPTIONS.rounds + ONE_ROUND.rounds)
        self.progress("refinement on free runs", min(self.steps / expected, 0.95))


def folds_of(trials: Sequence[Trial]) -> list[list[int]]:
    """Numbers of the trials by fold: a run is never split, and there are at most `MOST_FOLDS`; empty for one run."""
    runs = list(dict.fromkeys(t.run for t in trials))
    if len(runs) < 2:
        return []
    count = min(len(runs), MOST_FOLDS)
    fold = {run: k % count for k, run in enumerate(runs)}
    return [[i for i, t in enumerate(trials) if fold[t.run] == k] for k in range(count)]


def mean_absolute(model: ActuatorModel, trials: Sequence[Trial]) -> float:
    """Of the position error [rad], over all trials; a run that has diverged errs by the recorded span."""
    return float(np.mean(np.abs(np.concatenate([trial_error(model, t, OPTIONS.step) for t in trials]))))


def _better(errors: tuple[float, float]) -> bool:
    return errors[1] <= (1.0 - LEAST_FREE_RUN_GAIN) * errors[0]


def _can_run(model: ActuatorModel, trials: Sequence[Trial]) -> bool:
    if not trials:
        return False
    placed = in_plant(model, trials[0].recording)
    if placed is None:
        return False
    actuator, recording = placed
    loaded = recording.load_torque is not None or recording.pendulum is not None
    return loaded and (actuator.inertia > 0.0 or recording.pendulum is not None)


def _context(result: JointResult, rig: Rig, model: ActuatorModel) -> Context:
    """What the training rows span, with the fitted values that other numbers are compared with."""
    named = named_values(model)
    own = {"gain": model.drive.gain, **{k: named[k][k] for k in ("viscous", "coulomb") if k in named}}
    samples = result.train.samples
    return replace(with_torque_span(context_of(samples, rig, result.joint), samples), fitted=own)


def _ranges(result: JointResult, model: ActuatorModel, context: Context) -> dict[tuple[str, str], tuple[float, float]]:
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


def _changes(
    result: JointResult, model: ActuatorModel, free: FreeParameters, refined: ActuatorModel
) -> tuple[RefinedParameter, ...]:
    old, new = named_values(model), named_values(refined)
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


def equation_errors(
    fitted: Fit, named: Mapping[str, Mapping[str, float]], splits: tuple[DataSplit, ...]
) -> tuple[float, ...] | None:
    """RMS of `equation_residuals` of each split; None where no coefficients have these numbers."""
    found = equation_residuals(fitted, named, splits)
    return None if found is None else tuple(float(np.sqrt(np.mean(residual**2))) for residual in found)


def equation_residuals(
    fitted: Fit, named: Mapping[str, Mapping[str, float]], splits: tuple[DataSplit, ...]
) -> tuple[FloatArray, ...] | None:
    """K (z - z_hat) [effort] of each split's rows under other numbers, with the fit's own K, so that both compare.

    The coefficients and shapes b that have these numbers solve  physical(b) = named;  None where no b has them.

    Args:
        fitted: The fit whose effects the model has.
        named: Numbers by effect key, "drive" with the gain among them.
        splits: Rows of the training and of the held-out runs.
    """
    where, _ = shape_places(fitted.terms)
    size = fitted.beta.size
    start = _guess(fitted, named, where)
    scale = np.where(start != 0.0, np.abs(start), 1e-3)

    def numbers(x: np.ndarray) -> np.ndarray:
        found = physical_parameters(fitted, x[:size], x[size:])
        return np.array([found[key][name] for key, group in named.items() for name in group])

    desired = np.array([value for group in named.values() for value in group.values()])
    finite = np.isfinite(desired)
    size_of = np.maximum(np.abs(desired), 1e-9)[finite]

    # What has a prior is not among the numbers and stays as it is.
    step_of = np.diag(scale)[:, ~np.append(prior_coefficients(fitted.terms), np.zeros(start.size - size, np.bool_))]

    def miss(step: np.ndarray) -> np.ndarray:
        difference = (numbers(start + step_of @ step)[finite] - desired[finite]) / size_of
        return np.asarray(np.nan_to_num(difference, nan=1e3, posinf=1e3, neginf=-1e3))

    found = least_squares(miss, np.zeros(step_of.shape[1]), xtol=1e-12, ftol=1e-15, gtol=1e-15, max_nfev=50)
    if np.abs(found.fun).max() > EXACT:
        return None
    b = start + step_of @ found.x
    terms = with_shapes(fitted.terms, where, b[size:])
    made = []
    for split in splits:
        columns = Columns(split.samples)
        less = columns.design(fitted.terms) @ fitted.beta - columns.design(terms) @ b[:size]
        made.append(np.asarray(split.after + less * fitted.gain))
    return tuple(made)


def _guess(fitted: Fit, named: Mapping[str, Mapping[str, float]], where: Sequence[tuple[int, str]]) -> FloatArray:
    """Coefficients and shapes by their own names where they are reported as such; most effects report nothing else."""
    beta = [1.0 / named["drive"]["gain"]]
    for term, theta in coefficients_by_term(fitted.terms, fitted.beta):
        own = named.get(term.effect.key, {})
        beta += [own.get(p.name, float(t)) for p, t in zip(term.effect.coefficients, theta, strict=True)]
    shapes = [named[fitted.terms[i].effect.key].get(name, fitted.terms[i].shape[name]) for i, name in where]
    return np.array([*beta, *shapes])
