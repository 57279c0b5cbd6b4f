"""The whole-body loop in one system computes what its stages compute as systems of their own, to the last bit."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Gain
from sweeps import slow_but

import drake_tc.diagrams
from drake_tc.loops.fused import FusedStages, StageValues, fuse, fused_stages
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.whole_body.drives import drive_models
from drake_tc.loops.whole_body.ground import add_ground
from drake_tc.loops.whole_body.running import build_tsid
from drake_tc.loops.whole_body.scenario import BaseEstimationSpec, TorqueErrorSpec, TsidScenario
from drake_tc.loops.whole_body.wiring import WholeBodyLoop, add_whole_body_loop
from drake_tc.tsid.configuration import load_law
from drake_tc.types import FloatArray

from .recorded_runs import advanced, assert_same, recorded

DIAGRAMS = Path(next(iter(drake_tc.diagrams.__path__)))
COMAN, HUMANOID = DIAGRAMS / "coman.scenario.yaml", DIAGRAMS / "humanoid_tsid.scenario.yaml"
LOST = "[{kind: dropped, start: 0.02, channels: [3]}]"
CASES = {
    "turning trunk": (COMAN, "turn_half_hz", "{}", 0.13),
    "IMU without readings while the trunk turns": (
        COMAN,
        "turn_1hz",
        "{faults: {imu: [{kind: dropped, start: 0.12, duration: 0.08}]}}",
        0.24,
    ),
    "frozen encoders, late gauges, lost wrenches": (
        COMAN,
        "stand",
        """{faults: {
            encoder: [{kind: frozen, start: 0.11, duration: 0.03}],
            gauge: [{kind: late, start: 0.11, duration: 0.04, value: 0.01}],
            force_torque: [{kind: dropped, start: 0.12, duration: 0.03}]}}""",
        0.2,
    ),
    "a joint without two of its sensors": (
        COMAN,
        "stand",
        f"{{faults: {{motor_encoder: {LOST}, gauge: {LOST}}}}}",
        0.3,
    ),
    "motors held by their own encoders": (COMAN, "pushed_held", "{}", 0.06),
    "damped joints, and a contact that is lifted": (
        COMAN,
        "turn_1hz_damped",
        "{lifted: {right_sole: [{begin: 0.05, end: 0.06}]}}",
        0.1,
    ),
    "two estimators": (COMAN, "stand_foot_centre", "{estimator: {beside: cop}}", 0.06),
    "no delay between control and voltage": (COMAN, "stand", "{series_elastic: {delay: 0.0}}", 0.06),
    "smaller steps of the plant": (COMAN, "stand", "{plant_step: 5.0e-4}", 0.06),
    "one stage alone": (HUMANOID, "com_move", "{}", 0.06),
    "one stage alone and smaller steps of the plant": (HUMANOID, "balance", "{plant_step: 5.0e-4}", 0.03),
    "one stage alone and a contact that is lifted": (
        HUMANOID,
        "one_foot",
        "{lifted: {right_sole: [{begin: 0.02, end: 0.04}]}}",
        0.06,
    ),
    "geared drives": (HUMANOID, "whole_chain", "{}", 0.1),
    "geared drives and a contact that is lifted": (
        HUMANOID,
        "whole_chain_one_foot",
        "{lifted: {right_sole: [{begin: 0.05, end: 0.08}]}}",
        0.1,
    ),
}


FAST = (
    "frozen encoders, late gauges, lost wrenches",
    "one stage alone and a contact that is lifted",
    "geared drives and a contact that is lifted",
)


@pytest.mark.parametrize("case", slow_but(CASES, *FAST))
def test_it_computes_the_same_numbers(case):
    path, name, text, duration = CASES[case]
    assert_fused_is_apart(TsidScenario.load(path, name, text), duration)


@pytest.mark.slow
def test_springs_with_a_state_from_contacts_and_torques_that_err():
    own = {"estimator": BaseEstimationSpec(), "torque_error": TorqueErrorSpec(hold=5e-3)}
    assert_fused_is_apart(TsidScenario.load(COMAN, "stand").changed(state="estimated", **own), 0.06)


def assert_fused_is_apart(scenario: TsidScenario, duration: float) -> None:
    loops = [build_tsid(scenario, fused=fused) for fused in (True, False)]
    assert fused_stages(loops[0].diagram) is not None
    assert fused_stages(loops[1].diagram) is None
    assert not loops[0].diagram.HasSubsystemNamed("tsid")
    fused, apart = (recorded(loop.log, advanced(loop, duration).get_context()) for loop in loops)
    assert np.ptp(apart["torque"], axis=0).min() > 0.0
    assert_same(fused, apart)


def test_a_start_between_ticks_and_contexts_in_turn():
    """Initialized twice at 12.3 ms; from 43 ms on, without readings of the IMU, a clone runs beside the original."""
    dropped = "{faults: {imu: [{kind: dropped, start: 0.03}]}}"
    found = []
    for fused in (True, False):
        loop = build_tsid(TsidScenario.load(COMAN, "turn_half_hz", dropped), fused=fused)
        simulator = Simulator(loop.diagram)
        context = simulator.get_mutable_context()
        context.SetTime(0.0123)
        loop.start(context)
        simulator.Initialize()
        simulator.Initialize()
        simulator.AdvanceTo(0.043)
        clone = Simulator(loop.diagram, context.Clone())
        for end in (0.044, 0.047, 0.052):
            simulator.AdvanceTo(end)
            clone.AdvanceTo(end + 0.002)
        found.append([recorded(loop.log, each.get_context()) for each in (simulator, clone)])
    for fused, apart in zip(*found, strict=True):
        assert apart["time"].size > 30
        assert_same(fused, apart)


def wired(**own: Any) -> tuple[DiagramBuilder, WholeBodyLoop]:
    """A loop with series-elastic drives and base estimator, before it is built."""
    spec = TsidScenario.load(COMAN, "stand")
    law = load_law(spec.path(spec.controller), spec.changes)
    robot, builder = law.model.robot, DiagramBuilder()
    plant = add_robot_plant(
        builder, robot, scene=True, prepare=lambda plant: add_ground(plant, law.model.contacts, spec.ground)
    )
    return builder, add_whole_body_loop(builder, plant, law, spec, models=drive_models(spec, robot), **own)


def run(builder: DiagramBuilder, loop: WholeBodyLoop, stages: FusedStages | None, log: Any) -> dict[str, FloatArray]:
    simulator = Simulator(builder.Build())
    loop.start(simulator.get_mutable_context(), stages)
    simulator.Initialize()
    simulator.AdvanceTo(0.05)
    return recorded(log, simulator.get_context())


def test_a_system_of_the_users_own_stays_between_the_stages():
    logs = []
    for fused in (True, False):
        gain = Gain(0.95, 23)
        builder, loop = wired(stages={"tsid.torque": gain})
        log = loop.add_log(builder, "torque", "voltage", "applied_torque", "estimated_state")
        stages = fuse(builder) if fused else None
        assert gain in builder.GetSystems()
        logs.append(run(builder, loop, stages, log))
    assert np.ptp(logs[0]["voltage"], axis=0).min() > 0.0
    assert_same(*logs)


def test_values_of_stages_are_those_of_systems_of_their_own():
    found = []
    for fused in (True, False):
        builder, loop = wired()
        loop.add_log(builder)
        stages = fuse(builder) if fused else None
        diagram = builder.Build()
        values = StageValues(diagram.CreateDefaultContext(), stages)
        estimator, actuators = loop.systems["base_estimator"], loop.systems["actuators"]
        after = values.next_state(estimator)
        values.set_state(estimator, after)
        moved = values.next_state(estimator)
        port = actuators.GetOutputPort("transmitted_torque")
        found.append([after, moved, values.input(actuators, "state"), values.output(port)])
    assert not np.array_equal(found[0][0], found[0][1])
    for one, other in zip(*found, strict=True):
        assert np.array_equal(one, other, equal_nan=True)
