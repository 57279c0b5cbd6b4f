"""Ports made of other ports: a selection, the first IMU."""

from collections.abc import Mapping
from typing import Any

from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Demultiplexer, Selector, SelectorParams


def picked(
    builder: DiagramBuilder, name: str, source: OutputPort, requested: Mapping[str, list[int]]
) -> dict[str, OutputPort]:
    """Ports with some elements of another one each, by name."""
    params = SelectorParams()
    params.inputs = [SelectorParams.InputPortParams(name="all", size=source.size())]
    pick = SelectorParams.OutputSelection
    params.outputs = [
        SelectorParams.OutputPortParams(
            name=port, selections=[pick(input_port_index=0, input_offset=i) for i in elements]
        )
        for port, elements in requested.items()
    ]
    selector = builder.AddNamedSystem(name, Selector(params))
    builder.Connect(source, selector.get_input_port(0))
    return {port: selector.GetOutputPort(port) for port in requested}


def first_imu(builder: DiagramBuilder, reading: OutputPort) -> OutputPort:
    """The reading of the robot's first IMU, of those of all of them; what takes it out is made once."""
    if reading.size() == 6:
        return reading
    if not builder.HasSubsystemNamed("first_imu"):
        split: Any = builder.AddNamedSystem("first_imu", Demultiplexer([6, reading.size() - 6]))
        builder.Connect(reading, split.get_input_port())
    port: OutputPort = builder.GetSubsystemByName("first_imu").get_output_port(0)
    return port
