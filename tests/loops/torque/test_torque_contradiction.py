"""Why no flag compares the estimated torque with the actuator model's: a sound leg contradicts itself more."""

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import EventStatus

from drake_tc.loops.torque.running import build_loop
from drake_tc.loops.torque.stages import actuator_models, loop_robot
from drake_tc.registry import diagram_entry

from .fault_cases import LATE, FaultCase

TIME_CONSTANT = 0.01
"""Of the low pass behind the difference [s], as MonitorSpec.time_constant."""


def contradiction(scenario):
    """(n,) largest filtered |tau_hat - F tau| [N m] once the tare is over; tau is the model's, of what was sent."""
    loop = build_loop(scenario)
    models = actuator_models(scenario, loop_robot(scenario), controller=True)
    gains = np.array([model.drive.gain for model in models.values()])
    diagram = loop.diagram
    control, guard, estimates = (
        diagram.GetSubsystemByName(name) for name in ("torque_control", "guard", "torque_estimator")
    )
    rows = []

    def look(root):
        def value(system, port):
            return system.GetOutputPort(port).Eval(system.GetMyContextFromRoot(root)).copy()

        sent = value(guard, "command") - value(control, "command")
        rows.append((value(control, "commanded_torque") + sent / gains, value(estimates, "estimated_torque")))
        return EventStatus.Succeeded()

    simulator = Simulator(diagram)
    loop.start(simulator.get_mutable_context())
    simulator.set_monitor(look)
    for time in np.arange(scenario.dt, scenario.duration, scenario.dt):
        simulator.AdvanceTo(time)
    model, estimate = (np.array(column) for column in zip(*rows, strict=True))
    window, order = scenario.filters.window, scenario.filters.encoder_order
    at = np.arange(window) - (window - 1) / 2
    weights = np.linalg.pinv(np.vander(at, order + 1, increasing=True))[0]
    difference = estimate[window - 1 :] - sliding_window_view(model, window, axis=0) @ weights
    first = round((scenario.tare + 0.1) / scenario.dt)
    low, largest = np.zeros(model.shape[1]), np.zeros(model.shape[1])
    for tick, row in enumerate(difference):
        low = low - np.expm1(-scenario.dt / TIME_CONSTANT) * (row - low)
        if tick + window - 1 > first:
            largest = np.maximum(largest, np.abs(low))
    return largest


@pytest.mark.slow
def test_a_sound_swing_contradicts_itself_more_than_a_late_force_sensor_does():
    swing = diagram_entry("hrp2_leg").scenario("brisk_swing")
    contact = diagram_entry("hrp2_leg_contact").scenario("brisk_force_sine")
    late = contact.changed(faults={"force_torque": (FaultCase("force_torque", LATE, 0.02).fault(0.8),)})
    sound, faulty, calm = (contradiction(scenario) for scenario in (swing, late, contact))
    assert sound.max() == pytest.approx(134.0, rel=0.1)
    assert faulty.max() == pytest.approx(64.0, rel=0.2)
    assert calm.max() < 20.0
    assert sound.max() > 1.5 * faulty.max()
