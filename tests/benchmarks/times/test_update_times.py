"""How long one update of the systems in a control loop takes; printed as rows (run with -s)."""

import time

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem, ValueProducer

from drake_tc.actuation.compensator import Compensator, Motion
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter

from .machine import require

pytestmark = pytest.mark.benchmark
TICK = 1e-3
EFFECTS = (
    EffectValue("rotor_inertia", {"rotor_inertia": 0.3}),
    EffectValue("viscous", {"viscous": 6.0}),
    EffectValue("coulomb", {"coulomb": 3.0}),
    EffectValue("stribeck", {"stribeck": 1.0, "stribeck_velocity": 0.1, "stribeck_exponent": 2.0}),
    EffectValue("load_dependent_friction", {"load_friction": 0.1}),
    EffectValue("delay.command", {"delay": 0.01}),
)
SERVO = (
    *EFFECTS[:3],
    EffectValue("deadzone", {"deadzone": 3e-4}),
    EffectValue("velocity_sign_switch", {"switch": 0.1}),
)


def updates(system, count: int = 500) -> list[float]:
    """Seconds of each discrete update, the inputs changed before every one."""
    context = system.CreateDefaultContext()
    ports = [p for i in range(system.num_input_ports()) if (p := system.get_input_port(i)).get_name() != "load_torque"]
    seconds = []
    for k in range(count):
        for port in ports:
            port.FixValue(context, 0.01 * np.sin(0.01 * k + np.arange(port.size())))
        context.SetTime(k * TICK)
        start = time.perf_counter()
        values = system.EvalUniquePeriodicDiscreteUpdate(context)
        context.SetDiscreteState(values)
        seconds.append(time.perf_counter() - start)
    return seconds


@pytest.mark.parametrize("window", [20, 80])
def test_savitzky_golay_update(window):
    system = SavitzkyGolayFilter(size=30, window=window, order=2, dt=TICK)
    row = f"SavitzkyGolayFilter, 30 signals, window {window}"
    require({row: 15e-6}, lambda: {row: updates(system)})


def plant(count: int, effects: tuple[EffectValue, ...]) -> ActuatorPlant:
    models = [ActuatorModel(f"joint{k}", Drive("position_servo", 2e-4), effects) for k in range(count)]
    return ActuatorPlant(models, TICK)


class BarePorts(LeafSystem):
    """The ports, state and cache entry of an ActuatorPlant of n joints, read and written, with nothing in between."""

    def __init__(self, size: int) -> None:
        super().__init__()
        names = ("command", "state", "temperature", "load_torque")
        self.inputs = [self.DeclareVectorInputPort(n, size * (1 + (n == "state"))) for n in names]
        self.memory = self.DeclareDiscreteState(np.zeros(7 * size + 1))
        self.solution = self.DeclareCacheEntry(
            "solution", ValueProducer(allocate=Value(()).Clone, calc=self.solve), {self.all_sources_ticket()}
        )
        self.DeclarePeriodicDiscreteUpdateEvent(TICK, 0.0, self.update)

    def solve(self, context, solution):
        read = [port.Eval(context).tolist() for port in self.inputs if port.HasValue(context)]
        solution.set_value((context.get_discrete_state_vector().value().tolist(), read, context.get_time()))

    def update(self, context, values):
        values.get_mutable_value(self.memory)[:] = self.solution.Eval(context)[0]


def test_an_actuator_plant_update_is_no_slower_than_its_bounds():
    """Ports, state and cache alone are pydrake's own share."""
    bare, six, servo, many = BarePorts(6), plant(6, EFFECTS), plant(6, SERVO), plant(30, SERVO)
    goals = {
        "ports, state and cache of 6 joints alone": np.inf,
        "ActuatorPlant, 6 joints of 6 effects": 25e-6,
        "ActuatorPlant, 6 joints of 5 effects": 25e-6,
        "ActuatorPlant, 30 joints of 5 effects": 35e-6,
    }
    require(goals, lambda: dict(zip(goals, map(updates, (bare, six, servo, many)), strict=True)))


def test_compensator():
    models = [ActuatorModel(f"joint{k}", Drive("position_servo", 2e-4), SERVO) for k in range(6)]
    law = Compensator(models, direction_speed=0.05)
    tau, velocity = 9.0 * np.cos(np.arange(6)), np.sin(np.arange(6))
    motion = Motion(velocity, direction=law.direction(velocity))
    row = "Compensator, 6 joints of 5 effects"

    def efforts():
        seconds = []
        for _ in range(500):
            start = time.perf_counter()
            law.effort(tau, motion)
            seconds.append(time.perf_counter() - start)
        return {row: seconds}

    require({row: 6e-6}, efforts)
