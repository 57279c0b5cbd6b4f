"""How long the design of one joint's motion takes; printed as rows (run with -s)."""

import time

import pytest

from drake_tc.cli.demo import DemoLength, record_demo
from drake_tc.experiments.design.loads import KnownLoad
from drake_tc.experiments.design.request import DesignRequest, designed
from drake_tc.experiments.design.run import DesignOptions

from .machine import require

pytestmark = pytest.mark.benchmark


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    return record_demo(tmp_path_factory.mktemp("demo"), 0, DemoLength(duration=12.0, period=2e-3, step=2.5e-4), jobs=1)


PAIR = "tell:stribeck,presliding_hysteresis"


@pytest.mark.parametrize("goal", [PAIR, pytest.param("all", marks=pytest.mark.slow)])
def test_the_motion_of_one_joint_is_designed_quickly(demo, goal):
    """Reading included, in this process's own time."""
    rig, train, _ = demo

    def design():
        begin = time.process_time()
        found = designed(DesignRequest(rig, tuple(train), None, goal, None, (), {}), DesignOptions())
        assert len(found) == 1
        return {f"design, {goal}": time.process_time() - begin}

    require({f"design, {goal}": 15.0}, design, rounds=3)


@pytest.mark.parametrize("goal", [pytest.param(PAIR, marks=pytest.mark.slow), "all"])
def test_the_motions_under_two_known_loads_are_designed_quickly(demo, goal):
    rig, train, _ = demo
    loads = (KnownLoad(0.0), KnownLoad(1.5, 0.3))
    request = DesignRequest(rig, tuple(train), None, goal, None, (), {}, loads=loads)

    def design():
        begin = time.process_time()
        (found,) = designed(request, DesignOptions()).values()
        assert found.expected
        return {f"design with two loads, {goal}": time.process_time() - begin}

    require({f"design with two loads, {goal}": 22.0}, design, rounds=3)
