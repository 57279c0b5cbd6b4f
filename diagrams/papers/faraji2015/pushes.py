"""Faraji et al. (2015): the largest push that the standing robot survives, by controller and direction."""

import math
import os
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.analysis.sweep import processes, sweep
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.errors import SimulationError
from drake_tc.loops.scenarios import PushSpec
from drake_tc.loops.whole_body.running import TsidRecording, simulate_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.types import FloatArray, TextTable

SCENARIOS = Path(__file__).parents[2] / "coman.scenario.yaml"
OURS, DAMPED, STIFF = "whole-body torque control", "the same with joint damping", "stiff positions"
LOOPS = {OURS: "pushed", DAMPED: "pushed_damped", STIFF: "pushed_held"}
"""Controller to its scenario."""
DIRECTIONS = {"forward": (1.0, 0.0, 0.0), "backward": (-1.0, 0.0, 0.0), "sideways": (0.0, 1.0, 0.0)}
CHEST, HEIGHT = "torso", 0.1
"""The link that is pushed, and how far above its frame [m]."""
BEGIN, LASTS, AFTER = 0.5, 0.1, 2.5
"""When the push begins, how long it lasts, and how long the robot is watched thereafter [s]."""
STILL, LATE = 0.2, 0.3
"""The robot stands if its base is slower than this [m/s] in the last so many seconds: 0.2 m/s carry a robot of this
height on by less than 5 cm, half a sole. Position loops still rock on their springs by then."""
LEAST, MOST, STEP, CLOSE = 0.5, 40.0, 1.2, 1.05
"""Impulses looked at [N s]; the first factor between two that are tried, and how close is close enough."""
FIRST = {OURS: (12.0, 5.8, 10.5), DAMPED: (8.5, 5.9, 8.0), STIFF: (4.5, 2.1, 6.0)}
"""What is tried first in each direction [N s]: from earlier runs, which saves some; the border is found from any."""
EVERY = 10
"""One sample in so many is kept of a run."""
NOTES = (
    "Simulated: the robot of models/coman_like stands on soles of 3e5 N/m; a horizontal push at the chest, sin^2 over"
    " 0.1 s, its impulse bisected to 5 %. Survived: not fallen 2.5 s after it, the base below 0.2 m/s in the last"
    " 0.3 s. Drives, sensors and robot are models with chosen numbers, no measurement of a real one.",
    "Stiff positions: every motor held at its starting angle by its own encoder, on the drive's own board (no loop"
    " delay), as stiff as leaves a delay margin of 5 ms, which the torque laws of C.bode have too. The springs behind"
    " (200 and 120 N m/rad) give way, as in the other loops.",
    "That a smaller push is survived wherever a larger one is, is taken for granted by the bisection.",
)


@dataclass(frozen=True, eq=False)
class Survived:
    """One run that was survived.

    Attributes:
        time: (T,) from the push on [s].
        moved: (T,) of the centre of mass along the push [m].
        speed: (T,) of the base [m/s].
        tilt: Largest angle between a foot's sole and the floor, from the push on [rad].
    """

    time: FloatArray
    moved: FloatArray
    speed: FloatArray
    tilt: float


@dataclass(frozen=True, eq=False)
class Border:
    """The largest impulse survived and the smallest that was not, at most `CLOSE` apart [N s]; and the former's run."""

    survived: float
    fatal: float
    run: Survived | None


def pushed(scenario: TsidScenario, direction: str, impulse: float) -> TsidScenario:
    """A scenario in which the chest is pushed once; the mean of sin^2 is a half."""
    force = tuple(2.0 * impulse / LASTS * x for x in DIRECTIONS[direction])
    push = PushSpec(CHEST, BEGIN, LASTS, force, point=(0.0, 0.0, HEIGHT))
    return scenario.changed(pushes=(push,), duration=BEGIN + LASTS + AFTER)


def stands(run: TsidRecording) -> bool:
    """Whether it has neither fallen nor is about to."""
    if run.fell is not None or run.time[-1] < run.scenario.duration - 0.01:
        return False
    late = run.time > run.time[-1] - LATE
    return bool(_base_speed(run)[late].max() < STILL)


def _base_speed(run: TsidRecording) -> FloatArray:
    """(T,) [m/s]."""
    first = run.law.model.nq + 3
    speed: FloatArray = np.linalg.norm(run["state"][:, first : first + 3], axis=1)
    return speed


def largest(survives: Callable[[float], bool], first: float) -> tuple[float, float]:
    """Impulses around the border between survived and not, at most `CLOSE` apart; 0 or infinite where there is none.

    Args:
        survives: Whether an impulse is survived.
        first: The impulse that is tried first [N s].
    """
    low, high, trial, step = 0.0, math.inf, first, STEP
    while not high <= low * CLOSE:
        if survives(trial):
            low = trial
        else:
            high = trial
        if low >= MOST or high <= LEAST:
            break
        if low > 0.0 and high < math.inf:
            trial = math.sqrt(low * high)
        else:
            trial, step = (min(low * step, MOST) if low else max(high / step, LEAST)), step * step
    return low, high


def border(point: tuple[str, str, int], seed: int) -> Border:
    """Of a loop and a direction, with the noise of a seed that all have; for `sweep`.

    A fall that the plant's solver does not follow to the ground is one.
    """
    loop, direction, noise = point
    scenario = TsidScenario.load(SCENARIOS, LOOPS[loop]).changed(seed=noise)
    kept: dict[float, Survived] = {}

    def survives(impulse: float) -> bool:
        try:
            run = simulate_tsid(pushed(scenario, direction, impulse))
        except SimulationError:
            return False
        if stands(run):
            kept[impulse] = survived(run, direction)
        return impulse in kept

    low, high = largest(survives, dict(zip(DIRECTIONS, FIRST[loop], strict=True))[direction])
    return Border(low, high, kept.get(low))


def survived(run: TsidRecording, direction: str) -> Survived:
    """What is kept of a run."""
    model = run.law.model
    scratch, nq = model.create_scratch(), model.nq
    picked = np.flatnonzero(run.time >= BEGIN)[::EVERY]
    places, upright = [], 1.0
    for row in run["state"][picked]:
        terms = model.terms(scratch, row[:nq], row[nq:])  # its poses are of the scratch's latest state
        places.append(terms.com)
        upright = min(upright, *(terms.pose(contact.name)[0][2, 2] for contact in model.contacts))
    moved = (np.array(places) - places[0]) @ np.array(DIRECTIONS[direction])
    return Survived(run.time[picked] - BEGIN, moved, _base_speed(run)[picked], math.acos(min(upright, 1.0)))


def pushes(seed: int = 0, progress: Progress | None = None, executor: Executor | None = None) -> Reproduction:
    """C.pushes: the largest pushes survived while standing; through any Executor, else all processors here."""
    if executor is None:
        with processes(os.cpu_count() or 1) as pool:
            return pushes(seed, progress, pool)
    points = [(loop, direction, seed) for loop in LOOPS for direction in DIRECTIONS]
    found: list[Border] = sweep(border, points, executor=executor, chunk=1, seed=seed, progress=progress)
    return reproduction({point[:2]: one for point, one in zip(points, found, strict=True)})


def reproduction(found: dict[tuple[str, str], Border]) -> Reproduction:
    """Of all borders, by loop and direction."""
    values: dict[str, float] = {}
    for direction in DIRECTIONS:
        ours = found[OURS, direction]
        for other in (DAMPED, STIFF):
            values[f"{direction}: {OURS} over {other}"] = _over(ours.survived, found[other, direction].survived)
        values[f"{direction}: largest tilt of a foot, {OURS} [rad]"] = ours.run.tilt if ours.run else math.nan
    for (loop, direction), one in found.items():
        values[f"{direction}: impulse survived, {loop} [N s]"] = one.survived
    lines = tuple(
        (
            loop,
            *(f"{found[loop, d].survived:.1f} / {found[loop, d].fatal:.1f}" for d in DIRECTIONS),
            *(f"{1e3 * run.tilt:.0f}" if (run := found[loop, d].run) else "-" for d in DIRECTIONS),
        )
        for loop in LOOPS
    )
    headings = ("controller", *DIRECTIONS, *(f"tilt, {d} [mrad]" for d in DIRECTIONS))
    table = TextTable("impulse survived / not [N s], and the feet's largest tilt at the former", headings, lines)
    return Reproduction(
        "C.pushes", evaluated(values, expectations("c_pushes")), (table,), NOTES, {"c_pushes": _figure(found)}
    )


def _over(one: float, other: float) -> float:
    """A ratio; over nothing that was survived, over the least that was tried."""
    return one / max(other, LEAST)


def _figure(found: dict[tuple[str, str], Border]) -> Callable[[Any], None]:
    """Draws the centre of mass along the largest push survived, by direction and controller."""

    def draw(figure: Any) -> None:
        axes = figure.subplots(1, len(DIRECTIONS), sharey=True)
        for axis, direction in zip(axes, DIRECTIONS, strict=True):
            for loop in LOOPS:
                one = found[loop, direction]
                if one.run is not None:
                    axis.plot(one.run.time, 1e3 * one.run.moved, label=f"{loop}, {one.survived:.1f} N s")
            axis.set_title(direction)
            axis.set_xlabel("time after the push [s]")
            axis.legend(fontsize="x-small")
        axes[0].set_ylabel("centre of mass, along the push [mm]")

    return draw
