"""`ControllerStepper`: a controller's Diagram, one tick at a time, without a simulated robot.

`LatestReadings`: the newest readings of a robot, and what stands in for them where nothing new has come in.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram

from drake_tc.errors import ParamsError
from drake_tc.hardware.link import Message
from drake_tc.loops.built_loop import Controller
from drake_tc.types import FloatArray


class ControllerStepper:
    """Steps a Diagram from readings to commands; the k-th tick is at the time k dt of the Diagram.

        y[k] = g(x[k], u[k], k dt),   x[k+1] = f(x[k], u[k], k dt)

    with u the input ports and y the output ports. Inputs keep their value until they are given another one; before they
    are given one they are NaN, which the stages take for a reading that is missing.

    Attributes:
        diagram: The controller.
        period: dt [s].
        inputs: Name of each input port to its size.
        ticks: Number of ticks that were made.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> spec = TorqueLoopSpec(dt=2e-3)
        >>> stepper = ControllerStepper(torque_controller(robot, load_models(robot.actuators), spec=spec), spec.dt)
        >>> stepper.tick({"position": robot.posture})["command"].size
        6
    """

    def __init__(self, diagram: Diagram, period: float, outputs: Sequence[str] = ("command",)) -> None:
        """Make a context. It is started with the readings of the first tick.

        Args:
            diagram: From `torque_controller` or one of its like.
            period: dt [s].
            outputs: Output ports to evaluate at each tick.

        Raises:
            ParamsError: an output port that the Diagram does not have, or a period that is not positive.
        """
        if not (np.isfinite(period) and period > 0.0):
            raise ParamsError(f"period: expected a positive number [s], got {period!r}")
        there = [diagram.get_output_port(i).get_name() for i in range(diagram.num_output_ports())]
        for name in outputs:
            if name not in there:
                raise ParamsError(f"no output port {name!r} in {diagram.get_name()!r}; ports: {', '.join(there)}")
        self.diagram, self.period, self.ticks = diagram, period, 0
        self._started = False
        self._simulator = Simulator(diagram)
        self._context: Any = self._simulator.get_mutable_context()
        self._places: dict[str, Any] = {}
        for index in range(diagram.num_input_ports()):
            port: Any = diagram.get_input_port(index)
            self._places[port.get_name()] = port.FixValue(self._context, np.full(port.size(), np.nan))
        self.inputs = {name: int(diagram.GetInputPort(name).size()) for name in self._places}
        self._outputs: dict[str, Any] = {name: diagram.GetOutputPort(name) for name in outputs}

    def start(self, readings: Mapping[str, FloatArray]) -> None:
        """Put estimators where a robot that has stood for long has them; the first tick does it where nobody did.

        Args:
            readings: Input port to its value, of the size of the port.
        """
        self._give(readings)
        if isinstance(self.diagram, Controller):
            self.diagram.start(self._context)
        self._simulator.Initialize()
        self._started = True

    def tick(self, readings: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Evaluate the outputs of this tick, and advance to the next one.

        Args:
            readings: Input port to its value, of the size of the port.

        Returns:
            Output port to its value.
        """
        found = self.evaluate(readings)
        self.advance()
        return found

    def evaluate(self, readings: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """The outputs y[k] of this tick, as `tick`."""
        if not self._started:
            self.start(readings)
        self._give(readings)
        return {name: np.array(port.Eval(self._context)) for name, port in self._outputs.items()}

    def first_not_finite(self) -> str:
        """Which signal of this tick is the first that is not finite, in the order of the output ports, in words."""
        for index in range(self.diagram.num_output_ports()):
            port: Any = self.diagram.get_output_port(index)
            if port.get_name() != "command" and not np.isfinite(port.Eval(self._context)).all():
                return f"the first such signal is {port.get_name()!r}"
        return "no signal between readings and command is"

    def advance(self) -> None:
        """To the next tick, with the readings that were given last."""
        self.ticks += 1
        self._simulator.AdvanceTo(self.ticks * self.period)

    def _give(self, readings: Mapping[str, FloatArray]) -> None:
        for name, value in readings.items():
            self._places[name].GetMutableData().get_mutable_value().SetFromVector(value)


Arrival = Literal["new", "malformed", "late", "missing"]
"""New readings; some of them missing or of another size; none, the last ones stand in; none for longer than that."""
POSITIONS = ("position", "motor_position")
"""Ports with the positions of the joints; the first that there is counts."""


class LatestReadings:
    """What the controller is told in a tick.

    Where nothing new has come in, the last readings stand in for at most `max_age`, positions going on at their last
    speed, which is the mean of the last two ways between readings. After that, and where a port is not there or not of
    its size, the readings are NaN.

    Attributes:
        values: Port to its value.
        age: Of the last readings [s]; infinite before any.
        position: Name of the port with the joints' positions; None where there is none.
    """

    def __init__(self, sizes: Mapping[str, int], period: float, max_age: float) -> None:
        """Before any readings.

        Args:
            sizes: Port to its size.
            period: Of the ticks [s].
            max_age: How long readings count [s].
        """
        self._nothing = {name: np.full(size, np.nan) for name, size in sizes.items()}
        self._period, self._max_age = period, max_age
        self.position = next((name for name in POSITIONS if name in sizes), None)
        self.values, self.age = dict(self._nothing), np.inf
        self._speed = np.zeros(sizes.get(self.position or "", 0))
        self._way, self._newest, self._ticks = self._speed.copy(), np.full_like(self._speed, np.nan), 0

    @property
    def late(self) -> bool:
        """Whether the last readings stand in."""
        return 0.0 < self.age <= self._max_age

    @property
    def sound(self) -> bool:
        """Whether all are known, and not too old."""
        return self.age <= self._max_age and all(np.isfinite(value).all() for value in self.values.values())

    def update(self, found: Message | None, elapsed: int = 1) -> Arrival:
        """The readings of the next tick.

        Args:
            found: What has come in; None: nothing.
            elapsed: Periods since the tick before, more than one where ticks were left out.
        """
        name = self.position
        if found is not None:
            new, whole = self._checked(found)
            if name is not None:
                known = np.isfinite(new[name]) & np.isfinite(self._newest)
                way = (np.where(known, new[name], 0.0) - np.where(known, self._newest, 0.0)) / (self._ticks + elapsed)
                self._speed, self._way = 0.5 * (way + self._way), way
                self._newest, self._ticks = new[name], 0
            self.age, self.values = 0.0, new
            return "new" if whole else "malformed"
        self.age += elapsed * self._period
        self._ticks += elapsed
        if not self.late:
            self.values = dict(self._nothing)
            return "missing"
        if name is not None:
            self.values = self.values | {name: self.values[name] + elapsed * self._speed}
        return "late"

    def between(self, before: Mapping[str, FloatArray], count: int) -> list[dict[str, FloatArray]]:
        """Readings for `count` ticks between those before and those now, positions on a straight line.

        Args:
            before: The readings of the tick before.
            count: How many of those that passed in between are made up.
        """
        name, now = self.position, self.values
        if name is None:
            return [now] * count
        shares = np.arange(1, count + 1) / (count + 1)
        return [now | {name: (1.0 - share) * before[name] + share * now[name]} for share in shares]

    def _checked(self, found: Message) -> tuple[dict[str, FloatArray], bool]:
        """Copies of the readings by port, NaN where one is not there or not of its size; whether all are there."""
        readings, whole = {}, True
        for name, nothing in self._nothing.items():
            try:
                value = np.array(found[name], dtype=np.float64)
                fits = value.shape == nothing.shape
            except Exception:  # whatever a driver of the user's own has returned
                value, fits = nothing, False
            readings[name] = value if fits else nothing
            whole = whole and fits
        return readings, whole
