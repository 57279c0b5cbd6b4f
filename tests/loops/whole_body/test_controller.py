"""The whole-body controller without a plant commands what the simulated loop has commanded, to the last bit."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from sweeps import slow_but

import drake_tc.diagrams
from drake_tc.errors import ParamsError
from drake_tc.hardware.stepper import ControllerStepper
from drake_tc.loops.recording import add_log
from drake_tc.loops.whole_body.drives import drive_models
from drake_tc.loops.whole_body.references import contact_source, task_source
from drake_tc.loops.whole_body.running import add_grounded_plant, build_tsid, run_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.loops.whole_body.wiring import add_whole_body_loop, scenario_controller, whole_body_controller
from drake_tc.tsid.configuration import load_law

DIAGRAMS = Path(next(iter(drake_tc.diagrams.__path__)))
COMAN, HUMANOID = DIAGRAMS / "coman.scenario.yaml", DIAGRAMS / "humanoid_tsid.scenario.yaml"
LIFT = "{lifted: {right_sole: [{begin: 0.03, end: 0.05}]}}"
CASES = {
    "state and torques": (HUMANOID, "com_move", "{}"),
    "a contact that is lifted": (HUMANOID, "one_foot", LIFT),
    "geared drives": (HUMANOID, "whole_chain", "{}"),
    "series springs, base estimator, sensor validation": (COMAN, "turn_1hz", "{}"),
    "damped joints and a contact that is lifted": (COMAN, "turn_1hz_damped", LIFT),
}


def simulated(scenario, law, duration=0.08):
    """What the simulated controller read before its springs were wound, and then at each tick; what it commanded."""
    builder, robot = DiagramBuilder(), law.model.robot
    plant = add_grounded_plant(builder, scenario, law)
    contacts = None
    if scenario.lifted:
        switch = contact_source(law.model.contacts, scenario.lifted, scenario.duration, law.period)
        contacts = builder.AddNamedSystem("contacts", switch).get_output_port()
    references = {name: task_source(law, name, spec) for name, spec in scenario.motion.items()}
    models = drive_models(scenario, robot)
    loop = add_whole_body_loop(builder, plant, law, scenario, models=models, references=references, contacts=contacts)
    read = {"state": loop.signals["state"]} if scenario.state == "plant" else {}
    if loop.sensors is not None:
        readings = vars(loop.sensors.readings) | {"joint_torque": None}
        read |= {{"encoder": "position"}.get(k, k): port for k, port in readings.items() if port is not None}
    if scenario.torque == "series_elastic":
        for name, system in (("motor_position", "motor_encoder"), ("spring_torque", "torque_gauge")):
            read[name] = loop.systems[system].GetOutputPort("reading")
    if contacts is not None:
        read["active_contacts"] = contacts
    command = {"direct": "torque", "drives": "command", "series_elastic": "voltage"}[scenario.torque]
    log = add_log(builder, {**read, "command": loop.signals[command]}, law.period)
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    unwound = {name: port.Eval(port.get_system().GetMyContextFromRoot(context)) for name, port in read.items()}
    loop.start(context)
    simulator.AdvanceTo(duration)
    return unwound, log.recorded(context)[1]


@pytest.mark.parametrize(
    ("case", "fused"),
    slow_but(
        product(CASES, (False, True)),
        ("a contact that is lifted", False),
        ("geared drives", True),
        ("series springs, base estimator, sensor validation", True),
    ),
)
def test_commands_are_those_of_the_simulated_loop(case, fused):
    scenario = TsidScenario.load(*CASES[case])
    law = load_law(scenario.path(scenario.controller), scenario.changes)
    unwound, signals = simulated(scenario, law)
    commanded = signals.pop("command")
    controller = whole_body_controller(
        law,
        drive_models(scenario, law.model.robot),
        {name: task_source(law, name, spec) for name, spec in scenario.motion.items()},
        scenario,
        contacts="input" if scenario.lifted else None,
        fused=fused,
    )
    stepper = ControllerStepper(controller, law.period)
    assert set(stepper.inputs) == set(signals)
    stepper.start(unwound)
    ticks = range(len(commanded))
    found = np.array([stepper.tick({name: signals[name][k] for name in signals})["command"] for k in ticks])
    assert np.ptp(found, axis=0).max() > 1e-4
    assert_array_equal(found, commanded)


def test_the_controller_of_a_scenario_commands_what_its_loop_has_commanded():
    scenario = TsidScenario.load(HUMANOID, "one_foot", "{duration: 0.1, lifted: {right_sole: [{begin: 0.05}]}}")
    run = run_tsid(build_tsid(scenario, fused=True))
    stepper = ControllerStepper(scenario_controller(scenario), run.law.period)
    assert set(stepper.inputs) == {"state"}
    found = [stepper.tick({"state": state})["command"] for state in run["state"]]
    assert_array_equal(found, run["torque"])


def test_motors_are_held_where_their_encoders_are_at_the_start():
    """V = gain K (theta_0 + tau_0/K - theta), limited: theta_0, here a reading, and tau_0 are constants that differ."""
    scenario = TsidScenario.load(COMAN, "pushed_held")
    law = load_law(scenario.path(scenario.controller), scenario.changes)
    models = drive_models(scenario, law.model.robot)
    _, signals = simulated(scenario, law)
    commanded = signals.pop("command")
    stepper = ControllerStepper(whole_body_controller(law, models, spec=scenario), law.period)
    ticks = range(len(commanded))
    found = np.array([stepper.tick({name: signals[name][k] for name in signals})["command"] for k in ticks])
    away = found - commanded
    largest = np.abs(np.vstack((found, commanded))).max(axis=0)
    free = largest < 0.99 * largest.max()  # of the limit of the supply
    assert free.sum() > 15
    np.testing.assert_allclose(away[:, free], np.broadcast_to(away[0, free], away[:, free].shape), atol=1e-9)


def test_a_reference_comes_in_through_a_port_and_a_task_that_is_not_there_is_refused():
    scenario = TsidScenario.load(HUMANOID, "balance")
    law = load_law(scenario.path(scenario.controller), scenario.changes)
    controller = whole_body_controller(law, motion={"com": "input"})
    assert controller.GetInputPort("com_reference").size() == 9
    with pytest.raises(ParamsError, match="motion: no task 'head' in this law; tasks: "):
        whole_body_controller(law, motion={"head": "input"})
