"""`LoopBuilder`: what the stages of a loop share while its diagram is being wired.

Ports made of other ports: a selection, the first IMU.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Generic, TypeVar

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import (
    Adder,
    Demultiplexer,
    DiscreteTimeDelay,
    MatrixGain,
    Multiplexer,
    Selector,
    SelectorParams,
)

from drake_tc.errors import ParamsError
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.sensing.suite import Readings
from drake_tc.types import FloatArray


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


def behind(builder: DiagramBuilder, name: str, block: Any, *sources: OutputPort) -> OutputPort:
    """The first output of a block that is added, and whose inputs are connected to ports in their order."""
    builder.AddNamedSystem(name, block)
    for number, source in enumerate(sources):
        builder.Connect(source, block.get_input_port(number))
    output: OutputPort = block.get_output_port(0)
    return output


def product(builder: DiagramBuilder, name: str, matrix: FloatArray, port: OutputPort) -> OutputPort:
    """A matrix times a port, by a block of Drake's own."""
    gain: Any = matrix
    return behind(builder, name, MatrixGain(D=gain), port)


def total(builder: DiagramBuilder, name: str, *ports: OutputPort) -> OutputPort:
    """The sum of ports of one size, by a block of Drake's own."""
    return behind(builder, name, Adder(len(ports), ports[0].size()), *ports)


def late(builder: DiagramBuilder, voltage: OutputPort, period: float, ticks: int) -> OutputPort:
    """The voltages of tick k, which act from tick k + `ticks` on: a system `loop_delay` where there is a delay."""
    if not ticks:
        return voltage
    return behind(builder, "loop_delay", DiscreteTimeDelay(period, ticks - 1, voltage.size()), voltage)


def first_imu(builder: DiagramBuilder, reading: OutputPort) -> OutputPort:
    """The reading of the robot's first IMU, of those of all of them; what takes it out is made once."""
    if reading.size() == 6:
        return reading
    if not builder.HasSubsystemNamed("first_imu"):
        return split(builder, "first_imu", reading, [6, reading.size() - 6])[0]
    port: OutputPort = builder.GetSubsystemByName("first_imu").get_output_port(0)
    return port


ScenarioT = TypeVar("ScenarioT")
DERIVATIVES = {"joint_estimate": 3, "imu_estimate": 2, "wrench_estimate": 1}
"""How many orders of a filtered signal the torque estimator reads: the value, and its first derivatives."""
FILTERED = {"joint_estimate": "position", "imu_estimate": "imu", "wrench_estimate": "wrench"}
"""Filtered signal to the reading that it is made of: the input ports of a filter of the user's own."""


@dataclass
class LoopBuilder(Generic[ScenarioT]):
    """A diagram under construction.

    Attributes:
        builder: Takes the systems.
        scenario: What is built.
        plant: Of the loop; None where a controller is wired without one.
        period: Of control, sensors and log [s].
        signals: Name to port, of what is recorded.
        flag_names: Of the signal "flags", in order.
        stages: Stage to the user's own system in its place, and "stage.port" to one behind this output port.
        systems: Stage to the system that was added.
    """

    builder: DiagramBuilder
    scenario: ScenarioT
    plant: MultibodyPlant | None
    period: float
    signals: dict[str, OutputPort] = field(default_factory=dict)
    flag_names: tuple[str, ...] = ()
    stages: Mapping[str, System] = field(default_factory=dict)
    systems: dict[str, System] = field(default_factory=dict)
    _behind: dict[str, OutputPort] = field(default_factory=dict)
    _places: set[str] = field(default_factory=set)

    def add(self, name: str, system: Any, **inputs: OutputPort) -> Any:
        """Add a stage and connect its inputs by name; the user's own system where there is one for this stage.

        Args:
            name: Of the stage.
            system: The system, or a function that makes it and is not called where the user has a system.
            inputs: Input port to its source. The user's own system need not have all of these ports; it may have
                others that are called as a recorded signal.

        Returns:
            The system that was added.

        Raises:
            ParamsError: the user's own is no system.
        """
        own = self.stages.get(name)
        if own is None:
            added = system() if callable(system) else system
        elif not isinstance(own, System):
            raise ParamsError(f"stages: {name!r}: expected a Drake system, got {type(own).__name__}")
        else:
            added, known = own, {**self.signals, **inputs}
            names = [own.get_input_port(i).get_name() for i in range(own.num_input_ports())]
            inputs = {port: known[port] for port in names if port in known}
        self.builder.AddNamedSystem(name, added)
        self.systems[name] = added
        for port, source in inputs.items():
            self.builder.Connect(source, added.GetInputPort(port))
        return added

    def connect(self, stage: str, port: str, source: OutputPort) -> None:
        """Connect an input port of a stage; the user's own system need not have it."""
        system = self.systems[stage]
        if stage not in self.stages or system.HasInputPort(port):
            self.builder.Connect(source, system.GetInputPort(port))

    def output(self, stage: str, port: str) -> OutputPort:
        """An output port of a stage, behind the user's own system where there is one for "stage.port".

        Raises:
            ParamsError: the user's own system of this stage has no such port; otherwise as `passed`.
        """
        system = self.systems[stage]
        if not system.HasOutputPort(port):
            there = [system.get_output_port(i).get_name() for i in range(system.num_output_ports())]
            raise ParamsError(
                f"stages: {stage!r}: expected a system with an output port {port!r}; its ports: {', '.join(there)}"
            )
        return self.passed(f"{stage}.{port}", system.GetOutputPort(port))

    def passed(self, place: str, port: OutputPort) -> OutputPort:
        """The port, or that of the user's own system behind it.

        Args:
            place: "stage.port".
            port: What the stage has there.

        Raises:
            ParamsError: a system whose first ports are not of the port's size.
        """
        self._places.add(place)
        own = self.stages.get(place)
        if own is None:
            return port
        if place not in self._behind:
            if not (isinstance(own, System) and own.num_input_ports() and own.num_output_ports()):
                raise ParamsError(
                    f"stages: {place!r}: expected a system with an input and an output port, got {type(own).__name__}"
                )
            sizes = [p.size() for p in (own.get_input_port(0), own.get_output_port(0))]
            if sizes != [port.size()] * 2:
                raise ParamsError(
                    f"stages: {place!r}: expected a system whose input and output have size {port.size()},"
                    f" got sizes {sizes[0]} and {sizes[1]}"
                )
            self.builder.AddNamedSystem(own.get_name() or place.replace(".", "_"), own)
            self.builder.Connect(port, own.get_input_port(0))
            self._behind[place] = own.get_output_port(0)
        return self._behind[place]

    def check_own_systems(self) -> None:
        """Every system of the user's own has found its place.

        Raises:
            ParamsError: a stage or a port that this loop does not have.
        """
        for name in self.stages:
            if name not in self.systems and name not in self._behind:
                raise ParamsError(
                    f"stages: no stage or port {name!r} in this loop; stages: {', '.join(self.systems)}; ports:"
                    f" {', '.join(sorted(self._places))}"
                )

    def join(self, name: str, ports: Sequence[OutputPort]) -> OutputPort:
        """One port with the values of several, one below the other."""
        return behind(self.builder, name, Multiplexer([port.size() for port in ports]), *ports)

    def filtered_readings(
        self, sensors: Readings, window: int, orders: tuple[int, int], *, imu: bool = True
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
        readings = {"joint_estimate": sensors.encoder}
        if sensors.imu is not None and imu:
            readings["imu_estimate"] = first_imu(self.builder, sensors.imu)
        if sensors.force_torque is not None:
            readings["wrench_estimate"] = sensors.force_torque
        if "filter" in self.stages:
            raw = {FILTERED[name]: port for name, port in readings.items()}
            self.add("filter", None, **raw)
            return {name: self.output("filter", name) for name in readings}
        sizes = [port.size() for port in readings.values()]
        n, total = sizes[0], sum(sizes)
        smooth = SavitzkyGolayFilter(total, window, [orders[0]] * n + [orders[1]] * (total - n), self.period)
        self.add("filter", smooth, signal=self.join("readings", list(readings.values())))
        first = dict(zip(readings, np.cumsum([0, *sizes[:-1]]).tolist(), strict=True))
        places = {
            name: [d * total + first[name] + i for d in range(DERIVATIVES[name]) for i in range(size)]
            for name, size in zip(readings, sizes, strict=True)
        }
        ports = picked(self.builder, "estimates", smooth.GetOutputPort("estimate"), places)
        return {name: self.passed(f"filter.{name}", port) for name, port in ports.items()}
