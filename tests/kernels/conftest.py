"""A few ticks of robust TSID and of the whole series-elastic loop, so that their kernels have run in a loop."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import drake_tc.diagrams
import drake_tc.models
from drake_tc.loops.whole_body.running import simulate_tsid
from drake_tc.registry import tsid_entry
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.law import Status
from drake_tc.tsid.qp.problem import Outcome
from drake_tc.tsid.tick import PreviousTick, solve_tick


@dataclass(frozen=True)
class Ticks:
    """What came of them."""

    solved: bool


@pytest.fixture(scope="session")
def humanoid_ticks():
    law = load_law(Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_tsid.yaml")
    model, before = law.model, PreviousTick(np.zeros(law.model.n), None)
    scratch, references = model.create_scratch(), [task.rest(law.starting_terms()) for task in law.tasks]
    state = np.concatenate((model.start, np.zeros(model.nv)))
    for array in (state, *references):
        array.setflags(write=False)
    for active in ((True, True), (True, False), (True, True)):
        tick = solve_tick(law, scratch, state, references, active, before)
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
