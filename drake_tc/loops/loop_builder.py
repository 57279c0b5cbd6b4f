"""`LoopBuilder`: what the stages of a loop share while its diagram is being wired."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Multiplexer

from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.loops.ports import first_imu, picked
from drake_tc.loops.signal_log import SignalLog, add_log
from drake_tc.sensing.suite import SensorSuite

ScenarioT = TypeVar("ScenarioT")
DERIVATIVES = {"joint_estimate": 3, "imu_estimate": 2, "wrench_estimate": 1}
"""How many orders of a filtered signal the torque estimator reads: the value, and its first derivatives."""


@dataclass
class LoopBuilder(Generic[ScenarioT]):
    """A diagram under construction.

    Attributes:
        builder: Takes the systems.
        scenario: What is built.
        plant: Of the loop.
        period: Of control, sensors and log [s].
        signals: Name to port, of what is recorded.
        flag_names: Of the signal "flags", in order.
    """

    builder: DiagramBuilder
    scenario: ScenarioT
    plant: MultibodyPlant
    period: float
    signals: dict[str, OutputPort] = field(default_factory=dict)
    flag_names: tuple[str, ...] = ()

    def add(self, name: str, system: Any, **inputs: OutputPort) -> Any:
        """Add a system and connect its named inputs."""
        self.builder.AddNamedSystem(name, system)
        for port, source in inputs.items():
            self.builder.Connect(source, system.GetInputPort(port))
        return system

    def join(self, name: str, ports: Sequence[OutputPort]) -> OutputPort:
        """One port with the values of several, one below the other."""
        joined: Any = self.builder.AddNamedSystem(name, Multiplexer([port.size() for port in ports]))
        for index, port in enumerate(ports):
            self.builder.Connect(port, joined.get_input_port(index))
        output: OutputPort = joined.get_output_port()
        return output

    def filtered_readings(
        self, sensors: SensorSuite, window: int, orders: tuple[int, int], *, imu: bool = True
    ) -> dict[str, OutputPort]:
        """One Savitzky–Golay filter behind all sensors (Del Prete et al., 2016, section 2.1), read in its middle.

        Args:
            sensors: Encoders; the first IMU and the F/T sensors where the robot has them.
            window: Samples.
            orders: Of the polynomials: of the encoders, of the other sensors.
            imu: Whether the IMU is taken.

        Returns:
            The inputs of the torque estimator: `joint_estimate` (3n) [q; qdot; qddot], `imu_estimate` (12) and
                `wrench_estimate` (6k).
        """
        readings = {"joint_estimate": sensors.encoder.GetOutputPort("reading")}
        if sensors.imu is not None and imu:
            readings["imu_estimate"] = first_imu(self.builder, sensors.imu.GetOutputPort("reading"))
        if sensors.force_torque is not None:
            readings["wrench_estimate"] = sensors.force_torque.GetOutputPort("reading")
        sizes = [port.size() for port in readings.values()]
        n, total = sizes[0], sum(sizes)
        smooth = SavitzkyGolayFilter(total, window, [orders[0]] * n + [orders[1]] * (total - n), self.period)
        self.add("filter", smooth, signal=self.join("readings", list(readings.values())))
        first = dict(zip(readings, np.cumsum([0, *sizes[:-1]]).tolist(), strict=True))
        places = {
            name: [d * total + first[name] + i for d in range(DERIVATIVES[name]) for i in range(size)]
            for name, size in zip(readings, sizes, strict=True)
        }
        return picked(self.builder, "estimates", smooth.GetOutputPort("estimate"), places)

    def build(self, name: str) -> tuple[Diagram, SignalLog]:
        """The diagram, which gets this name, and the log of all recorded signals."""
        log = add_log(self.builder, self.signals, self.period)
        diagram = self.builder.Build()
        diagram.set_name(name)
        return diagram, log
