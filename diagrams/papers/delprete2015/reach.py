"""Del Prete and Mansard (2015), tests 3 and 4.

The right hand reaches far under a bound on the capture point; right and wrong sigma.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from drake_tc.control.trajectories import knot_trajectory
from drake_tc.diagrams.papers.delprete2015.setup import (
    BOX,
    CLASSIC,
    DT,
    HAND,
    INDIVIDUAL,
    KD_TASK,
    KP_TASK,
    PLAIN,
    RECTANGLE,
    SETTING,
    SIGMA,
    SOLES,
    W_COM,
    W_REACH,
    Way,
    model,
    posture_task,
    standing_limits,
    torque_error,
)
from drake_tc.diagrams.papers.delprete2015.simulation import Moment, Scene, follow
from drake_tc.diagrams.papers.delprete2015.torque_safety import TorqueSafety, cell, torque_safety
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.tsid.limits import CapturePointLimit, half_planes
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.tasks import FrameTask
from drake_tc.types import FloatArray, TextTable

HOLD = 1.0
"""That the hand stays at its goal [s]."""
EVERY = 8
"""Ticks between those at which p is computed."""
SHARES = (0.001, 0.002, 0.003, 0.005, 0.006)
"""The controller's sigma, of tau_max; the true one is 0.003."""
GROUPS = {
    "force": "force",
    "acceleration": "joint acceleration",
    "torque": "joint torque",
    "capture_point": "capture point",
}


LIGHT = f"{BOX.name}, w = {W_COM:g}"
"""p_box once more, with the weight of tests 1 and 2."""
ROBUST = (INDIVIDUAL.name, BOX.name, LIGHT)
PLANNED: Mapping[str, tuple[Way, float]] = {
    **{way.name: (way, W_REACH) for way in (PLAIN, CLASSIC, INDIVIDUAL, BOX, RECTANGLE)},
    LIGHT: (BOX, W_COM),
}


NOTES3 = (
    SETTING,
    "The hand goes 75 cm forwards and 10 cm up in 4 s and stays for 1 s, each controller in a motion of its own. The"
    " capture point is bound 6 cm inside the feet's hull: with nothing between it and the edge the pressure could not"
    " push it back. Goal, time and bound are those of 32 which the classic controller (w_f > 0) can make and over"
    " which its p spreads most evenly; slower reaches bring it to the joints' ends, where nothing keeps the capture"
    " point.",
    "The 32 were laid after trials, with robust controllers too, of other goals, times, bounds (0 to 9 cm) and places"
    " of the contact frames; most of those ended without solution, with classic and robust controllers alike.",
    "Where the controller has no solution, the torques that miss least act. p is computed at every eighth state.",
)
NOTES4 = (
    SETTING,
    "The motion of B.test3, with another sigma in the controller; p by the true one.",
)


@dataclass(frozen=True)
class Goal:
    """Where the hand goes, how fast, and how the capture point is bound; chosen as `choice` says.

    Attributes:
        offset: Of the goal, from where the hand hangs in the posture [m].
        rise: Minimum jerk to the goal [s].
        margin: Of the capture point to the edges of the feet's hull [m].
    """

    offset: tuple[float, float, float] = (0.75, 0.0, 0.1)
    rise: float = 4.0
    margin: float = 0.06

    @property
    def duration(self) -> float:
        """Of the motion [s]."""
        return self.rise + HOLD


GOAL = Goal()


def reach_scene(of: TsidModel | None = None, goal: Goal = GOAL) -> Scene:
    """The hand follows its way to the goal, the joints stay near the posture; of the robot, or of another model."""
    robot = of or model()
    hand = FrameTask(robot, HAND, KP_TASK, KD_TASK, mask=[False] * 3 + [True] * 3)
    posture = posture_task(robot)
    truth = model()
    terms = truth.terms(truth.create_scratch(), truth.start, np.zeros(truth.nv))
    start, rest = hand.rest(terms), posture.rest(terms)
    path = knot_trajectory([0.0, goal.rise], np.array([start[4:7], start[4:7] + goal.offset]))

    def reference(time: float) -> FloatArray:
        desired = start.copy()
        for order, first in enumerate((4, 10, 16)):
            desired[first : first + 3] = path.EvalDerivative(min(time, goal.rise), order).ravel()
        return desired

    limits = (*standing_limits(), CapturePointLimit(SOLES, period=DT, margin=goal.margin))
    return Scene(robot, ((hand, reference), (posture, lambda time: rest)), limits)


def reach(
    way: Way, weight: float = W_REACH, *, share: float = SIGMA, seed: int = 0, duration: float = GOAL.duration
) -> "Reach":
    """One motion, evaluated with the true torque error."""
    watched = _Watch()
    moments = watched.passing(follow(reach_scene(), way, weight, torque_error(share), duration))
    found = torque_safety(moments, torque_error(), seed, every=EVERY)
    return Reach(found, watched.distance(), float(np.max(watched.beyond)))


@dataclass(frozen=True, eq=False)
class Reach:
    """What one motion comes to.

    Attributes:
        evaluated: Its probabilities.
        distance: Of the hand from its goal at the end [m].
        beyond: How far the capture point ever was outside the feet's hull [m]; negative inside.
    """

    evaluated: TorqueSafety
    distance: float
    beyond: float


class _Watch:
    """Looks at moments that pass by."""

    def __init__(self) -> None:
        self.beyond: list[float] = []
        self._robot = model()
        self._scratch = self._robot.create_scratch()
        self._edges = CapturePointLimit(SOLES, period=DT)
        self._hand = np.zeros(3)

    def passing(self, moments: Iterable[Moment]) -> Iterator[Moment]:
        """The same moments."""
        for moment in moments:
            terms = self._robot.terms(self._scratch, moment.q, moment.v)
            normals, reach_ = half_planes(self._edges.corners(terms)[0])
            self.beyond.append(float((normals @ self._edges.capture_point(terms) - reach_).max()))
            self._hand = terms.pose(HAND)[1]
            yield moment

    def distance(self) -> float:
        """Of the hand from its goal where it was last seen [m]."""
        terms = self._robot.terms(self._scratch, self._robot.start, np.zeros(self._robot.nv))
        return float(np.linalg.norm(self._hand - terms.pose(HAND)[1] - GOAL.offset))


def far_reach(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """B.test3: classic and robust ways of reaching, each in a motion of its own."""
    found: dict[str, Reach] = {}
    for number, (name, (way, weight)) in enumerate(PLANNED.items()):
        if progress:
            progress(name, number / len(PLANNED))
        found[name] = reach(way, weight, seed=seed)
    values = {f"p, {name}": 100.0 * float(one.evaluated.p.mean()) for name, one in found.items()}
    for name in ROBUST:
        values[f"p of {name} minus p of classic"] = values[f"p, {name}"] - values[f"p, {CLASSIC.name}"]
    for name, one in found.items():
        values[f"capture point beyond the feet, {name}"] = 100.0 * max(one.beyond, 0.0)
        values[f"states without solution, {name}"] = float(np.count_nonzero(~one.evaluated.solved))
        values[f"hand from its goal, {name}"] = 100.0 * one.distance
    evaluated_rows = evaluated(values, expectations("b_test3"))
    return Reproduction("B.test3", evaluated_rows, (_table3(found),), NOTES3, {"fig7": _fig7(found)})


def _table3(found: Mapping[str, Reach]) -> TextTable:
    """The paper's Table III."""
    runs = [one.evaluated for one in found.values()]
    lines = [
        ("probability p [%]", [cell(one.p, 100.0) for one in runs]),
        *((f"{label} p [%]", [cell(one.groups[name], 100.0) for one in runs]) for name, label in GROUPS.items()),
        ("active inequalities", [cell(one.active) for one in runs]),
        ("states without solution", [str(int(np.count_nonzero(~one.solved))) for one in runs]),
        ("hand from its goal [cm]", [f"{100.0 * one.distance:.2f}" for one in found.values()]),
        ("mean solution [ms]", [f"{1e3 * float(one.seconds.mean()):.3f}" for one in runs]),
        ("largest solution [ms]", [f"{1e3 * float(one.seconds.max()):.3f}" for one in runs]),
    ]
    title = f"averages over {runs[0].p.size} states each (times are of this machine, warm-started)"
    return TextTable(title, ("", *found), tuple((name, *cells) for name, cells in lines))


def wrong_sigma(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """B.test4: sigma in the controller from a third to twice the true one."""
    if progress:
        progress(CLASSIC.name, 0.0)
    classic = 100.0 * float(reach(CLASSIC, seed=seed).evaluated.p.mean())
    values, lines = {f"p, {CLASSIC.name}": classic}, []
    for number, share in enumerate(SHARES):
        line = [f"{share:g} tau_max"]
        for name in ROBUST:
            if progress:
                progress(f"sigma {share:g} tau_max, {name}", (1 + number) / (1 + len(SHARES)))
            p = 100.0 * float(reach(*PLANNED[name], share=share, seed=seed).evaluated.p.mean())
            values[f"p, sigma {share:g}, {name}"] = p
            line.append(f"{p:.2f}")
        lines.append(tuple(line))
    for name in ROBUST:
        least = min(values[f"p, sigma {share:g}, {name}"] for share in SHARES)
        values[f"least p over that of classic, {name}"] = least / classic
    table = TextTable("p [%] with the true sigma of 0.003 tau_max", ("controller's sigma", *ROBUST), tuple(lines))
    return Reproduction("B.test4", evaluated(values, expectations("b_test4")), (table,), NOTES4)


def _fig7(found: Mapping[str, Reach]) -> Any:
    def draw(figure: Any) -> None:
        axis = figure.subplots()
        for name in (CLASSIC.name, *ROBUST):
            axis.plot(found[name].evaluated.time, 100.0 * found[name].evaluated.p, label=name)
        axis.set_xlabel("time [s]")
        axis.set_ylabel("p [%]")
        axis.legend()

    return draw
