"""A few ticks of robust TSID and of the loops of leg and series-elastic humanoid, after which the kernels have run."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

import drake_tc.diagrams
import drake_tc.models
from drake_tc.loops.torque.running import build_loop
from drake_tc.loops.whole_body.running import simulate_tsid
from drake_tc.registry import diagram_entry, tsid_entry
from drake_tc.sensing.spec import SensorFault
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.law import PreviousTick, Status
from drake_tc.tsid.qp import Outcome
from drake_tc.tsid.tick import TickInput, solve_tick


@dataclass(frozen=True)
class Ticks:
    """What came of them."""

    solved: bool


@pytest.fixture(scope="session")
def leg_ticks():
    """Ticks of the leg's loop with every stage on and a sensor that fails, from which all of its kernels have run."""
    faults = {"imu": (SensorFault("dropped", start=0.03, duration=0.01),)}
    loop = build_loop(diagram_entry("hrp2_leg").scenario("brisk_swing").changed(duration=0.06, faults=faults))
    simulator = Simulator(loop.diagram)
    loop.start(simulator.get_mutable_context())
    simulator.AdvanceTo(0.06)
    return round(simulator.get_context().get_time() / loop.period)


@pytest.fixture(scope="session")
def humanoid_ticks():
    law = load_law(Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_tsid.yaml")
    model, before = law.model, PreviousTick(np.zeros(law.model.n), None)
    scratch, references = model.create_scratch(), [task.rest(law.starting_terms()) for task in law.tasks]
    state = np.concatenate((model.start, np.zeros(model.nv)))
    for array in (state, *references):
        array.setflags(write=False)
    for active in ((True, True), (True, False), (True, True)):
        tick = solve_tick(law, scratch, TickInput(state, references, active), before)
        before = PreviousTick(tick.torque, tick.start)
        if tick.error is not None or tick.status[Status.OUTCOME] == Outcome.FAILED:
            return Ticks(False)
    return Ticks(True)


@pytest.fixture(scope="session", params=["cop", "foot_centre_imu"])
def series_elastic_ticks(request):
    file = Path(drake_tc.diagrams.__path__[0]) / "coman.scenario.yaml"
    scenario = tsid_entry().scenario("stand", file)
    estimator = replace(scenario.estimator, method=request.param)
    found = simulate_tsid(scenario.changed(duration=0.02, estimator=estimator))
    return Ticks(found.fell is None)
