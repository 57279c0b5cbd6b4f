"""Where a torque loop is linearised: settled in its scenario, sensors perfect."""

from dataclasses import replace
from typing import Any

from pydrake.systems.analysis import Simulator

from drake_tc.errors import SimulationError
from drake_tc.loops.torque.loop import Loop, build_loop
from drake_tc.loops.torque.scenario import Scenario


def settled(scenario: Scenario, at: float) -> tuple[Loop, Any]:
    """The scenario's loop with perfect sensors, and its context at a time, before the events of that tick.

    Args:
        scenario: What to build.
        at: A multiple of dt by which filters are full and the guard has let go of the start [s].

    Raises:
        ParamsError: a scenario that cannot be built.
        SimulationError: a solver failed on the way.
    """
    scenario = replace(scenario, sensors="perfect", duration=max(scenario.duration, at + 1.0))
    loop = build_loop(scenario)
    simulator = Simulator(loop.diagram)
    context = simulator.get_mutable_context()
    loop.start(context)
    try:
        simulator.Initialize()
        simulator.AdvanceTo(round(at / scenario.dt) * scenario.dt)
    except RuntimeError as error:
        raise SimulationError(f"the way to the operating point failed: {' '.join(str(error).split())}") from error
    return loop, context
