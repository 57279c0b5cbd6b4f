"""One log of all recorded signals of a diagram, as every log costs its share of a tick."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import LogVectorOutput, Multiplexer, VectorLogSink

from drake_tc.types import FloatArray


@dataclass(frozen=True, eq=False)
class SignalLog:
    """A log of signals, one below the other.

    Attributes:
        sink: The log.
        rows: Signal name to where it stands in it.
    """

    sink: VectorLogSink
    rows: Mapping[str, slice]

    def recorded(self, context: Context) -> tuple[FloatArray, dict[str, FloatArray]]:
        """What was logged in a run of the diagram: times (T,) [s], and the signals by name, (T, width) each."""
        log = self.sink.FindLog(context)
        data = np.asarray(log.data())
        return np.array(log.sample_times()), {name: data[rows].T.copy() for name, rows in self.rows.items()}


def add_log(builder: DiagramBuilder, signals: Mapping[str, OutputPort], period: float) -> SignalLog:
    """Log the signals every `period` [s]: a system `signals` that joins them, and `log`."""
    ends = np.cumsum([0, *(port.size() for port in signals.values())]).tolist()
    joined: Any = builder.AddNamedSystem("signals", Multiplexer([b - a for a, b in pairwise(ends)]))
    for index, port in enumerate(signals.values()):
        builder.Connect(port, joined.get_input_port(index))
    sink = LogVectorOutput(joined.get_output_port(), builder, period)
    sink.set_name("log")
    return SignalLog(sink, {name: slice(a, b) for name, (a, b) in zip(signals, pairwise(ends), strict=True)})
