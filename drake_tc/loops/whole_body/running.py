"""Run a diagram around robust TSID, and what the run leaves behind."""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context
from threadpoolctl import threadpool_limits

from drake_tc.errors import LogError, SimulationError
from drake_tc.loops.advancing import Progress, advance
from drake_tc.loops.whole_body.loop import TsidLoop, build_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.tsid.law import Law, Status
from drake_tc.types import FloatArray

CHUNK = 0.02
"""The state is looked at this often [s]."""
FALLEN = 0.6
"""Share of its first height above the floor below which the base counts as fallen."""


@dataclass(frozen=True, eq=False)
class TsidRecording:
    """Signals of one simulation, sampled every tick of the controller.

    Attributes:
        scenario, law: What was simulated.
        constraints: Names of the rows that `Status.LIMIT` counts.
        time: (T,) [s].
        signals: (T, width) each. Of the plant "state" (nq + nv) and "contact" (nv), the generalized forces of its true
            contacts; of the controller "torque", "acceleration", "contact_force", "status"; "applied_torque" at the
            joints; with drives "estimated_torque" and "command" too, and "estimated_state" where it is estimated; in
            paper C's loop "flags" of sensors that are not believed.
        seconds: Wall time that the simulation took [s].
        fell: When the robot was found fallen [s]; None: it stands.
        flag_names: Of the signal "flags", SENSOR/WHAT; empty without one.
    """

    scenario: TsidScenario
    law: Law
    constraints: tuple[str, ...]
    time: FloatArray
    signals: Mapping[str, FloatArray]
    seconds: float
    fell: float | None
    flag_names: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> FloatArray:
        """(T, width) of one signal.

        Raises:
            LogError: no such signal in this recording.
        """
        if name not in self.signals:
            raise LogError(f"no signal {name!r} recorded; recorded: {', '.join(sorted(self.signals))}")
        return self.signals[name]

    def status(self, which: Status) -> FloatArray:
        """(T,) of one part of the status."""
        return self["status"][:, which]

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds a second of wall time."""
        return float((self.time[-1] - self.time[0]) / self.seconds)


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
    return run_tsid(build_tsid(scenario, meshcat=meshcat), progress)


def run_tsid(loop: TsidLoop, progress: Progress | None = None) -> TsidRecording:
    """As `simulate_tsid`, for a diagram that is built."""
    simulator = Simulator(loop.diagram)
    context = simulator.get_mutable_context()
    loop.start(context)
    first, fallen = _height(loop, context), list[float]()

    def goes_on(now: float) -> bool:
        height = _height(loop, context)
        if not math.isfinite(height):
            raise SimulationError(f"system 'plant' has a state that is not finite by t = {now:.3f} s")
        if height < FALLEN * first:
            fallen.append(now)
        return not fallen

    scenario, begin = loop.scenario, time.perf_counter()
    with threadpool_limits(1):
        advance(simulator, scenario.duration, CHUNK, goes_on, plant_step=scenario.plant_step, progress=progress)
    seconds = time.perf_counter() - begin
    times, signals = loop.log.recorded(context)
    return TsidRecording(
        loop.scenario,
        loop.law,
        loop.controller.constraints,
        times,
        signals,
        seconds,
        fallen[0] if fallen else None,
        loop.flag_names,
    )


def _height(loop: TsidLoop, context: Context) -> float:
    """Of the base [m]."""
    plant: Any = loop.plant
    body = plant.GetBodyByName(loop.robot.base)
    return float(plant.EvalBodyPoseInWorld(plant.GetMyContextFromRoot(context), body).translation()[2])
