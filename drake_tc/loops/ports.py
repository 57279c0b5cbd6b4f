"""Ports made of other ports: a selection, the first IMU, the base's motion without delay."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, Demultiplexer, MatrixGain, Selector, SelectorParams

from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.loops.torque.parts import Parts


def picked(
    builder: DiagramBuilder, name: str, source: OutputPort, wanted: Mapping[str, list[int]]
) -> dict[str, OutputPort]:
    """Ports with some elements of another one each, by name."""
    params = SelectorParams()
    params.inputs = [SelectorParams.InputPortParams(name="all", size=source.size())]
    pick = SelectorParams.OutputSelection
    params.outputs = [
        SelectorParams.OutputPortParams(
            name=port, selections=[pick(input_port_index=0, input_offset=i) for i in elements]
        )
        for port, elements in wanted.items()
    ]
    selector = builder.AddNamedSystem(name, Selector(params))
    builder.Connect(source, selector.get_input_port(0))
    return {port: selector.GetOutputPort(port) for port in wanted}


def zeroed(parts: Parts, name: str, wrench: OutputPort) -> OutputPort:
    """F/T readings less the bias that the tare has found, by blocks of Drake's own: no call into Python."""
    builder, size = parts.builder, wrench.size()
    if not builder.HasSubsystemNamed("wrench_correction"):
        less: Any = -np.eye(size, size + 1)  # of the tare's [bias; count]
        gain = builder.AddNamedSystem("wrench_correction", MatrixGain(less))
        builder.Connect(builder.GetSubsystemByName("wrench_tare").GetOutputPort("memory"), gain.get_input_port())
    total = builder.AddNamedSystem(name, Adder(2, size))
    builder.Connect(wrench, total.get_input_port(0))
    builder.Connect(builder.GetSubsystemByName("wrench_correction").get_output_port(0), total.get_input_port(1))
    port: OutputPort = total.get_output_port()
    return port


def first_imu(builder: DiagramBuilder, reading: OutputPort) -> OutputPort:
    """The reading of the robot's first IMU, of those of all of them; what takes it out is made once."""
    if reading.size() == 6:
        return reading
    if not builder.HasSubsystemNamed("first_imu"):
        split: Any = builder.AddNamedSystem("first_imu", Demultiplexer([6, reading.size() - 6]))
        builder.Connect(reading, split.get_input_port())
    port: OutputPort = builder.GetSubsystemByName("first_imu").get_output_port(0)
    return port


def base_now(parts: Parts) -> OutputPort:
    """The IMU and its derivative at the end of the window: without delay, with twice the noise and more."""
    if parts.builder.HasSubsystemNamed("base_now"):
        made: OutputPort = parts.builder.GetSubsystemByName("base_now").GetOutputPort("imu_estimate")
        return made
    window, order = parts.scenario.filters.window, parts.scenario.filters.encoder_order
    smooth = SavitzkyGolayFilter(6, window, order, parts.scenario.dt, window - 1)
    imu: Any = parts.sensors.imu
    parts.add("base_predictor", smooth, signal=first_imu(parts.builder, imu.GetOutputPort("reading")))
    wanted = {"imu_estimate": list(range(12))}
    return picked(parts.builder, "base_now", smooth.GetOutputPort("estimate"), wanted)["imu_estimate"]
