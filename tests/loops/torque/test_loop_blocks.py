"""Blocks of Drake's own that spare calls into Python say what the stages' own ports say."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydrake.systems.analysis import Simulator

import drake_tc.diagrams
from drake_tc.loops.torque.running import build_loop
from drake_tc.loops.torque.scenario import Scenario

SCENARIOS = Path(next(iter(drake_tc.diagrams.__path__))) / "hrp2_leg.scenario.yaml"
SAME = [
    ("zeroed_wrench:sum", "wrench_tare:wrench"),
    ("torque_estimates:estimated_torque", "torque_estimator:estimated_torque"),
    ("torque_estimates:contact_wrench", "torque_estimator:contact_wrench"),
    ("torque_estimates:fault", "torque_estimator:fault"),
    ("guard_state:mode", "guard:mode"),
    ("actuation:actuation", "actuators:actuation"),
]


@pytest.fixture(scope="module")
def run():
    """A loop that has zeroed its sensors for a while, and its context."""
    loop = build_loop(Scenario.load(SCENARIOS, "brisk_swing"))
    simulator = Simulator(loop.diagram)
    loop.start(simulator.get_mutable_context())
    simulator.AdvanceTo(0.4)
    return loop, simulator


def value(run, name):
    loop, simulator = run
    owner, port = name.split(":")
    system = loop.diagram.GetSubsystemByName(owner)
    return np.array(system.GetOutputPort(port).Eval(system.GetMyContextFromRoot(simulator.get_context())))


@pytest.mark.parametrize(("block", "stage"), SAME)
def test_a_block_says_what_the_stage_says(run, block, stage):
    assert_allclose(value(run, block), value(run, stage), rtol=1e-13, atol=1e-13)


def test_the_bias_is_not_zero(run):
    assert np.abs(value(run, "wrench_correction:y0")).max() > 0.1  # else the first case above could not fail


def test_the_log_holds_every_signal_in_its_own_rows(run):
    loop, simulator = run
    times, signals = loop.log.recorded(simulator.get_context())
    assert_allclose(times, np.arange(401) * 1e-3, atol=1e-12)
    for signal, port in (("encoder", "encoder:reading"), ("joint_state", "plant:state"), ("mode", "guard:mode")):
        assert_array_equal(signals[signal][-1], value(run, port), err_msg=signal)
    assert sum(part.shape[1] for part in signals.values()) == loop.log.sink.get_input_port().size()


def test_without_a_force_to_reach_no_wrench_goes_to_the_inverse_dynamics(run):
    loop, _ = run
    dynamics = loop.diagram.GetSubsystemByName("inverse_dynamics")
    assert not dynamics.HasInputPort("contact_wrench")
    shown = build_loop(Scenario.load(SCENARIOS, "brisk_swing", "{log_components: true}")).diagram
    assert shown.GetSubsystemByName("inverse_dynamics").HasInputPort("contact_wrench")
