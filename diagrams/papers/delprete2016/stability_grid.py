"""A.stability_grid: the linear verdict against time simulation, over a grid of loops of one joint.

The simulated drive has a dead zone (which the controller's model inverts), the command its limits; the linear loop has
neither. Dry friction is left out of
both: it only ever holds a joint (`A.stability` says what it does to a joint that slides).
"""

import itertools
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.analysis.sweep import processes, sweep
from drake_tc.analysis.torque_loop.one_joint import one_joint_loop
from drake_tc.control.joint_loop import JointLoop
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.loops.scenarios import ModelFactors
from drake_tc.loops.torque.default_gains import joint_loops
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.stages import actuator_models, loop_robot, sliding_scenario
from drake_tc.registry import diagram_entry
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.types import TextTable

JOINT = "r_hip_yaw"
WINDOWS = (20, 40, 80, 120)
KPS = (0.0, 1.0, 2.0, 4.0)
KFS = (0.0, 0.5, 1.0, 2.0)
OVER = (0.9, 1.05, 1.2, 1.4)
"""Factors on K_v in the controller's model."""
STIFFNESS = 300.0
"""Of the spring that the foot turns against [N m/rad]."""
K6 = 0.25
SIMULATED = ("viscous", "rotor_inertia", "deadzone")
BEGIN, LASTS = 0.3, 1.6
"""The loop is kicked after `BEGIN` and watched for `LASTS` [s]."""
EARLY, LATE = (0.2, 0.6), (1.2, 1.6)
"""Where speeds are compared [s after the kick]."""
KICK = 0.5
"""[rad/s]: the drive's effort at that speed is twenty times its dead zone."""
NOTES = (
    f"Simulated: {JOINT} alone, foot against a spring of {STIFFNESS:g} N m/rad, K6 = {K6:g}, perfect sensors, dead zone"
    " and limits as on the whole leg, no dry friction. Unstable means: the RMS speed 1.2 to 1.6 s after a kick is above"
    " that after 0.2 to 0.6 s, or the fault monitor had to stop the joint.",
    "A loop whose eigenvalue lies so close to the border that it grows or decays by less than the two windows can show"
    " is still counted.",
)


@dataclass(frozen=True)
class GridPoint:
    """One loop: window [samples], Kp, Kf, factor on K_v."""

    window: int
    kp: float
    kf: float
    over: float


@dataclass(frozen=True)
class Verdict:
    """What both say.

    Attributes:
        point: Which loop.
        spectral_radius: Of the linear loop.
        ratio: Late over early RMS speed in simulation; infinite where the fault monitor had to stop the joint.
        without_dead_zone: The same without dead zone, where the two disagree; else None.
    """

    point: GridPoint
    spectral_radius: float
    ratio: float
    without_dead_zone: float | None = None

    @property
    def agrees(self) -> bool:
        """Linear and simulated verdict are the same."""
        return (self.spectral_radius > 1.0) == (self.ratio > 1.0)

    @property
    def why(self) -> str:
        """What explains a disagreement."""
        if self.agrees:
            return ""
        freed = self.without_dead_zone
        if freed is not None and (freed > 1.0) == (self.spectral_radius > 1.0):
            return "dead zone"
        if self.spectral_radius > 1.0:
            return "saturation" if self.ratio > 0.8 else "unexplained"
        return "unexplained"


def grid() -> list[GridPoint]:
    """All points."""
    return [GridPoint(*values) for values in itertools.product(WINDOWS, KPS, KFS, OVER)]


def linear_loop(point: GridPoint) -> JointLoop:
    """In closed form."""
    loop: JointLoop = joint_loops(_scenario(point))[JOINT]
    return replace(loop, environment_stiffness=STIFFNESS)


def verdict(point: GridPoint, seed: int = 0) -> Verdict:
    """Linear and simulated verdict on one loop; nothing in it is random, so the seed changes nothing."""
    radius = linear_loop(point).spectral_radius()
    found = Verdict(point, radius, growth(point))
    return found if found.agrees else replace(found, without_dead_zone=growth(point, dead_zone=False))


def growth(point: GridPoint, *, dead_zone: bool = True) -> float:
    """Late over early RMS speed after a kick; without dead zone neither the drive nor its assumed model has one."""
    scenario = _scenario(point)
    if dead_zone:
        loop = one_joint_loop(scenario, JOINT, STIFFNESS, _drive(scenario, SIMULATED))
    else:
        with TemporaryDirectory() as folder:
            loop = one_joint_loop(sliding_scenario(scenario, Path(folder)), JOINT, STIFFNESS)
    time, speed = loop.speed_after(loop.settled(BEGIN), KICK, LASTS)
    if time[-1] < LASTS - 0.05:
        return float("inf")
    early, late = (np.sqrt(np.mean(speed[(time >= a) & (time <= b)] ** 2)) for a, b in (EARLY, LATE))
    return float(late / early)


def _drive(scenario: Scenario, names: Sequence[str]) -> ActuatorModel:
    model: ActuatorModel = actuator_models(scenario, loop_robot(scenario))[JOINT]
    return replace(model, effects=tuple(value for value in model.effects if value.key in names))


def _scenario(point: GridPoint) -> Scenario:
    scenario: Scenario = diagram_entry("hrp2_leg").scenario("hanging")
    return replace(
        scenario,
        duration=BEGIN + LASTS + 0.1,
        sensors="perfect",
        tare=0.0,
        guard=replace(scenario.guard, start_time=0.05),
        gains=replace(scenario.gains, k6=K6, k7=0.0, kp=point.kp, kf=point.kf),
        filters=replace(scenario.filters, window=point.window),
        model_factors=ModelFactors(k_v=point.over),
    )


def stability_grid(seed: int = 0, progress: Progress | None = None, points: Sequence[GridPoint] = ()) -> Reproduction:
    """A.stability_grid, on two processes."""
    chosen = list(points) or grid()
    with processes(min(2, os.cpu_count() or 1)) as workers:
        found: list[Verdict] = sweep(verdict, chosen, executor=workers, progress=progress, seed=seed)
    wrong = [each for each in found if not each.agrees]
    unstable = [each.spectral_radius > 1.0 for each in found]
    values = {
        "loops": float(len(found)),
        "unstable loops, by spectral radius": float(sum(unstable)),
        "verdicts that disagree": 100.0 * len(wrong) / len(found),
        "disagreements not explained": float(sum(each.why == "unexplained" for each in wrong)),
        "largest |spectral radius - 1| of a disagreement": max(
            (abs(e.spectral_radius - 1.0) for e in wrong), default=0.0
        ),
    }
    rows = tuple(
        (
            f"N = {e.point.window}, Kp = {e.point.kp:g}, Kf = {e.point.kf:g}, K_v x {e.point.over:g}",
            f"{e.spectral_radius:.5f}",
            f"{e.ratio:.3g}",
            "-" if e.without_dead_zone is None else f"{e.without_dead_zone:.3g}",
            e.why,
        )
        for e in wrong
    )
    headings = ("loop", "spectral radius", "late/early speed", "the same without dead zone", "explained by")
    tables = (TextTable("verdicts that disagree", headings, rows),) if rows else ()

    def draw(figure: Any) -> None:
        axis = figure.subplots()
        radius, ratio = (np.array([getattr(e, name) for e in found]) for name in ("spectral_radius", "ratio"))
        axis.semilogy(radius, np.clip(ratio, 1e-3, 1e3), ".")
        axis.axvline(1.0, color="0.6")
        axis.axhline(1.0, color="0.6")
        axis.set_xlabel("spectral radius of the linear loop")
        axis.set_ylabel("late over early speed in simulation")

    rows_evaluated = evaluated(values, expectations("a_stability_grid")) if not points else evaluated(values, {})
    return Reproduction("A.stability_grid", rows_evaluated, tables, NOTES, {"stability_grid": draw})
