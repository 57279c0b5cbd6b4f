"""Ports of the torque loop made of others: zeroed F/T readings, the base's motion without delay."""

from typing import Any

import numpy as np
from pydrake.systems.framework import OutputPort
from pydrake.systems.primitives import Adder, MatrixGain

from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.loops.ports import first_imu, picked
from drake_tc.loops.torque.builder import TorqueLoopBuilder


def zeroed(parts: TorqueLoopBuilder, name: str, wrench: OutputPort) -> OutputPort:
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


def base_now(parts: TorqueLoopBuilder) -> OutputPort:
    """The IMU and its derivative at the end of the window: without delay, with twice the noise and more."""
    if parts.builder.HasSubsystemNamed("base_now"):
        made: OutputPort = parts.builder.GetSubsystemByName("base_now").GetOutputPort("imu_estimate")
        return made
    window, order = parts.scenario.filters.window, parts.scenario.filters.encoder_order
    smooth = SavitzkyGolayFilter(6, window, order, parts.scenario.dt, window - 1)
    imu: Any = parts.sensors.imu
    parts.add("base_predictor", smooth, signal=first_imu(parts.builder, imu.GetOutputPort("reading")))
    requested = {"imu_estimate": list(range(12))}
    return picked(parts.builder, "base_now", smooth.GetOutputPort("estimate"), requested)["imu_estimate"]
