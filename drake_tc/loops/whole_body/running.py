"""Run a diagram around robust TSID, and what the run leaves behind."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pydrake.systems.framework import Context
from threadpoolctl import threadpool_limits

from drake_tc.errors import SimulationError
from drake_tc.loops.advancing import Progress
from drake_tc.loops.recording import Recording
from drake_tc.loops.whole_body.loop import TsidLoop, build_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.tsid.law import Law, Status
from drake_tc.types import FloatArray

FALLEN = 0.6
"""Share of its first height above the floor below which the base counts as fallen."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TsidRecording(Recording):
    """A run of the whole-body loop, sampled every tick of the controller.

    Signals: of the plant "state" (nq + nv) and "contact" (nv), the generalized forces of its true contacts; of the
    controller "torque", "acceleration", "contact_force", "status"; "applied_torque" at the joints; with drives
    "estimated_torque" and "command" too, and "estimated_state" where it is estimated; "flags" of sensors, SENSOR/WHAT,
    where they are checked.

    Attributes:
        scenario, law: What was simulated.
        constraints: Names of the rows that `Status.LIMIT` counts.
        fell: When the robot was found fallen [s]; None: it stands.
    """

    scenario: TsidScenario
    law: Law
    constraints: tuple[str, ...]
    fell: float | None

    def status(self, which: Status) -> FloatArray:
        """(T,) of one part of the status."""
        return self["status"][:, which]


def simulate_tsid(scenario: TsidScenario, progress: Progress | None = None, *, meshcat: bool = False) -> TsidRecording:
    """Build a scenario's diagram, run it, and return what was logged; a robot that falls ends the run.

    Args:
        scenario: What to run.
        progress: Told what is done and which share.
        meshcat: Show the robot in a browser.

    Raises:
        ParamsError: a scenario that cannot be built.
        SimulationError: the plant's solver failed, or its state is not finite; says when.
    """
    if progress:
        progress("building", 0.0)
    return run_tsid(build_tsid(scenario, meshcat=meshcat, fused=True), progress)


def run_tsid(loop: TsidLoop, progress: Progress | None = None) -> TsidRecording:
    """As `simulate_tsid`, for a diagram that is built."""
    fallen = list[float]()

    def watch(context: Context) -> Callable[[float], bool]:
        first = _height(loop, context)

        def goes_on(now: float) -> bool:
            height = _height(loop, context)
            if not math.isfinite(height):
                raise SimulationError(f"system 'plant' has a state that is not finite by t = {now:.3f} s")
            if height < FALLEN * first:
                fallen.append(now)
            return not fallen

        return goes_on

    with threadpool_limits(1):
        found = loop.run(watch, progress)
    return TsidRecording(
        **vars(found),
        scenario=loop.scenario,
        law=loop.law,
        constraints=loop.controller.constraints,
        fell=fallen[0] if fallen else None,
    )


def _height(loop: TsidLoop, context: Context) -> float:
    """Of the base [m]."""
    plant: Any = loop.plant
    body = plant.GetBodyByName(loop.robot.base)
    return float(plant.EvalBodyPoseInWorld(plant.GetMyContextFromRoot(context), body).translation()[2])
