"""How fast this machine is just now: on a shared one the same code takes twice as long an hour later."""

import time

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput

TICK = 1e-3
COPIES = 10
QUIET = 5.9e-6
"""What one copying system costs a tick on the machine and in the hour for which the budgets were set [s]."""


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


def slowness() -> float:
    """What a copying system costs now over what it costs on a quiet machine; 1 where that is less."""
    simulator = copying()
    simulator.Initialize()
    seconds = []
    for tick in range(1, 301):
        begin = time.perf_counter()
        simulator.AdvanceTo(tick * TICK)
        seconds.append(time.perf_counter() - begin)
    return max(1.0, float(np.median(seconds)) / COPIES / QUIET)
