"""Output error: the parameters with which the free-running model follows the recorded position.

    min_x  (1/(rho s^2)) sum_k h(q_sim(t_k; x) - q_meas(t_k))  +  sum_i ((x_i - x0_i)/d_i)^2,
    h(e) = 2 s^2 (sqrt(1 + (e/s)^2) - 1)

q_sim is driven by the recorded command alone. A regression on the torque balance (equation error) needs the joint to
move and takes noisy derivatives for regressors; a joint that sticks and slips spends most of its time at rest, where
only the free run tells how much friction holds it. The equation error's estimate x0 with deviations d is the prior:
where the runs leave parameters undetermined, it decides (maximum a posteriori). s is the root of the mean squared error
and rho the number of samples in its correlation time, both of the model at hand: rows of one swing are no independent
evidence. h is the smooth L1 loss, because the error of a late slip is a step.

Source: Ljung, System Identification (1999), section 3.2 (output error); the simulation-error criterion of Duclusaud et
al. (2025) for servo friction, theirs minimised by CMA-ES.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field

import numpy as np

from drake_tc.actuation.free_run import simulate
from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.recorded_run import Recording, in_plant
from drake_tc.errors import IdentificationError, ParamsError
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.identification.free_parameters import FreeParameters
from drake_tc.types import FloatArray

CONVERGED = 1e-3
"""Relative change of the criterion, and of the point, at which a search ends."""


@dataclass(frozen=True)
class Trial:
    """One recorded stretch and its position.

    Attributes:
        name: For reports.
        run: Number of the run that it is of.
        recording: What the free run is given.
        position: (T,) recorded [rad].
    """

    name: str
    run: int
    recording: Recording
    position: FloatArray


@dataclass(frozen=True)
class OutputErrorOptions:
    """How the search goes.

    Attributes:
        step: Largest step of the simulation [s].
        evaluations: Most Gauss-Newton steps in each of the rounds.
        rounds: Searches, each with the scale of the errors that the one before it left.
    """

    step: float = 2e-3
    evaluations: int = 6
    rounds: int = 2


def trial_error(model: ActuatorModel, trial: Trial, step: float) -> FloatArray:
    """Simulated minus recorded position (T,) [rad], never NaN: a run that has diverged errs by the recorded span."""
    placed = in_plant(model, trial.recording)
    far = max(float(np.ptp(trial.position)), 1e-3)
    if placed is None:
        return np.full(trial.position.size, far)
    try:
        error = simulate(*placed, step) - trial.position
    except ParamsError:  # no inertia left
        return np.full(trial.position.size, far)
    return np.asarray(np.clip(np.nan_to_num(error, nan=far, posinf=far, neginf=-far), -far, far))


def _job(job: tuple[ActuatorModel, Trial, float]) -> FloatArray:
    return trial_error(*job)


@dataclass(eq=False)
class FreeRunErrors:
    """Errors of trials at points of the search, each simulated once: searches without one run share most of them."""

    free: FreeParameters
    trials: Sequence[Trial]
    step: float
    executor: Executor | None = None
    known: dict[tuple[int, bytes], FloatArray] = field(default_factory=dict)

    def at(self, points: Sequence[FloatArray], chosen: Sequence[int]) -> list[FloatArray]:
        """(sum of T,) over the chosen trials, for each point x (k,)."""
        requested = [(i, x) for x in points for i in chosen if (i, x.tobytes()) not in self.known]
        jobs = [(self.free.write(x), self.trials[i], self.step) for i, x in requested]
        made = map(_job, jobs) if self.executor is None else self.executor.map(_job, jobs, chunksize=4)
        for (i, x), error in zip(requested, made, strict=True):
            self.known[i, x.tobytes()] = error
        return [np.concatenate([self.known[i, x.tobytes()] for i in chosen]) for x in points]


@dataclass(frozen=True)
class OutputErrorFit:
    """A refined point: x (k,), its model, and whether the search moved at all."""

    x: FloatArray
    model: ActuatorModel


def refine_on_free_runs(
    errors: FreeRunErrors,
    chosen: Sequence[int],
    options: OutputErrorOptions,
    progress: Callable[[], None] = lambda: None,
) -> OutputErrorFit:
    """Refine a model's numbers until its free runs follow the recorded ones.

    Args:
        errors: The free parameters and trials.
        chosen: Numbers of the trials to follow.
        options: How.
        progress: Called once a Gauss-Newton step.

    Raises:
        IdentificationError: no trial, or nothing to change.
    """
    free = errors.free
    if not chosen or not free.entries:
        raise IdentificationError(
            f"output error: expected a trial and a free parameter, got {len(chosen)} and {len(free.entries)}"
        )
    x = free.start
    for _ in range(options.rounds):
        x = _search(errors, chosen, x, options.evaluations, progress)
    return OutputErrorFit(x, free.write(x))


def _search(
    errors: FreeRunErrors, chosen: Sequence[int], start: FloatArray, evaluations: int, progress: Callable[[], None]
) -> FloatArray:
    """One round from `start` (k,), with the scale of the errors there."""
    free = errors.free
    first = errors.at([start], chosen)[0]
    lengths = [errors.trials[i].position.size for i in chosen]
    scale = max(float(np.sqrt(np.mean(first**2))), 1e-9)
    weight = 1.0 / (scale * np.sqrt(correlation_time(first, lengths)))

    def rows(points: Sequence[FloatArray]) -> list[FloatArray]:
        made = errors.at(points, chosen)
        return [np.concatenate([weight * _soft(e, scale), _pull(free, x)]) for e, x in zip(made, points, strict=True)]

    from scipy.optimize import least_squares

    low, high = free.bounds

    def jacobian(x: FloatArray) -> FloatArray:
        progress()
        steps = np.where(x + free.steps <= high, free.steps, -free.steps)
        here, *moved = rows([x, *(x + np.diag(steps))])
        return np.stack([(there - here) / step for there, step in zip(moved, steps, strict=True)], axis=1)

    inside = 1e-9 * np.maximum(1.0, np.abs(start))
    found = least_squares(
        lambda x: rows([x])[0],
        np.clip(start, low + inside, high - inside),
        jac=jacobian,
        bounds=(low, high),
        x_scale=free.deviation,
        max_nfev=evaluations,
        xtol=CONVERGED,
        ftol=CONVERGED,
    )
    return np.asarray(found.x)


def _soft(error: FloatArray, scale: float) -> FloatArray:
    """The root of h, with the sign of the error."""
    size = (error / scale) ** 2
    return np.asarray(np.sign(error) * scale * np.sqrt(2.0 * size / (np.sqrt(1.0 + size) + 1.0)))


def _pull(free: FreeParameters, x: FloatArray) -> FloatArray:
    return np.asarray((x - free.start) / free.deviation)
