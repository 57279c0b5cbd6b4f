"""Runs of one loop with its stages fused and apart, and how their logs are compared."""

from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from drake_tc.types import FloatArray


def advanced(loop: Any, duration: float) -> Simulator:
    """A simulator of the loop after `duration` [s]."""
    simulator = Simulator(loop.diagram)
    loop.start(simulator.get_mutable_context())
    simulator.Initialize()
    simulator.AdvanceTo(duration)
    return simulator


def recorded(log: Any, context: Context) -> dict[str, FloatArray]:
    """What a signal log has recorded, and `time`."""
    time, signals = log.recorded(context)
    return {"time": time, **signals}


def assert_same(fused: dict[str, FloatArray], apart: dict[str, FloatArray]) -> None:
    """To the last bit."""
    assert fused.keys() == apart.keys()
    for name, values in apart.items():
        assert np.array_equal(fused[name], values, equal_nan=True), name
