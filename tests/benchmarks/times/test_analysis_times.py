"""How long a point of a stability map and the margins of a whole loop take; printed as rows (run with -s)."""

import time
from dataclasses import replace

import pytest

from drake_tc.analysis.release import settled_at
from drake_tc.analysis.sampled import loop_margins, open_loop
from drake_tc.control.joint_loop import JointLoop
from drake_tc.registry import runnable

from .machine import require

pytestmark = pytest.mark.benchmark
LOOP = JointLoop.with_equivalent_gains(
    1.0, 0.01, 2.0, inertia=0.363, link_inertia=0.063, k_tau=2.12e-4, k_v=0.013, k_tau_model=2.12e-4, k_v_model=0.013
)


def test_a_point_of_a_map_is_quick():
    """At most 5 ms at N = 80, in this process's own time."""

    def points():
        seconds = []
        for i in range(12):
            loop = replace(LOOP, kp=2.0 + 0.01 * i)
            begin = time.process_time()
            loop.spectral_radius()
            seconds.append(time.process_time() - begin)
        return {"point of a map": seconds}

    require({"point of a map": 5e-3}, points)


def test_the_margins_of_all_channels_of_the_leg_are_quick(tmp_path):
    """At most 2 s for the six joints, each with the others closed, in this process's own time."""
    entry = runnable("hrp2_leg")
    loop, context = settled_at(entry, entry.sliding(entry.scenario(), tmp_path), 1.0)
    cut = open_loop(loop.diagram, context, loop.period, "torque_control:command")
    row = f"margins of six channels, {len(cut.states)} states"

    def margins():
        begin = time.process_time()
        found = loop_margins(cut)
        seconds = time.process_time() - begin
        assert len(found) == 6 and all(each.gain_margin > 0.0 for each in found.values())
        return {row: seconds}

    require({row: 2.0}, margins, rounds=4)
