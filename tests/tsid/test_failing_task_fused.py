"""An exception in a task does the same in a loop whose stages run in one system as in stages apart."""

import logging
from typing import Any

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput

from drake_tc.errors import SimulationError
from drake_tc.loops.fused import fuse
from drake_tc.sensing.sensor import Sensor, SensorFault, SensorSpec
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.controller import RobustTsid
from drake_tc.tsid.law import Law, Status

from .test_law_extension import FILE, FailsInMotion

OUTPUTS = ("torque", "acceleration", "contact_force", "status")


class SometimesMoving(LeafSystem):
    """The state of a robot that moves from 3 to 6 ms and after 12 ms."""

    def __init__(self, law: Law) -> None:
        super().__init__()
        self._rest = np.concatenate((law.model.start, np.zeros(law.model.nv)))
        self.DeclareVectorOutputPort("state", self._rest.size, self._write, {self.time_ticket()})

    def _write(self, context: Any, vector: Any) -> None:
        time, state = context.get_time(), self._rest.copy()
        if 0.003 < time < 0.006 or time > 0.012:
            state[-1] = 0.01 * np.sin(100.0 * time)
        vector.set_value(state)


def simulated(law: Law, *, fused: bool, strict: bool) -> tuple[str, list[Any]]:
    """What was raised, and the logs; the state is lost from 8 to 10 ms."""
    builder = DiagramBuilder()
    moving, controller = builder.AddSystem(SometimesMoving(law)), builder.AddSystem(RobustTsid(law, strict=strict))
    lost, size = (
        SensorFault(kind="dropped", start=0.008, duration=0.002, channels=(3,)),
        moving.get_output_port().size(),
    )
    sensor = builder.AddSystem(Sensor(size, SensorSpec(), law.period, (lost,)))
    builder.Connect(moving.get_output_port(), sensor.get_input_port(0))
    builder.Connect(sensor.get_output_port(0), controller.GetInputPort("estimated_state"))
    logs = [LogVectorOutput(controller.GetOutputPort(name), builder, 0.25 * law.period) for name in OUTPUTS]
    if fused:
        assert fuse(builder) is not None
    simulator, raised = Simulator(builder.Build()), ""
    try:
        simulator.AdvanceTo(0.019)
    except SimulationError as error:
        raised = str(error)
    return raised, [log.FindLog(simulator.get_context()).data().copy() for log in logs]


@pytest.mark.parametrize("strict", [False, True])
def test_it_does_the_same_in_one_system(strict, caplog):
    law, found = load_law(FILE).with_tasks(FailsInMotion()), []
    for fused in (True, False):
        caplog.clear()
        with caplog.at_level(logging.ERROR, logger="drake_tc.tsid"):
            raised, logs = simulated(law, fused=fused, strict=strict)
        found.append((raised, [record.getMessage() for record in caplog.records], logs))
    assert found[0][:2] == found[1][:2]
    assert bool(found[1][0]) == strict and len(found[1][1]) == (not strict)
    for one, other in zip(found[0][2], found[1][2], strict=True):
        assert np.array_equal(one, other)
    assert strict or set(found[1][2][-1][Status.OUTCOME]) == {0.0, 2.0}
