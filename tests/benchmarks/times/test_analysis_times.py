"""How long one point of a stability map takes; printed as a row (run with -s)."""

import time
from dataclasses import replace

import pytest

from drake_tc.analysis.joint_loop import JointLoop

from .machine import slowness

pytestmark = pytest.mark.benchmark
LOOP = JointLoop.with_equivalent_gains(
    1.0, 0.01, 2.0, inertia=0.363, link_inertia=0.063, k_tau=2.12e-4, k_v=0.013, k_tau_model=2.12e-4, k_v_model=0.013
)


def test_a_point_of_a_map_is_quick():
    """At most 5 ms at N = 80: the best of several, in this process's own time."""
    LOOP.spectral_radius()
    seconds = []
    for i in range(12):
        loop = replace(LOOP, kp=2.0 + 0.01 * i)
        begin = time.process_time()
        loop.spectral_radius()
        seconds.append(time.process_time() - begin)
    print(f"\npoint of a map: best {1e3 * min(seconds):.2f} ms, n {len(seconds)}")
    assert min(seconds) <= 5e-3 * slowness()
