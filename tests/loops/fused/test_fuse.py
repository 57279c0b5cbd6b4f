"""Stages in one system compute what they compute as systems of their own, to the last bit."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Gain
from sweeps import slow_but

from drake_tc.actuation.model_file import load_models
from drake_tc.control.gains import TorqueGains
from drake_tc.control.trajectories import knot_trajectory
from drake_tc.errors import ParamsError
from drake_tc.loops.fused import fuse
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.torque.running import build_loop
from drake_tc.loops.torque.scenario import TorqueLoopSpec
from drake_tc.loops.torque.wiring import add_torque_loop
from drake_tc.registry import diagram_entry
from drake_tc.robot.robot import load_robot
from drake_tc.types import FloatArray

from .recorded_runs import advanced, assert_same, recorded

LEG = Path(__file__).resolve().parents[3] / "models" / "hrp2_like" / "hrp2_like_leg.yaml"
DURATION = 0.13
CASES = {
    "torque control": ("hrp2_leg", "stairs_swing", "{}"),
    "faults of sensors": (
        "hrp2_leg",
        "stairs_swing",
        "{faults: {imu: [{kind: dropped, start: 0.05, duration: 0.03}]}}",
    ),
    "frozen readings": (
        "hrp2_leg",
        "stairs_swing",
        "{faults: {encoder: [{kind: frozen, start: 0.05, duration: 0.03}]}}",
    ),
    "vendor's servo": ("hrp2_leg", "stairs_swing_servo", "{}"),
    "no tare, other integral": (
        "hrp2_leg",
        "stairs_swing",
        "{tare: 0.0, gains: {k6: 1.0, k7: 0.01, kp: 2.0, ki: 3.0}}",
    ),
    "components and truth are logged": ("hrp2_leg", "stairs_swing", "{log_components: true, log_truth: true}"),
    "predictor and observer, which stay systems": ("hrp2_leg", "predicted_swing", "{}"),
    "force control": ("hrp2_leg_contact", "force_sine", "{}"),
    "floating base": ("hrp2_leg", "suspended_swing", "{predictor: null, observer: null}"),
}


@pytest.mark.parametrize("case", slow_but(CASES, "faults of sensors", "force control", "floating base"))
def test_it_computes_the_same_numbers(case):
    name, scenario, text = CASES[case]
    loops = [build_loop(diagram_entry(name).scenario(scenario, text=text), fused=fused) for fused in (True, False)]
    fused, apart = (recorded(loop.log, advanced(loop, DURATION).get_context()) for loop in loops)
    assert loops[0].diagram.HasSubsystemNamed("stages")
    assert not loops[0].diagram.HasSubsystemNamed("guard")
    assert np.ptp(apart["actuation"], axis=0).min() > 0.0
    assert_same(fused, apart)


def test_a_cloned_context_goes_on_as_its_original():
    loop = build_loop(diagram_entry("hrp2_leg").scenario("stairs_swing"), fused=True)
    first = advanced(loop, 0.05)
    context = first.get_context().Clone()
    first.AdvanceTo(DURATION)
    second = Simulator(loop.diagram, context)
    second.Initialize()
    second.AdvanceTo(DURATION)
    logs = [recorded(loop.log, simulator.get_context()) for simulator in (first, second)]
    shared = np.searchsorted(logs[1]["time"], 0.06), np.searchsorted(logs[0]["time"], 0.06)
    assert_same(
        {name: values[shared[0] :] for name, values in logs[1].items()},
        {name: values[shared[1] :] for name, values in logs[0].items()},
    )


def test_contexts_in_turn_do_not_disturb_each_other():
    loop = build_loop(diagram_entry("hrp2_leg").scenario("stairs_swing"), fused=True)
    alone = recorded(loop.log, advanced(loop, DURATION).get_context())
    simulators = [advanced(loop, 0.001), advanced(loop, 0.02)]
    for tick in range(2, round(DURATION * 1e3) + 1):
        simulators[0].AdvanceTo(1e-3 * tick)
        simulators[1].AdvanceTo(max(0.02, 1e-3 * tick))
    for simulator in simulators:
        assert_same(recorded(loop.log, simulator.get_context()), alone)


def wired(**own: Any) -> tuple[DiagramBuilder, Any]:
    """A torque loop of the user's own with a log, before it is built."""
    robot = load_robot(LEG)
    models, builder = load_models(robot.actuators), DiagramBuilder()
    plant = add_robot_plant(builder, robot)
    reference = knot_trajectory([0.0, 0.1, 0.2], np.outer([0.0, 1.0, 0.0], np.full(6, 0.02)) + robot.posture)
    gains = TorqueGains.from_servo(models)
    loop = add_torque_loop(builder, plant, robot, models, reference, TorqueLoopSpec(), gains=gains, **own)
    return builder, loop


def run_logged(builder: DiagramBuilder, log: Any) -> dict[str, FloatArray]:
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.Initialize()
    simulator.AdvanceTo(DURATION)
    return recorded(log, simulator.get_context())


def test_a_system_of_the_users_own_stays_between_the_stages():
    logs = []
    for fused in (True, False):
        gain = Gain(0.9, 6)
        builder, loop = wired(stages={"inverse_dynamics.desired_torque": gain})
        log = loop.add_log(builder, "command", "desired_torque", "actuation")
        if fused:
            system = fuse(builder)
            assert gain in builder.GetSystems()
            assert system.num_output_ports() == 3  # before the gain, behind it, and behind the plant's accelerations
        logs.append(run_logged(builder, log))
    assert_same(*logs)


def test_exported_ports_are_refused():
    builder, loop = wired()
    builder.ExportOutput(loop.signals["command"], "command")
    with pytest.raises(ParamsError, match="export ports after fusing"):
        fuse(builder)


@pytest.mark.parametrize("name", ["torque_control", "inverse_dynamics"])
def test_a_removed_stage_refuses_gains_for_the_context_of_another_system(name):
    builder, loop = wired()
    fuse(builder)
    stage, context = loop.systems[name], builder.Build().CreateDefaultContext()
    gains = TorqueGains.from_servo(load_models(load_robot(LEG).actuators))
    with pytest.raises(RuntimeError, match="instead of the appropriate subsystem Context"):
        stage.set_gains(stage.GetMyMutableContextFromRoot(context), gains)


def test_a_diagram_without_stages_stays_as_it_is():
    builder = DiagramBuilder()
    builder.AddNamedSystem("gain", Gain(2.0, 1))
    assert fuse(builder) is None
    assert [system.get_name() for system in builder.GetSystems()] == ["gain"]
