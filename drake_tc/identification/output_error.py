"""Output-error identification: the parameters with which the free-running model follows the recorded position.

    min_x sum_k rho(q_sim(t_k; x) - q_meas(t_k)),    q_sim driven by the recorded command alone

A regression on the torque balance (equation error) weighs every sample alike and needs the joint to move; a joint that
sticks and slips spends most of its time at rest, where only the free run tells how much friction holds it. The
simulation is the actuator's own `JointProgram`, the code that runs in the Drake diagram, on a pendulum or a rotor:

    v[n+1] = v[n] + h (tau_actuator - m g l sin q[n] - tau_load)/J,    q[n+1] = q[n] + h v[n+1]

Positive parameters are sought by their logarithm. rho is the smooth L1 loss: at a stick-slip the error is a step.
Where the runs leave parameters undetermined, several sets follow them equally well; a prior model, if given, decides
between those by sum_i (pull (x_i - prior_i)/spread_i)^2, spread 1 for logarithms: maximum a posteriori.

Source: Ljung, System Identification (1999), section 3.2 (output error); the simulation-error criterion of Duclusaud et
al. (2025) for servo friction, theirs minimised by CMA-ES.
"""

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares

from drake_tc.actuation.joint_program import JointInput, JointProgram
from drake_tc.actuation.model import ActuatorModel, Drive
from drake_tc.actuation.position_loop import PositionLoop, through_loop
from drake_tc.errors import IdentificationError
from drake_tc.types import FloatArray

FARTHEST = 2.0
"""An error counts up to this much [rad]: a run that diverges is bad, not infinitely so."""
FINE_STEP = 1e-3
"""Step of the simulations whose errors are reported [s]."""
PARTS = 100
SMALLEST = 2e-3
"""A positive parameter that starts at 0 starts here instead, so that its logarithm can move."""


@dataclass(frozen=True)
class Trial:
    """One recorded run on a uniform clock, and what the joint carries in it.

    Attributes:
        name: For reports.
        period: [s].
        command: (T,) q_d [rad], or the effort of a drive without loop [A | V].
        position: (T,) recorded [rad].
        velocity: At the first sample [rad/s].
        inertia, gravity_moment: Of the link about the axis [kg m^2], and m g l [N m]; it hangs at q = 0.
        load: (T,) torque against the joint besides gravity [N m], or None.
        temperature: (T,) [deg C], or None.
        loop: The known position loop through which `command` acts; None where the drive takes it itself.
    """

    name: str
    period: float
    command: FloatArray
    position: FloatArray
    velocity: float
    inertia: float
    gravity_moment: float = 0.0
    load: FloatArray | None = None
    temperature: FloatArray | None = None
    loop: PositionLoop | None = None


@dataclass(frozen=True)
class OutputErrorOptions:
    """How the search goes.

    Attributes:
        fixed: Parameters that keep their value, `drive.gain` or `<effect key>.<parameter>`.
        step: Largest step of the simulation [s].
        knee: Error [rad] beyond which the loss grows linearly.
        evaluations: Most Gauss-Newton steps.
        prior: What a joint of this kind is like, with the same effects; None: nothing is known.
        pull: Weight of the prior [rad]: about sqrt(samples/independent samples) times the expected error.
    """

    fixed: frozenset[str] = field(default_factory=frozenset)
    step: float = 3e-3
    knee: float = 0.05
    evaluations: int = 25
    prior: ActuatorModel | None = None
    pull: float = 0.2


@dataclass(frozen=True)
class OutputErrorFit:
    """The refined model and its error on the runs it was fitted to.

    Attributes:
        model: With the refined numbers, without confidence intervals: errors of a stick-slip are no white noise.
        before, after: Mean absolute position error (trials,) [rad] with the starting model and with the refined one.
        evaluations: Steps taken.
    """

    model: ActuatorModel
    before: FloatArray
    after: FloatArray
    evaluations: int


def simulate(model: ActuatorModel, trial: Trial, step: float = FINE_STEP) -> FloatArray:
    """Position (T,) [rad] of the free-running joint; NaN from where it leaves 100 rad.

    Args:
        model: The actuator; effects of sensors and transmissions are left out.
        trial: Command, load and start.
        step: Largest step [s].

    Raises:
        IdentificationError: nothing that has inertia.
    """
    if trial.loop is not None:
        model = through_loop(model, trial.loop)
    sub = max(1, math.ceil(trial.period / step - 1e-9))
    h = trial.period / sub
    total = trial.inertia + model.inertia
    if not total > 0.0:
        raise IdentificationError(f"{trial.name}: wanted a link or rotor with inertia > 0 to simulate; got {total:g}")
    program = JointProgram(model, h, total)
    memory = program.initial(trial.velocity)
    commands = trial.command.tolist()
    size = len(commands)
    warmth = [25.0] * size if trial.temperature is None else trial.temperature.tolist()
    loads = [0.0] * size if trial.load is None else trial.load.tolist()
    q, v, moment = float(trial.position[0]), trial.velocity, trial.gravity_moment
    out = np.full(size, np.nan)
    for k in range(size):
        out[k] = q
        for _ in range(sub):
            torque = program.step(memory, JointInput(commands[k], q, v, None, warmth[k]), at_tick=True).actuation
            v += h * (torque - moment * math.sin(q) - loads[k]) / total
            q += h * v
        if not abs(q) < 100.0:
            break
    return out


@dataclass(frozen=True)
class _Free:
    """The free parameters: (index of the effect or -1 for the drive, name, lower, upper, searched by logarithm)."""

    entries: tuple[tuple[int, str, float, float, bool], ...]

    def read(self, model: ActuatorModel) -> FloatArray:
        values = [model.drive.gain if i < 0 else model.effects[i].parameters[n] for i, n, *_ in self.entries]
        return np.array([math.log(max(x, SMALLEST)) if e[4] else x for x, e in zip(values, self.entries, strict=True)])

    def write(self, model: ActuatorModel, x: FloatArray) -> ActuatorModel:
        effects = list(model.effects)
        drive = model.drive
        for value, (i, name, low, high, logarithmic) in zip(x.tolist(), self.entries, strict=True):
            number = min(max(math.exp(min(value, 50.0)) if logarithmic else value, low), high)
            if i < 0:
                drive = Drive(drive.kind, number)
            else:
                effects[i] = replace(effects[i], parameters={**effects[i].parameters, name: number}, ci95={})
        return replace(model, drive=drive, effects=tuple(effects))

    @property
    def spread(self) -> FloatArray:
        """How far each may lie from a prior."""
        return np.array([1.0 if e[4] else 0.1 for e in self.entries])

    @property
    def scale(self) -> FloatArray:
        """What counts as a moderate change of each."""
        return np.array([0.3 if e[4] else 0.03 for e in self.entries])


def free_parameters(model: ActuatorModel, fixed: frozenset[str]) -> tuple[str, ...]:
    """Names of the parameters that a refinement changes, in its order."""
    return tuple(("drive" if i < 0 else model.effects[i].key) + f".{n}" for i, n, *_ in _free(model, fixed).entries)


def _free(model: ActuatorModel, fixed: frozenset[str]) -> _Free:
    entries = [] if "drive.gain" in fixed else [(-1, "gain", 1e-12, math.inf, True)]
    for i, value in enumerate(model.effects):
        for p in value.effect.parameters:
            if f"{value.key}.{p.name}" in fixed or math.isinf(value.parameters[p.name]):
                continue
            entries.append((i, p.name, p.lower, p.upper, p.lower >= 0.0))
    return _Free(tuple(entries))


def _errors(job: tuple[ActuatorModel, Sequence[Trial], float]) -> FloatArray:
    model, trials, step = job
    parts = [simulate(model, trial, step) - trial.position for trial in trials]
    return np.clip(np.nan_to_num(np.concatenate(parts), nan=FARTHEST), -FARTHEST, FARTHEST)


def refine_on_free_runs(
    model: ActuatorModel,
    trials: Sequence[Trial],
    options: OutputErrorOptions | None = None,
    executor: Executor | None = None,
) -> OutputErrorFit:
    """Refine a model's numbers until its free runs follow the recorded ones.

    Args:
        model: Where the search starts, from equation error; its effects stay the same.
        trials: Runs to follow; held-out runs do not belong here.
        options: How.
        executor: Runs the simulations beside each other; None runs them here.

    Raises:
        IdentificationError: no trial, nothing to change, or a prior with other effects.
    """
    options = options or OutputErrorOptions()
    free = _free(model, options.fixed)
    if not trials or not free.entries:
        raise IdentificationError(
            f"output error: wanted a trial and a free parameter; got {len(trials)} and {len(free.entries)}"
        )
    if options.prior is not None and [v.key for v in options.prior.effects] != [v.key for v in model.effects]:
        raise IdentificationError(
            f"output error: wanted a prior with the effects {[v.key for v in model.effects]}; "
            f"got {[v.key for v in options.prior.effects]}"
        )
    evaluate = map if executor is None else executor.map

    centre = None if options.prior is None else free.read(options.prior)

    def errors_at(points: Sequence[FloatArray]) -> list[FloatArray]:
        made = list(evaluate(_errors, [(free.write(model, x), trials, options.step) for x in points]))
        if centre is None:
            return made
        # split into small parts, for which the loss is still quadratic
        pulls = [np.repeat(options.pull * (x - centre) / free.spread, PARTS) / math.sqrt(PARTS) for x in points]
        return [np.concatenate(pair) for pair in zip(made, pulls, strict=True)]

    def jacobian(x: FloatArray) -> FloatArray:
        steps = 0.1 * free.scale
        points = [x + sign * steps * unit for unit in np.eye(x.size) for sign in (1.0, -1.0)]
        made = errors_at(points)
        return np.stack([(made[2 * i] - made[2 * i + 1]) / (2.0 * steps[i]) for i in range(x.size)], axis=1)

    found = least_squares(
        lambda x: errors_at([x])[0],
        free.read(model),
        jac=jacobian,
        x_scale=free.scale,
        loss="soft_l1",
        f_scale=options.knee,
        max_nfev=options.evaluations,
        xtol=1e-4,
        ftol=1e-4,
    )
    refined = free.write(model, found.x)
    return OutputErrorFit(refined, _mean_errors(model, trials), _mean_errors(refined, trials), int(found.nfev))


def _mean_errors(model: ActuatorModel, trials: Sequence[Trial]) -> FloatArray:
    return np.array([float(np.mean(np.abs(_errors((model, [trial], FINE_STEP))))) for trial in trials])


def refine_from_starts(
    starts: Sequence[ActuatorModel],
    trials: Sequence[Trial],
    options: OutputErrorOptions | None = None,
    executor: Executor | None = None,
    first_evaluations: int = 10,
) -> OutputErrorFit:
    """`refine_on_free_runs` from several starts, for the error is not convex: a few steps from each, on from the best.

    Args:
        starts: Where to start.
        trials: Runs to follow.
        options: How.
        executor: Runs the simulations beside each other.
        first_evaluations: Steps from each start.

    Raises:
        IdentificationError: no start, no trial, or nothing to change.
    """
    options = options or OutputErrorOptions()
    if not starts:
        raise IdentificationError("output error: wanted a model to start from; got none")
    short = replace(options, evaluations=min(first_evaluations, options.evaluations))
    tried = [refine_on_free_runs(start, trials, short, executor) for start in starts]
    best = min(tried, key=lambda fitted: float(np.mean(fitted.after)))
    return refine_on_free_runs(best.model, trials, options, executor)
