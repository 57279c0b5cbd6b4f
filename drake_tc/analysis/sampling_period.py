"""One control period of a Diagram as a function of state and inputs, and its derivatives by central differences."""

from typing import Any

import numpy as np
from pydrake.systems.analysis import InitializeParams, Simulator
from pydrake.systems.framework import Context, Diagram

from drake_tc.analysis.ports import Cut
from drake_tc.analysis.state_coordinates import StateCoordinates
from drake_tc.errors import SimulationError
from drake_tc.types import BoolArray, FloatArray

KINK = 1e-2
"""Forward and backward differences that disagree by this share of the larger are a kink."""
FINE = 20
"""Integration steps a period, where there are continuous states."""
ROUNDING = 1e-13
"""Of F, as a share of its value."""


class SamplingPeriod:
    """F and the outputs, as one function of state and inputs."""

    def __init__(
        self, diagram: Diagram, context: Context, dt: float, tick: int, cuts: list[Cut], ports: list[Any]
    ) -> None:
        self._diagram, self._cuts, self._ports = diagram, cuts, ports
        self._start, self._end = tick * dt, (tick + 1) * dt
        self.base: Any = context.Clone()
        self.base.SetTime(self._start)
        self.coordinates = StateCoordinates(diagram, self.base)
        self._simulator = Simulator(diagram, context.Clone())
        if self.base.num_continuous_states():  # steps that adapt are not a smooth function of the state
            integrator = self._simulator.get_mutable_integrator()
            integrator.set_fixed_step_mode(True)
            integrator.set_maximum_step_size(dt / FINE)
        self._quiet = InitializeParams(suppress_initialization_events=True)
        self._last = self.coordinates.read(self.base)

    def after(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """[x[k+1]; y[k]]."""
        context = self._simulator.get_mutable_context()
        context.SetTimeStateAndParametersFrom(self.base)
        for block in self.coordinates.blocks:
            part = slice(block.first, block.first + block.size)
            if not np.array_equal(x[part], self._last[part]):
                block.write(context, x[part])
        at = 0
        for cut in self._cuts:
            cut.fix(context, u[at : at + cut.value.size])
            at += cut.value.size
        try:
            y = [np.array(port.Eval(port.get_system().GetMyContextFromRoot(context))) for port in self._ports]
            self._simulator.Initialize(self._quiet)
            self._simulator.AdvanceTo(self._end)
        except (RuntimeError, SystemExit) as error:
            raise SimulationError(f"linearise: the period from {self._start:g} s failed: {error}") from error
        return np.concatenate([self.coordinates.read(context), *y])


def differences(period: SamplingPeriod, x: FloatArray, u: FloatArray, step: float) -> tuple[FloatArray, BoolArray]:
    """Derivatives of [x[k+1]; y[k]] by [x; u], and by which of these the map has a kink."""
    at, middle = np.concatenate((x, u)), period.after(x, u)
    table, rough = np.empty((middle.size, at.size)), np.zeros(at.size, dtype=np.bool_)
    for j in range(at.size):
        width = step * max(1.0, abs(at[j]))
        sides = []
        for way in (width, -width):
            moved = at.copy()
            moved[j] += way
            sides.append((period.after(moved[: x.size], moved[x.size :]) - middle) / way)
        table[:, j] = 0.5 * (sides[0] + sides[1])
        largest = np.maximum(np.abs(sides[0]), np.abs(sides[1]))
        rounding = ROUNDING * np.maximum(1.0, np.abs(middle)) / width
        rough[j] = np.any(np.abs(sides[0] - sides[1]) > KINK * largest + rounding)
    return table, rough
