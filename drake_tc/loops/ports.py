"""Ports made of other ports: a selection, the first IMU."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
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


def split(builder: DiagramBuilder, name: str, source: OutputPort, sizes: Sequence[int]) -> list[OutputPort]:
    """Ports with so many elements of another one each, in its order.

    A Demultiplexer copies blocks. A Selector, which evaluates its input anew for each element, stands in its place only
    where a port is empty, which a Demultiplexer refuses.
    """
    if not all(sizes):
        ends = np.cumsum([0, *sizes]).tolist()
        wanted = {str(i): list(range(*part)) for i, part in enumerate(pairwise(ends))}
        return list(picked(builder, name, source, wanted).values())
    blocks: Any = builder.AddNamedSystem(name, Demultiplexer(list(sizes)))
    builder.Connect(source, blocks.get_input_port())
    return [blocks.get_output_port(i) for i in range(len(sizes))]


def first_imu(builder: DiagramBuilder, reading: OutputPort) -> OutputPort:
    """The reading of the robot's first IMU, of those of all of them; what takes it out is made once."""
    if reading.size() == 6:
        return reading
    if not builder.HasSubsystemNamed("first_imu"):
        split: Any = builder.AddNamedSystem("first_imu", Demultiplexer([6, reading.size() - 6]))
        builder.Connect(reading, split.get_input_port())
    port: OutputPort = builder.GetSubsystemByName("first_imu").get_output_port(0)
    return port
