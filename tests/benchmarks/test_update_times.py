"""How long one update of the systems in a control loop takes; printed as rows (run with -s)."""

import time

import numpy as np
import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter

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


def row(name: str, seconds: list[float]) -> float:
    """Print a row and return the median [s]."""
    median, p99 = np.percentile(seconds, [50, 99])
    print(f"\n{name}: median {1e6 * median:.1f} us, p99 {1e6 * p99:.1f} us, n {len(seconds)}")
    return float(median)


def updates(system, context, count: int = 1500) -> list[float]:
    """Seconds of each discrete update, the inputs changed before every one."""
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
    median = row(f"SavitzkyGolayFilter, 30 signals, window {window}", updates(system, system.CreateDefaultContext()))
    assert median < 0.2 * TICK


def test_actuator_plant_update():
    models = [ActuatorModel(f"joint{k}", Drive("position_servo", 2e-3), EFFECTS) for k in range(6)]
    system = ActuatorPlant(models, TICK)
    median = row("ActuatorPlant, 6 joints of 6 effects", updates(system, system.CreateDefaultContext()))
    assert median < 0.5 * TICK
