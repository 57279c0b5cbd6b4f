"""What is timed are single ticks of the whole diagram: a few slow ones show."""

import time
from types import SimpleNamespace

from numpy.testing import assert_array_equal
from pydrake.systems.framework import EventStatus, LeafSystem

from drake_tc.loops.whole_body.running import simulate_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.registry import tsid_entry
from tests.benchmarks import tsid_parts as parts
from tests.benchmarks import tsid_timing as timing

PERIOD, SLOW = 2e-3, 4e-3


class Busy(LeafSystem):
    """Takes SLOW of its thread's time in every thirtieth tick, next to nothing in the others."""

    def __init__(self) -> None:
        super().__init__()
        self.DeclarePeriodicPublishEvent(PERIOD, 0.0, self._work)

    def _work(self, context):
        end = time.thread_time() + (SLOW if round(context.get_time() / PERIOD) % 30 == 7 else 0.0)
        while time.thread_time() < end:
            pass
        return EventStatus.DidNothing()


def test_slow_ticks_are_not_averaged_away_and_the_label_has_the_period(monkeypatch):
    loop = SimpleNamespace(diagram=Busy(), law=SimpleNamespace(period=PERIOD), start=lambda context: None)
    monkeypatch.setattr(timing, "build_tsid", lambda scenario, fused: loop)
    row = timing.diagram_timing(TsidScenario(controller="none.yaml", duration=300 * PERIOD))
    assert row.n == 299
    assert row.highest >= 1e6 * SLOW
    assert row.value < 0.1e6 * SLOW
    assert row.name.startswith("the diagram, a tick of 2 ms:")
    assert row.unit == "us"


def test_the_plant_alone_moves_as_it_did_with_the_controller():
    recording = simulate_tsid(tsid_entry().scenario("com_move").changed(duration=0.02))
    simulator = parts._plant_under(recording)
    simulator.AdvanceTo(recording.time[-1])
    plant = simulator.get_system().GetSubsystemByName("plant")
    state = plant.GetPositionsAndVelocities(plant.GetMyContextFromRoot(simulator.get_context()))
    assert_array_equal(state, recording["state"][-1])
