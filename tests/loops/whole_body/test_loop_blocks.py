"""Blocks of Drake's own that spare calls into Python say what the stages' own ports say."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pydrake.systems.analysis import Simulator

import drake_tc.diagrams
from drake_tc.loops.whole_body.loop import build_tsid
from drake_tc.registry import tsid_entry

SCENARIOS = Path(next(iter(drake_tc.diagrams.__path__))) / "coman.scenario.yaml"
SAME = [
    *((f"tsid_outputs:{port}", f"tsid:{port}") for port in ("torque", "acceleration", "contact_force", "status")),
    *((f"joint_readings:{port}", f"joint_sensors:{port}") for port in ("motor_angle", "torque", "position")),
    ("joint_readings:link_angle", "joint_sensors:link_angle"),
    ("filtered:first_derivative", "velocity_filter:first_derivative"),
    ("base_outputs:cop", "base_estimator:cop"),
    ("base_outputs:status", "base_estimator:status"),
]


@pytest.fixture(scope="module")
def run():
    """A robot on series-elastic joints and soft soles that has stood for some ticks, and its context."""
    loop = build_tsid(tsid_entry().scenario("stand", SCENARIOS))
    simulator = Simulator(loop.diagram)
    loop.start(simulator.get_mutable_context())
    simulator.AdvanceTo(0.02)
    return loop, simulator


@pytest.mark.parametrize(("block", "stage"), SAME)
def test_a_block_says_what_the_stage_says(run, block, stage):
    loop, simulator = run
    values = []
    for owner, port in (name.split(":") for name in (block, stage)):
        system = loop.diagram.GetSubsystemByName(owner)
        values.append(np.array(system.GetOutputPort(port).Eval(system.GetMyContextFromRoot(simulator.get_context()))))
    assert_array_equal(*values)
    assert np.any(values[1]) or "status" in stage


def test_no_stage_is_asked_for_a_part_of_a_port_that_holds_all_parts(run):
    loop, _ = run
    sources = loop.diagram.connection_map().values()
    read = {f"{system.get_name()}:{system.get_output_port(port).get_name()}" for system, port in sources}
    assert read.isdisjoint({stage for _, stage in SAME} - {"joint_sensors:link_angle"})  # its encoder's stand-in
