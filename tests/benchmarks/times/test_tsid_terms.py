"""What a tick of TSID costs before its solver: 30 joints, double support; printed as rows (run with -s)."""

import time

import numpy as np
import pytest
from tsid.problems import SOLES, Setup, model, robot, state

from drake_tc.tsid.assembly import reduce
from drake_tc.tsid.limits import AccelerationLimit, TorqueLimit, WrenchCones
from drake_tc.tsid.tasks import ComTask, ForceTask, PostureTask

from .machine import require

pytestmark = pytest.mark.benchmark
COUNT = 400


def test_terms_rows_and_reduction():
    it, machine, rng = model(), robot(), np.random.default_rng(0)
    tasks = (
        ComTask(100.0, 20.0),
        PostureTask(it, 1.0, 1.0, weight=1e-3),
        ForceTask(it, weight=1e-4, components=[1, 1, 1e-3, 2, 2, 2]),
    )
    limits = (
        TorqueLimit.of(machine),
        WrenchCones(SOLES),
        AccelerationLimit.of(it, period=1e-3),
    )
    scratch = it.create_scratch()
    start = it.terms(scratch, it.start, np.zeros(it.nv))
    references = [task.rest(start) for task in tasks]
    states = [state(rng, Setup()) for _ in range(50)]
    names = ("terms", "rows of 3 tasks and 3 limits", "reduction", "all before the solver")

    def stages():
        seconds = np.empty((COUNT, 4))
        for i in range(COUNT):
            q, v = states[i % len(states)]
            began = time.perf_counter()
            terms = it.terms(scratch, q, v)
            known = time.perf_counter()
            task_rows = [task.rows(terms, reference) for task, reference in zip(tasks, references, strict=True)]
            limit_rows = [limit.rows(terms) for limit in limits]
            listed = time.perf_counter()
            reduce(terms, task_rows, limit_rows)
            done = time.perf_counter()
            seconds[i] = known - began, listed - known, done - listed, done - began
        return dict(zip(names, seconds.T, strict=True))

    require({**dict.fromkeys(names[:-1], np.inf), names[-1]: 110e-6}, stages)
