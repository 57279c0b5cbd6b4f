"""Tuning of window and gains: the least tracking error under a stated margin, joint by joint.

What the gains trade: along the reference a late velocity feeds back K7 (q_d' - vhat), and the friction's feedforward
lacks K_v' of the same, so K7 near K_v' undoes its lateness; a late torque costs Kp of it, which wants a small Kp or a
short window; dry friction y_c and dead zone leave y_c/K6, whatever Kp, unless Ki integrates them away; and a short
window moves the phase that the margin needs and lets noise through. K6, the stiffness, is what a user states: it stays.

Pareto front: the choices that no other one beats in everything.

The Pareto front of a tuning, drawn: error against sensitivity peak, joint by joint; noise as colour.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from drake_tc.analysis.settings import Assessed, Batch, Goal, Setting, assess, assess_batch, default_goals, present
from drake_tc.analysis.sweep import sweep
from drake_tc.analysis.tracking_error import JointTask
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray, IntArray


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
        for candidate in self._kept(task, goal, window, order):
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
