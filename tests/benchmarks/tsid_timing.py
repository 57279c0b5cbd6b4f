"""What a tick of robust TSID costs, stage by stage, along a motion of the humanoid; and its diagram as a whole."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydrake.systems.analysis import Simulator
from threadpoolctl import threadpool_limits

from drake_tc.loops.recording import Progress
from drake_tc.loops.whole_body.references import task_source
from drake_tc.loops.whole_body.running import TsidLoop, TsidRecording, build_tsid, simulate_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.tsid.law import Law
from drake_tc.tsid.priorities import Priorities
from drake_tc.tsid.robust.formulation import MeasureName, Use
from drake_tc.tsid.tick import TickInput, advance_tick, problem_at
from drake_tc.types import FloatArray
from tests.benchmarks.drake_terms import DrakeTerms
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.tsid_parts import part_timings

FORMS: tuple[tuple[MeasureName, Use], ...] = (
    ("classic", "trade_off"),
    ("individual", "trade_off"),
    ("box", "trade_off"),
    ("rectangle", "trade_off"),
    ("individual", "constraint"),
    ("individual", "null_space"),
)
REPEATS = 5


def tick_timings(scenario: TsidScenario, progress: Progress) -> list[BenchmarkRow]:
    """Rows of `python -m tests.benchmarks tick`: own time of the thread [us], from a warm start, BLAS on one core.

    Args:
        scenario: A motion; its controller is timed with each measure of robustness.
        progress: Told what is timed and which share is done.
    """
    with threadpool_limits(1):
        progress("recording the motion", 0.0)
        recording = simulate_tsid(scenario)
        references = _references(recording)
        rows = _stages(recording, references)
        for number, (measure, use) in enumerate(FORMS):
            name = measure if use == "trade_off" else f"{measure}, {use}"
            progress(f"a tick, {name}", (1 + number) / (2 + len(FORMS)))
            formulation = replace(recording.law.formulation, measure=measure, use=use)
            rows += _ticks(name, replace(recording.law, formulation=formulation), recording, references)
        progress("ticks with strict priorities", 0.9)
        for name, law in strict_laws(recording.law):
            rows += _ticks(name, law, recording, references)
        progress("the diagram", 1.0 - 1.0 / (2 + len(FORMS)))
        rows += part_timings(recording, references, REPEATS)
        rows.append(diagram_timing(scenario))
    return rows


def strict_laws(law: Law) -> list[tuple[str, Law]]:
    """The law with each task on a level of its own, and robustness below them, nowhere, or under the first."""
    count = len(law.tasks)
    levels = tuple(range(1, count + 1))
    classic = replace(law.formulation, measure="classic", use="trade_off")
    middle = Priorities((1, *(each + 1 for each in levels[1:])), robustness=2)
    return [
        ("strict levels, robustness lowest", replace(law, priorities=Priorities(levels, robustness=count + 1))),
        ("strict levels, classic", replace(law, formulation=classic, priorities=Priorities(levels))),
        ("strict levels, robustness second", replace(law, priorities=middle)),
    ]


def _references(recording: TsidRecording) -> list[list[FloatArray]]:
    """One a task, a tick."""
    law, motion = recording.law, recording.scenario.motion
    start = law.starting_terms()
    columns: list[list[FloatArray]] = []
    for task in law.tasks:
        if task.name not in motion:
            columns.append([task.rest(start)] * recording.time.size)
            continue
        source = task_source(law, task.name, motion[task.name])
        context, column = source.CreateDefaultContext(), []
        for instant in recording.time:
            context.SetTime(instant)
            column.append(np.array(source.get_output_port().Eval(context)))
        columns.append(column)
    return [list(row) for row in zip(*columns, strict=True)]


def _stages(recording: TsidRecording, references: Sequence[Sequence[FloatArray]]) -> list[BenchmarkRow]:
    """Terms; all of the problem, terms included."""
    law, model = recording.law, recording.law.model
    scratch, active = model.create_scratch(), (True,) * len(model.contacts)
    terms, problem = [], []
    for state, desired in zip(recording["state"], references, strict=True):
        begin = time.thread_time()
        model.terms(scratch, state[: model.nq], state[model.nq :], active)
        known = time.thread_time()
        problem_at(law, scratch, TickInput(state, desired, active))
        problem.append(time.thread_time() - known)
        terms.append(known - begin)
    return [
        BenchmarkRow.of_values("terms of the dynamics", "us", terms, 1e6),
        BenchmarkRow.of_values("terms, rows and reduction to the torques", "us", problem, 1e6),
    ]


def _ticks(
    name: str, law: Law, recording: TsidRecording, references: Sequence[Sequence[FloatArray]]
) -> list[BenchmarkRow]:
    """The ticks of the motion, each beside pydrake's terms at its state, and what its slow ticks cost.

    The motion is run REPEATS times, and each tick counts with its fastest run: the work is the same each time, and what
    a busy neighbour adds is not.
    """
    model, drake, states = law.model, DrakeTerms(law.model), recording["state"]
    scratch, active = model.create_scratch(), (True,) * len(model.contacts)
    seconds = np.full((2, len(states)), np.inf)
    for _ in range(REPEATS):
        before, after = np.zeros((2, law.memory.size))
        for number, (state, desired) in enumerate(zip(states, references, strict=True)):
            begin = time.thread_time()
            advance_tick(law, scratch, TickInput(state, desired, active), before, after)
            solved = time.thread_time()
            drake(state)
            taken = solved - begin, time.thread_time() - solved
            seconds[:, number] = np.minimum(seconds[:, number], taken)
            before, after = after, before
    own = BenchmarkRow.of_values(f"a tick, everything: {name}", "us", seconds[0, 1:], 1e6)
    beside = BenchmarkRow.of_values(f"pydrake's terms, beside {name}", "us", seconds[1, 1:], 1e6)
    return [own, beside, _ratio(f"{name}, over pydrake's terms", own.value / beside.value, own.n),
            _ratio(f"{name}, 99th percentile over median", own.highest / own.value, own.n)]  # fmt: skip


def _ratio(name: str, value: float, n: int) -> BenchmarkRow:
    return BenchmarkRow(name, value, "1", n=n)


def diagram_timing(scenario: TsidScenario) -> BenchmarkRow:
    """Single ticks of controller, plant with contact, references and log; each with its fastest run."""
    loop = build_tsid(scenario, fused=True)
    seconds = np.array([_diagram_ticks(loop, scenario) for _ in range(REPEATS)]).min(axis=0)
    title = f"the diagram, a tick of {1e3 * loop.law.period:g} ms: controller, plant with contact, log"
    return BenchmarkRow.of_values(title, "us", seconds[1:], 1e6)


def _diagram_ticks(loop: TsidLoop, scenario: TsidScenario) -> list[float]:
    """Own time of each tick [s]; the first one warms up."""
    simulator, period, seconds = Simulator(loop.diagram), loop.law.period, list[float]()
    loop.start(simulator.get_mutable_context())
    simulator.Initialize()
    for tick in range(1, round(scenario.duration / period) + 1):
        begin = time.thread_time()
        simulator.AdvanceTo(tick * period)
        seconds.append(time.thread_time() - begin)
    return seconds
