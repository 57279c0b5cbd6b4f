"""A setting of window and gains, what it comes to for a joint, and what is asked of it.

Margins of a `JointLoop` at a fraction of a millisecond, on a grid of frequencies: for searches over many gains.

With A the plant's polynomial (and the integrator's) in 1/z and X the characteristic one, 1 + L = X/A at the drive's
effort, so two Fourier transforms of coefficients give L on a uniform grid up to the Nyquist frequency. X has no root
outside the unit circle when its phase comes back to where it was from z = 1 to z = -1 (argument principle).

Tuning of window and gains: the least tracking error under a stated margin, joint by joint.

What the gains trade: along the reference a late velocity feeds back K7 (q_d' - vhat), and the friction's feedforward
lacks K_v' of the same, so K7 near K_v' undoes its lateness; a late torque costs Kp of it, which wants a small Kp or a
short window; dry friction y_c and dead zone leave y_c/K6, whatever Kp, unless Ki integrates them away; and a short
window moves the phase that the margin needs and lets noise through. K6, the stiffness, is what a user states: it stays.

Pareto front: the choices that no other one beats in everything.

The Pareto front of a tuning, drawn: error against sensitivity peak, joint by joint; noise as colour.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field
from itertools import product
from typing import Any

import numpy as np

from drake_tc.analysis.sweep import sweep
from drake_tc.analysis.tracking_error import (
    FilteredTask,
    JointTask,
    filtered_task,
    predicted_error,
    predicted_noise,
    sticking_error,
)
from drake_tc.control.joint_loop import JointLoop, quick_margins, value_of, with_values
from drake_tc.control.stability_margins import Margins
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray, IntArray

FINALISTS = 12
"""Settings of the least linear error, which are compared with the friction that holds the joint."""
SLACK = 1e-3
"""Relative: a margin this little below its goal meets it (the grid's resolution)."""


@dataclass(frozen=True)
class Setting:
    """What is tuned: window [samples] and order of the encoder's filter, Kp [-], Ki [1/s], K7 [s]."""

    window: int
    order: int
    kp: float
    ki: float
    k7: float


@dataclass(frozen=True)
class Assessed:
    """A setting and what it comes to, margins and noise at the worst of the task's postures.

    Attributes:
        setting: The setting.
        error: Predicted RMS tracking error, noise included [rad].
        noise: RMS of the noise in the command, as torque of the drive [N m].
        sensitivity_peak: [-].
        delay_margin: [s].
        gain_margin: [-], the nearest to 1.
    """

    setting: Setting
    error: float
    noise: float
    sensitivity_peak: float
    delay_margin: float
    gain_margin: float


@dataclass(frozen=True)
class Goal:
    """What a setting must keep.

    Attributes:
        sensitivity_peak: At most this, > 1 [-].
        delay_margin: At least this [s].
        noise: RMS of the noise in the command at most this [N m].

    Raises:
        ParamsError: a number that is not possible.
    """

    sensitivity_peak: float = np.inf
    delay_margin: float = 0.0
    noise: float = np.inf

    def __post_init__(self) -> None:
        if not (self.sensitivity_peak > 1.0 and self.delay_margin >= 0.0 and self.noise >= 0.0):
            raise ParamsError(
                f"goal: expected a sensitivity peak > 1, a delay margin >= 0 s and a noise >= 0 N m, got {self}"
            )

    def met(self, assessed: Assessed) -> bool:
        """Whether a setting keeps it."""
        return (
            assessed.sensitivity_peak <= self.sensitivity_peak * (1.0 + SLACK)
            and assessed.delay_margin >= self.delay_margin * (1.0 - SLACK)
            and assessed.noise <= self.noise
        )


@dataclass(frozen=True, eq=False)
class Batch:
    """Gains of one joint behind one filter: a point of a sweep."""

    task: JointTask
    window: int
    order: int
    gains: tuple[tuple[float, float, float], ...]


def with_setting(loop: JointLoop, setting: Setting) -> JointLoop:
    """The loop with another setting, as stiff as it was (K6)."""
    return with_values(loop, asdict(setting))


def setting_of(loop: JointLoop) -> Setting:
    """The setting that a loop has."""
    return Setting(loop.window, loop.order, loop.kp, loop.ki, value_of(loop, "k7"))


def assess(task: JointTask, setting: Setting) -> Assessed | None:
    """What a setting comes to, with exact margins and friction that holds; None where it is unstable at a posture."""
    loops = [with_setting(loop, setting) for loop in task.loops]
    if max(loop.spectral_radius() for loop in loops) >= 1.0:
        return None
    filtered = filtered_task(task, setting.window, setting.order, loops[0].at)
    error = sticking_error(filtered, loops[0])
    return _assessed(filtered, setting, loops, [loop.margins() for loop in loops], error)


def _assessed(
    filtered: FilteredTask,
    setting: Setting,
    loops: Sequence[JointLoop],
    found: Sequence[Margins],
    error: FloatArray,
) -> Assessed:
    error = error[filtered.task.begin :]
    shaking, effort = predicted_noise(filtered.task, loops[0])
    return Assessed(
        setting,
        float(np.sqrt(np.mean(error**2) + shaking**2)),
        effort / loops[0].k_tau,
        max(each.sensitivity_peak for each in found),
        min(each.delay_margin for each in found),
        min((each.gain_margin for each in found), key=lambda gain: abs(np.log(gain))),
    )


def present(task: JointTask) -> Assessed | None:
    """What the task's own setting comes to; None where it is unstable."""
    return assess(task, setting_of(task.loops[0]))


def assess_batch(batch: Batch, seed: int) -> list[Assessed]:
    """The stable settings of a batch, margins on a grid; the seed is not used."""
    task, out = batch.task, []
    filtered = filtered_task(task, batch.window, batch.order, task.loops[0].at)
    for kp, ki, k7 in batch.gains:
        setting = Setting(batch.window, batch.order, kp, ki, k7)
        loops = [with_setting(loop, setting) for loop in task.loops]
        found = [quick_margins(loop) for loop in loops]
        sound = [each for each in found if each is not None]
        if len(sound) == len(found):
            out.append(_assessed(filtered, setting, loops, sound, predicted_error(filtered, loops[0])))
    return out


def default_goals(
    tasks: Sequence[JointTask], peak: float | None = None, delay: float | None = None, noise: float = 1.0
) -> list[Goal]:
    """One goal a joint.

    Args:
        tasks: One a joint.
        peak: Sensitivity peak for all; None: that of the joint's own present setting, or better.
        delay: Delay margin for all [s]; None: as `peak`.
        noise: As a multiple of what the vendor's servo makes of the encoder's noise, sigma/K_tau; the present setting's
            own, where that is more.

    Raises:
        ParamsError: a present setting that is unstable and so has no margins to keep.
    """
    goals = []
    for task in tasks:
        now = present(task)
        if now is None and (peak is None or delay is None):
            raise ParamsError(
                f"tune: the present setting of {task.joint} is unstable; give margins in numbers (--margin,"
                " --delay-margin)"
            )
        own = Goal() if now is None else Goal(now.sensitivity_peak, now.delay_margin)
        floor = 0.0 if now is None else now.noise
        servo = noise * task.encoder_noise / task.loops[0].k_tau
        goals.append(
            Goal(
                own.sensitivity_peak if peak is None else peak,
                own.delay_margin if delay is None else delay,
                max(servo, floor) if task.encoder_noise else np.inf,
            )
        )
    return goals


def pareto_front(costs: FloatArray) -> IntArray:
    """Rows of `costs` (N, m) that no other row is at most equal to everywhere and below somewhere, by the first cost.

    Of equal rows the first stays. Rows that are not finite never are on the front.

    Raises:
        ParamsError: anything but two dimensions.
    """
    if costs.ndim != 2:
        raise ParamsError(f"pareto_front: expected costs of shape (N, m), got {costs.shape}")
    finite = np.flatnonzero(np.all(np.isfinite(costs), axis=1))
    order = finite[np.lexsort(costs[finite].T[::-1])]
    kept: list[int] = []
    for row in order.tolist():
        if not kept or not np.any(np.all(costs[kept] <= costs[row], axis=1)):
            kept.append(row)
    return np.array(kept, dtype=np.int64)


Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class SearchSpace:
    """Where settings are looked for; K7 as multiples of the controller's K_v'.

    Raises:
        ParamsError: an empty list.
    """

    windows: tuple[int, ...] = (12, 16, 22, 30, 40, 56, 80)
    orders: tuple[int, ...] = (2,)
    kp: tuple[float, ...] = (0.0, 0.5, 1.0, 2.0, 3.0)
    ki: tuple[float, ...] = (0.0, 2.5, 5.0, 10.0, 20.0, 40.0)
    k7: tuple[float, ...] = (0.0, 0.5, 0.8, 1.1, 1.4)
    rounds: int = 2

    def __post_init__(self) -> None:
        for name in ("windows", "orders", "kp", "ki", "k7"):
            if not getattr(self, name):
                raise ParamsError(f"search space: expected at least one value of {name}")


@dataclass(frozen=True)
class TunedJoint:
    """One joint, tuned.

    Attributes:
        joint: Name.
        goal: What was to be kept.
        before: The task's own setting; None where that is unstable.
        after: The best one that keeps the goal.
        front: Of all windows, the stable settings that no other beats in error, sensitivity peak and noise together.
    """

    joint: str
    goal: Goal
    before: Assessed | None
    after: Assessed
    front: tuple[Assessed, ...] = field(repr=False)


@dataclass(frozen=True)
class Tuning:
    """All joints, with one window and order for all: they share their filter, as a torque needs all at one time."""

    window: int
    order: int
    joints: tuple[TunedJoint, ...]
    tried: int

    @property
    def ratio(self) -> float:
        """Predicted error after over before, geometric mean over the joints; 0 where one was unstable before."""
        pairs = [(joint.after.error, joint.before.error if joint.before else np.inf) for joint in self.joints]
        return float(np.exp(np.mean([np.log(after) for after, _ in pairs]) - np.mean([np.log(b) for _, b in pairs])))


def tune(
    tasks: Sequence[JointTask],
    goals: Sequence[Goal] | None = None,
    space: SearchSpace | None = None,
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Tuning:
    """Least geometric mean of the joints' errors, over a grid and then closer and closer around its best.

    Args:
        tasks: One a joint.
        goals: One a joint; None: `default_goals`.
        space: Where to look.
        executor: As `sweep`.
        progress: Told what is done and which share.

    Raises:
        ParamsError: no task, goals of another number, or goals that nothing in the space keeps.
    """
    goals = default_goals(tasks) if goals is None else list(goals)
    if not tasks or len(goals) != len(tasks):
        raise ParamsError(f"tune: expected at least one joint, and a goal each, got {len(tasks)} and {len(goals)}")
    space = SearchSpace() if space is None else space
    search = _Search(tasks, goals, executor, progress, 1 + space.rounds)
    filters = list(product(space.windows, space.orders))
    for window, order in filters:
        for task in tasks:
            k7 = [share * task.loops[0].k_v_model for share in space.k7]
            search.want(task, window, order, tuple(product(space.kp, space.ki, k7)))
    search.run()
    window, order = search.best_filter(filters)
    for number in range(space.rounds):
        for task, best in zip(tasks, search.best(window, order), strict=True):
            if best is not None:
                search.want(task, window, order, _around(best.setting, task.loops[0].k_v_model, 0.5 ** (number + 1)))
        search.run()
    return Tuning(window, order, search.tuned(window, order), search.tried)


class _Search:
    """What was tried so far, joint by joint."""

    def __init__(
        self,
        tasks: Sequence[JointTask],
        goals: Sequence[Goal],
        executor: Executor | None,
        progress: Progress | None,
        rounds: int,
    ) -> None:
        self._tasks, self._goals, self._executor, self._progress = tasks, goals, executor, progress
        self._found: dict[str, list[Assessed]] = {task.joint: [] for task in tasks}
        self._batches: list[Batch] = []
        self._rounds, self._round, self.tried = rounds, 0, 0

    def want(self, task: JointTask, window: int, order: int, gains: tuple[tuple[float, float, float], ...]) -> None:
        """Have gains tried in the next `run`."""
        self._batches.append(Batch(task, window, order, gains))
        self.tried += len(gains)

    def run(self) -> None:
        """Try what is requested."""
        results = sweep(assess_batch, self._batches, executor=self._executor, chunk=1, progress=self._told)
        for batch, found in zip(self._batches, results, strict=True):
            self._found[batch.task.joint] += found
        self._batches, self._round = [], self._round + 1

    def _told(self, text: str, share: float) -> None:
        if self._progress:
            done = (self._round + share) / self._rounds
            self._progress(f"round {self._round + 1} of {self._rounds}: {text} batches", done)

    def best(self, window: int, order: int) -> list[Assessed | None]:
        """Of every joint; None where nothing keeps the goal."""
        return [next(iter(self._kept(task, goal, window, order)), None) for task, goal in self._pairs()]

    def _pairs(self) -> list[tuple[JointTask, Goal]]:
        return list(zip(self._tasks, self._goals, strict=True))

    def _kept(self, task: JointTask, goal: Goal, window: int, order: int) -> list[Assessed]:
        """Those of a filter that keep the goal, the least error first."""
        of = self._found[task.joint]
        kept = [a for a in of if (a.setting.window, a.setting.order) == (window, order) and goal.met(a)]
        return sorted(kept, key=lambda a: a.error)

    def best_filter(self, filters: Sequence[tuple[int, int]]) -> tuple[int, int]:
        """The filter with which the joints' best errors have the least product.

        Raises:
            ParamsError: no filter keeps the goals on every joint.
        """
        sums: dict[tuple[int, int], float] = {}
        fewest = [task.joint for task in self._tasks]
        for each in filters:
            best = self.best(*each)
            without = [task.joint for task, b in zip(self._tasks, best, strict=True) if b is None]
            fewest = min(fewest, without, key=len)
            if not without:
                sums[each] = sum(float(np.log(b.error)) for b in best if b is not None)
        if not sums:
            raise ParamsError(
                f"tune: no window and gains keep the goal on {', '.join(fewest)};"
                " allow a larger peak, less delay margin, more noise, or less stiffness"
            )
        return min(sums, key=lambda each: sums[each])

    def tuned(self, window: int, order: int) -> tuple[TunedJoint, ...]:
        """Every joint with its best setting, the margins computed exactly."""
        return tuple(
            TunedJoint(task.joint, goal, present(task), self._exact(task, goal, window, order), self._front(task))
            for task, goal in self._pairs()
        )

    def _exact(self, task: JointTask, goal: Goal, window: int, order: int) -> Assessed:
        kept = self._kept(task, goal, window, order)
        filtered = filtered_task(task, window, order, task.loops[0].at)

        def held(candidate: Assessed) -> float:
            loop = with_setting(task.loops[0], candidate.setting)
            return float(np.mean(sticking_error(filtered, loop)[task.begin :] ** 2))

        for candidate in (*sorted(kept[:FINALISTS], key=held), *kept[FINALISTS:]):
            found = assess(task, candidate.setting)
            if found is not None and goal.met(found):
                return found
        raise ParamsError(f"tune: no gains of window {window} keep the goal on {task.joint}")

    def _front(self, task: JointTask) -> tuple[Assessed, ...]:
        of = self._found[task.joint]
        costs = np.array([[a.error, a.sensitivity_peak, a.noise] for a in of]).reshape(-1, 3)
        return tuple(of[i] for i in pareto_front(costs).tolist())


def _around(setting: Setting, k_v: float, width: float) -> tuple[tuple[float, float, float], ...]:
    """Gains around a setting: factors 2^(+-width) on Ki, steps on Kp and K7."""
    kp = sorted({max(setting.kp + step * width, 0.0) for step in (-1.0, -0.5, 0.0, 0.5, 1.0)})
    ki = [setting.ki * 2.0 ** (step * width) for step in (-1.0, -0.5, 0.0, 0.5, 1.0)] if setting.ki else [0.0, 1.25]
    k7 = sorted({max(setting.k7 + 0.3 * step * width * k_v, 0.0) for step in (-1.0, -0.5, 0.0, 0.5, 1.0)})
    return tuple(product(kp, ki, k7))


LARGEST_PEAK = 4.0


def draw_fronts(figure: Any, tuning: Tuning) -> None:
    """Draw into a matplotlib Figure: one panel a joint, the front's settings coloured by their noise.

    A line joins those that nothing beats in error and peak alone; a square is the present setting, a star the tuned.
    """
    joints = tuning.joints
    columns = min(3, len(joints))
    rows = -(-len(joints) // columns)
    axes = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
    drawn = [each for joint in joints for each in joint.front]
    noises = [each.noise for each in drawn if each.noise > 0.0] or [1.0]
    limits = {"vmin": np.log10(min(noises)), "vmax": np.log10(max(noises))}
    points = None
    for axis, joint in zip(axes, joints, strict=False):
        points = _draw_joint(axis, joint, limits) or points
    for axis in axes[len(joints) :]:
        axis.set_visible(False)
    if points is not None and max(noises) > min(noises):
        figure.colorbar(points, ax=axes.tolist(), label="noise in the command, log10 of N m RMS")
    figure.supxlabel("sensitivity peak [-]")
    figure.supylabel("predicted RMS tracking error [mrad]")


def _draw_joint(axis: Any, joint: TunedJoint, limits: dict[str, Any]) -> Any:
    shown = [each for each in joint.front if each.sensitivity_peak <= LARGEST_PEAK]
    points = None
    if shown:
        noise = np.log10(np.maximum([each.noise for each in shown], 1e-12))
        points = axis.scatter(*_place(shown), c=noise, s=10, cmap="viridis", **limits)
    edge, best = [], np.inf
    for each in sorted(shown, key=lambda a: a.sensitivity_peak):
        if each.error < best:
            edge.append(each)
            best = each.error
    axis.plot(*_place(edge), color="0.6", linewidth=1.0, drawstyle="steps-post")
    if joint.before is not None:
        axis.plot(*_place([joint.before]), "s", color="tab:red", label="present")
    axis.plot(*_place([joint.after]), "*", color="tab:orange", markersize=12, label="tuned")
    if joint.goal.sensitivity_peak <= LARGEST_PEAK:
        axis.axvline(joint.goal.sensitivity_peak, color="tab:red", linestyle=":", linewidth=1.0)
    axis.set_title(joint.joint, fontsize="small")
    axis.set_yscale("log")
    axis.legend(fontsize="x-small")
    return points


def _place(settings: list[Assessed]) -> tuple[list[float], list[float]]:
    return [each.sensitivity_peak for each in settings], [1e3 * each.error for each in settings]
