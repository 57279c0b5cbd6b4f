"""A linear verdict held against time simulation: two runs from one state, one of them kicked, and what becomes of the
difference.

What both runs do alike (a motion, gravity) cancels. A small kick stays where the linearisation holds; a large one shows
what dead zones, dry friction and limits make of it.

`settled_at`: any diagram of the registry at a moment of its scenario, before the events of that tick; and its speeds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import InitializeParams, Simulator
from pydrake.systems.framework import Context, Diagram

from drake_tc.analysis.frequency_response import Channel, check_channels
from drake_tc.analysis.state_coordinates import StateCoordinates
from drake_tc.errors import ParamsError, SimulationError
from drake_tc.types import FloatArray

EARLY, LATE = (0.2, 0.45), (0.75, 1.0)
"""Shares of the time whose deviations are compared."""
SHARE = 0.02
"""Of the largest deviation: later ones below that count as decayed, whatever they do."""


@dataclass(frozen=True)
class Release:
    """What became of a kick.

    Attributes:
        time: (T,) since the kick [s].
        deviation: (T,) RMS over the watched states of what the kicked run differs by.
    """

    time: FloatArray
    deviation: FloatArray

    @property
    def growth(self) -> float:
        """RMS deviation late over early: below 1 the kick dies away."""
        end = self.time[-1]
        early, late = (
            np.sqrt(np.mean(self.deviation[(self.time >= a * end) & (self.time <= b * end)] ** 2))
            for a, b in (EARLY, LATE)
        )
        if not np.isfinite(late):
            return float("inf")
        if late <= SHARE * float(self.deviation.max()):
            return float(min(late / early, 1.0 - 1e-12)) if early > 0.0 else 0.0
        return float(late / early) if early > 0.0 else float("inf")

    @property
    def stable(self) -> bool:
        """Whether the kick dies away."""
        return self.growth < 1.0


def release(diagram: Diagram, context: Context, dt: float, kick: dict[str, float], duration: float = 2.0) -> Release:
    """Kick some states, and follow their difference to the run without.

    Args:
        diagram: Whose loop.
        context: Of it, at a tick; not changed.
        dt: Control period [s].
        kick: State, named as in `StateCoordinates.names`, to what is added to it; 0 for one that is followed only.
        duration: [s].

    Raises:
        ParamsError: an unknown state.
        SimulationError: the run without the kick failed.
    """
    coordinates = StateCoordinates(diagram, context)
    places = {name: i for i, name in enumerate(coordinates.names)}
    for name in kick:
        if name not in places:
            raise ParamsError(f"release: no state {name!r}; states are named like {coordinates.names[0]!r}")
    seen = [places[name] for name in kick]
    rows = []
    for moved in (False, True):
        own: Any = context.Clone()
        if moved:
            x = coordinates.read(own)
            x[seen] += list(kick.values())
            coordinates.write(own, x)
        ticks = round(own.get_time() / dt) + np.arange(1, round(duration / dt) + 1)
        rows.append(_run(diagram, own, coordinates, seen, ticks * dt))
    if len(rows[0]) < round(duration / dt):
        raise SimulationError("release: the run without the kick did not reach its end")
    lost = np.full((len(rows[0]) - len(rows[1]), len(seen)), np.inf)
    difference = np.concatenate([rows[1], lost]) - rows[0]
    time: FloatArray = dt * np.arange(1.0, len(difference) + 1.0)
    return Release(time, np.sqrt(np.mean(difference**2, axis=1)))


def _run(
    diagram: Diagram, context: Context, coordinates: StateCoordinates, seen: list[int], times: FloatArray
) -> FloatArray:
    """(T, k) of the watched states; shorter where the simulation failed."""
    simulator = Simulator(diagram, context)
    blocks = [block for block in coordinates.blocks if any(block.first <= i < block.first + block.size for i in seen)]
    found = []
    try:
        simulator.Initialize(InitializeParams(suppress_initialization_events=True))
        for time in times.tolist():
            simulator.AdvanceTo(time)
            x = np.zeros(coordinates.size)
            for block in blocks:
                x[block.first : block.first + block.size] = block.read(context)
            found.append(x[seen])
            if not np.all(np.abs(found[-1]) < 1e3):
                break
    except (RuntimeError, SystemExit):
        pass
    return np.array(found).reshape(-1, len(seen))


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
