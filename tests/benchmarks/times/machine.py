"""What code costs on a machine that others use too, where the same code takes twice as long a second later.

The cost of code is its smallest cost over several rounds: whatever a round takes beyond that is the work of others.
"""

import time
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput

TICK = 1e-3
ROUNDS, PAUSE = 8, 0.2
"""Most rounds of a measurement, and the time between the first two [s]; each pause is longer by as much."""
GUARD = 1.5
"""A guard against regressions is no test of the goal: only what is slower than the goal by more than this fails. A busy
neighbour takes more from caches and memory than `slowness` sees."""
COPIES = 10
QUIET = 5.9e-6
"""What one copying system costs a tick on the machine and in the hour for which the budgets were set [s]."""
QUIET_ARRAYS = 1.12e-3
"""The same of `array_work` [s]: its cost over `QUIET`'s, six times measured in turn."""


class Copy(LeafSystem):
    """Six numbers in, the same six out, kept every tick: what any system in Python costs."""

    def __init__(self):
        super().__init__()
        port = self.DeclareVectorInputPort("in", 6)
        state = self.DeclareDiscreteState(6)
        self.DeclareVectorOutputPort(
            "out",
            6,
            lambda context, output: output.set_value(port.Eval(context)),
            {port.ticket(), self.discrete_state_ticket(state)},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(
            TICK, 0.0, lambda context, values: values.set_value(state, port.Eval(context))
        )


def copying() -> Simulator:
    """`COPIES` systems that copy, one behind the other."""
    builder = DiagramBuilder()
    port = builder.AddSystem(ConstantVectorSource(np.ones(6))).get_output_port()
    for _ in range(COPIES):
        system = builder.AddSystem(Copy())
        builder.Connect(port, system.get_input_port())
        port = system.get_output_port()
    LogVectorOutput(port, builder, TICK)
    return Simulator(builder.Build())


def array_work() -> float:
    """Twenty convolutions of 4096 samples and a loop in Python, which take no time in Drake."""
    values, total = np.random.default_rng(0).normal(size=4096), 0.0
    kernel = np.fft.rfft(np.hanning(4096))
    for _ in range(20):
        total += float(np.fft.irfft(np.fft.rfft(values) * kernel, 4096) @ values)
    for number in range(2000):
        total += 0.5 * number
    return total


def slowness() -> float:
    """What a copying system, or work on arrays, costs now over what it costs on a quiet machine; 1 where that is less.

    Drake's newer bindings cost less: with them the copying systems alone would call a slow machine a quiet one.
    """
    simulator = copying()
    simulator.Initialize()
    copies = _median(lambda tick: simulator.AdvanceTo(tick * TICK), 300) / COPIES / QUIET
    return max(1.0, copies, _median(lambda tick: array_work(), 50) / QUIET_ARRAYS)


def _median(work: Callable[[int], object], times: int) -> float:
    seconds = []
    for number in range(1, times + 1):
        begin = time.perf_counter()
        work(number)
        seconds.append(time.perf_counter() - begin)
    return float(np.median(seconds))


def require(goals: Mapping[str, float], measure: Callable[[], Mapping[str, ArrayLike]], rounds: int = ROUNDS) -> None:
    """Require that code costs no more than `GUARD` times its goals, and print a row for each.

    A round measures c = median / s, with s the larger `slowness` of before and after it. The smallest c over the rounds
    counts; they end as soon as all rows are within their bounds.

    Args:
        goals: By row, the cost on a quiet machine [s]; infinite for a row that is only printed.
        measure: One round: by row, times [s]. Rows that it measures in turn can be compared.
        rounds: Most rounds.
    """
    best: dict[str, tuple[float, str]] = {}
    for number in range(rounds):
        time.sleep(number * PAUSE)
        before, times = slowness(), measure()
        slow = max(before, slowness())
        for name in goals:
            tenth, median, p99 = np.percentile(times[name], [10, 50, 99])
            shown = f"median {_text(median)}, fastest tenth {_text(tenth)}, p99 {_text(p99)}, n {np.size(times[name])}"
            row = median / slow, f"{shown}, round {number + 1}, machine {slow:.2f} times as slow as a quiet one"
            best[name] = min(best.get(name, row), row)
        if not (missed := [name for name, goal in goals.items() if best[name][0] > GUARD * goal]):
            break
    lines = [f"{name}: {best[name][1]} (goal {_text(goal)})" for name, goal in goals.items()]
    print("\n" + "\n".join(lines))
    assert not missed, f"more than {GUARD} times slower than the goal: {missed}"


def _text(seconds: float) -> str:
    factor, unit = (1.0, "s") if seconds >= 1.0 else (1e3, "ms") if seconds >= 1e-3 else (1e6, "us")
    return f"{factor * seconds:.3g} {unit}"
