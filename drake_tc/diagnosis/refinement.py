"""The stage of `close-loop` that refines a joint's model on the free runs of its training runs.

Every choice is made on the training runs alone. The refined model is accepted where

1. refined on the other runs, it follows each left-out run in turn better: the mean absolute position error over all of
   them falls by at least `LEAST_FREE_RUN_GAIN`,
2. refined on all of them, it follows the whole training runs better by the same share, and
3. its numbers are physically possible, as far as those of the equation error were.

It starts on stretches of the training runs within a budget of time, and from the numbers of the equation error. Those
that its rows cannot tell are started afresh: the rows of the equation are those in motion. A Stribeck velocity below
their speeds, or the time constant of a winding that hardly warms, ends at a bound or beyond all sense there, where a
search from it would not find the way back.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares

from drake_tc.actuation.model import ActuatorModel, EffectValue
from drake_tc.actuation.recorded_run import SHORTEST, in_plant, longest_stretch, loop_of, recording_of
from drake_tc.diagnosis.data.preparation import context_of
from drake_tc.diagnosis.priors import LEAST_FREE_RUN_GAIN, RESOLVED_FREE_RUN
from drake_tc.diagnosis.problem.columns import Columns, coefficients_by_term, prior_coefficients
from drake_tc.diagnosis.problem.parameters import physical_parameters, shape_places, with_shapes
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.problem.unknown_load import with_torque_span
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import JointResult, RefinedParameter, Refinement, named_values
from drake_tc.diagnosis.result.models import model_of
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

BUDGET = 48.0
"""Motion that is simulated at each point of the search [s], over all runs of all joints of a rig."""
LEAST_BUDGET = 12.0
"""The same of one joint at least [s]."""
LONGEST = {"position_servo": 12.0, "current": 2.0, "torque": 2.0, "voltage": 6.0}
"""Longest stretch [s] by drive: without a position loop errors add up, most of all those of a current drive."""
LEAST = 1.0
"""A stretch is at least as long [s], where the log has that much."""
MOST_TRIALS = 24
"""Stretches over all runs."""
STARTING_SHARE = 0.1
"""A coefficient without a usable estimate starts at this share of the largest value that is physically possible."""


def windows(run: Run, longest: float, share: float) -> list[slice]:
    """Stretches of one run of up to `longest` [s] each and about `share` [s] in all, evenly over the run.

    Shorter stretches than `LEAST` are left out where the run has a longer one.
    """
    usable = [s for s in run.segments() if s.stop - s.start >= SHORTEST]
    lasting = [s for s in usable if (s.stop - s.start) * run.period >= LEAST]
    size = max(round(min(longest, max(share, LEAST)) / run.period), SHORTEST)
    pieces: list[slice] = []
    for whole in lasting or usable:
        count = max(1, -(-(whole.stop - whole.start) // size))
        edges = np.linspace(whole.start, whole.stop, count + 1).astype(int)
        pieces += [slice(int(a), int(b)) for a, b in pairwise(edges) if b - a >= SHORTEST]
    count = max(1, int(share / max((np.median([p.stop - p.start for p in pieces] or [1]) * run.period), 1e-9) + 0.5))
    if count >= len(pieces):
        return pieces
    return [pieces[k] for k in np.linspace(0, len(pieces) - 1, count).round().astype(int)]


def longest_piece(lengths: Sequence[float], budget: float) -> float:
    """The longest motion [s] of each run with which runs of these lengths [s] stay within the budget [s]."""
    left, count = budget, len(lengths)
    for length in sorted(lengths):
        if length * count >= left:
            break
        left, count = left - length, count - 1
    return max(left / count, LEAST) if count else max(max(lengths), LEAST)


def trials_of(runs: Sequence[Run], rig: Rig, joint: str, step: float) -> list[Trial]:
    """What a refinement follows; a log faster than `step` [s] is thinned to it.

    A single run is dealt to two halves, which then count as runs of their own.
    """
    lengths = [sum((s.stop - s.start) * run.period for s in run.segments()) for run in runs]
    share = longest_piece(lengths, max(BUDGET / len(rig.joints), LEAST_BUDGET))
    closed = all(loop_of(rig, joint, run) is not None for run in runs)
    longest = LONGEST["position_servo" if closed else rig.drive[joint]]
    if len(runs) == 1:
        usable = longest_stretch(runs[0])
        length = 0.0 if usable is None else (usable.stop - usable.start) * runs[0].period
        longest = min(longest, max(0.5 * length, LEAST))
    found: list[Trial] = []
    for number, run in enumerate(runs):
        mine = windows(run, longest, share)[: max(1, MOST_TRIALS // len(runs))]
        for k, piece in enumerate(mine):
            half = (2 * k) // len(mine) if len(runs) == 1 else number
            found.append(_trial(run, rig, joint, piece, half, step))
    return found[:MOST_TRIALS]


def whole_runs(runs: Sequence[Run], rig: Rig, joint: str, step: float) -> list[Trial]:
    """The longest stretch of each run, as the reported free runs have it."""
    stretches = [(number, run, longest_stretch(run)) for number, run in enumerate(runs[:MOST_TRIALS])]
    return [_trial(run, rig, joint, s, number, step) for number, run, s in stretches if s is not None]


def _trial(run: Run, rig: Rig, joint: str, piece: slice, number: int, step: float) -> Trial:
    recording = recording_of(rig, joint, run, piece)
    stride = max(1, int(step / recording.period + 1e-9))
    position = run.columns[f"{joint}/position"][piece][::stride]
    return Trial(run.name, number, recording.thinned(stride) if stride > 1 else recording, position)


def start_of(model: ActuatorModel, context: Context) -> ActuatorModel:
    """The model with every effect of undetermined shape in the middle of the values that a search would try."""
    return replace(model, effects=tuple(_started(value, context) for value in model.effects))


def is_open(value: EffectValue) -> bool:
    """Whether the equation error leaves a shape of the effect undetermined: at a bound, or not to a factor of 2."""
    for parameter in value.effect.shapes:
        if parameter.name not in value.ci95:
            continue
        number, (low, high) = value.parameters[parameter.name], value.ci95[parameter.name]
        half = max(high - number, number - low)
        if parameter.name in value.at_bound or not 0.0 < half <= abs(number):
            return True
    return False


def _started(value: EffectValue, context: Context) -> EffectValue:
    if not is_open(value):
        return value
    grid = value.effect.shape_grid(context)
    numbers = dict(value.parameters)
    for parameter in value.effect.shapes:
        if parameter.name in value.ci95 and parameter.name in grid[0]:
            numbers[parameter.name] = _middle([shape[parameter.name] for shape in grid])
    for parameter in value.effect.coefficients:
        rests = parameter.name in value.at_bound or numbers.get(parameter.name) == 0.0
        most = plausible_range(parameter, context)[1]
        if parameter.name in value.ci95 and rests and parameter.lower >= 0.0 and math.isfinite(most):
            numbers[parameter.name] = STARTING_SHARE * most
    points = {name: (numbers[name], numbers[name]) for name in value.ci95}
    return EffectValue(value.key, numbers, points)


def _middle(values: list[float]) -> float:
    """Between the smallest and the largest, by their ratio where they are positive."""
    low, high = min(values), max(values)
    return math.sqrt(low * high) if low > 0.0 else float(np.median(values))


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
