"""Any diagram of the registry at a moment of its scenario, before the events of that tick; and its speeds."""

from collections.abc import Sequence
from typing import Any

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from drake_tc.analysis.frequency_response import Channel, check_channels
from drake_tc.analysis.state_coordinates import StateCoordinates
from drake_tc.errors import SimulationError


def settled_at(entry: Any, scenario: Any, at: float, ports: Sequence[Channel] | None = None) -> tuple[Any, Any]:
    """The built diagram and its context at the tick nearest to `at` [s]; the ports are looked for first.

    Args:
        entry: Of the registry.
        scenario: Of that entry.
        at: Moment [s].
        ports: (input, output) that must be there; None: none.

    Raises:
        ParamsError: a scenario that cannot be built, or a port that is not there.
        SimulationError: the way there failed.
    """
    long = scenario.changed(duration=max(scenario.duration, at + 1.0))
    loop = entry.build(long)
    simulator = Simulator(loop.diagram)
    context = simulator.get_mutable_context()
    loop.start(context)
    if ports is not None:
        check_channels(loop.diagram, context, ports)
    dt = loop.period
    try:
        simulator.Initialize()
        simulator.AdvanceTo(round(at / dt) * dt)
    except RuntimeError as error:
        raise SimulationError(f"the way to t = {at:g} s failed: {' '.join(str(error).split())}") from error
    return loop, context


def speed_states(loop: Any, context: Context) -> list[str]:
    """Names of the states that a kick moves, as `StateCoordinates` has them.

    Those are the speeds of the robot's joints, in its order; the speeds of all plants where the loop names no robot;
    and all states where it has no plant.

    Args:
        loop: A built diagram.
        context: Of it.
    """
    coordinates = StateCoordinates(loop.diagram, context)
    if hasattr(loop, "robot"):
        plant = loop.plant
        (names,) = (block.names for block in coordinates.blocks if block.name == plant.get_name())
        places = [plant.GetJointByName(joint).velocity_start() for joint in loop.robot.joints]
        return [names[plant.num_positions() + place] for place in places]
    plants = [block for block in coordinates.blocks if isinstance(block.system, MultibodyPlant)]
    speeds = [name for block in plants for name in block.names[block.system.num_positions() :]]
    return speeds or list(coordinates.names)
