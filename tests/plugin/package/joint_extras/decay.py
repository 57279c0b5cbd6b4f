"""A diagram and a reproduction that drake-tc knows by name once this package is installed."""

import math

from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import LinearSystem, LogVectorOutput, MatrixGain

from drake_tc.loops import function_entry
from drake_tc.report.figure_row import Expectation, Reproduction, reproduced_row

PERIOD, SHARE = 0.01, 0.1


def decay() -> Diagram:
    """x[n+1] = x[n] - 0.1 x[n] every 10 ms."""
    builder = DiagramBuilder()
    store = builder.AddNamedSystem("store", LinearSystem([[1.0]], [[1.0]], [[1.0]], [[0.0]], PERIOD))
    drain = builder.AddNamedSystem("drain", MatrixGain([[-SHARE]]))
    builder.Connect(store.get_output_port(), drain.get_input_port())
    builder.Connect(drain.get_output_port(), store.get_input_port())
    LogVectorOutput(store.get_output_port(), builder, PERIOD).set_name("level")
    return builder.Build()


DECAY = function_entry("decay", decay)


def half_life(seed: int, progress: object) -> Reproduction:
    """Ticks until half is left, by counting, against log(2)/-log(1 - share), rounded up."""
    level, ticks = 1.0, 0
    while level > 0.5:
        level, ticks = level * (1.0 - SHARE), ticks + 1
    expected = Expectation("half life", math.ceil(-math.log(2.0) / math.log(1.0 - SHARE)), "within", 0.5, "ticks")
    return Reproduction("X.half_life", (reproduced_row("half life", ticks, expected),), notes=("Counted.",))
