"""Any diagram of the registry at a moment of its scenario, before the events of that tick."""

from collections.abc import Sequence
from typing import Any

from pydrake.systems.analysis import Simulator

from drake_tc.analysis.frequency_response import Channel, check_channels
from drake_tc.errors import SimulationError


def settled_at(entry: Any, scenario: Any, at: float, ports: Sequence[Channel]) -> tuple[Any, Any]:
    """The built diagram and its context at the tick nearest to `at` [s]; the ports are looked for first.

    Args:
        entry: Of the registry.
        scenario: Of that entry.
        at: Moment [s].
        ports: (input, output) that must be there.

    Raises:
        ParamsError: a scenario that cannot be built, or a port that is not there.
        SimulationError: the way there failed.
    """
    long = scenario.changed(duration=max(scenario.duration, at + 1.0))
    loop = entry.build(long)
    simulator = Simulator(loop.diagram)
    context = simulator.get_mutable_context()
    loop.start(context)
    check_channels(loop.diagram, context, ports)
    dt = loop.period
    try:
        simulator.Initialize()
        simulator.AdvanceTo(round(at / dt) * dt)
    except RuntimeError as error:
        raise SimulationError(f"the way to t = {at:g} s failed: {' '.join(str(error).split())}") from error
    return loop, context
