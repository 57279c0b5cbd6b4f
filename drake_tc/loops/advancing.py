"""Advancing a simulation piece by piece, watched."""

import math
from collections.abc import Callable

from pydrake.systems.analysis import Simulator

from drake_tc.errors import SimulationError

Progress = Callable[[str, float], None]


def advance(
    simulator: Simulator,
    duration: float,
    chunk: float,
    goes_on: Callable[[float], bool],
    *,
    plant_step: float,
    progress: Progress | None = None,
) -> None:
    """Initialize, then advance to `duration` [s] in pieces of `chunk` [s], as long as what is watched goes on.

    Args:
        simulator: At the start.
        duration: Where it ends.
        chunk: Between two looks.
        goes_on: Looks at the state after a piece, at its time [s]; False ends the run there.
        plant_step: Of the plant [s], for the message.
        progress: Told what is done and which share.

    Raises:
        SimulationError: a system failed; says when, and what to try. What `goes_on` raises is passed on.
    """
    chunks = math.ceil(duration / chunk - 1e-9)
    try:
        simulator.Initialize()
        for number in range(1, chunks + 1):
            now = duration if number == chunks else number * chunk
            simulator.AdvanceTo(now)
            if not goes_on(now):
                return
            if progress:
                progress(f"{now:.1f} of {duration:g} s", now / duration)
    except RuntimeError as error:
        raise SimulationError(
            f"the simulation failed at t = {simulator.get_context().get_time():.4f} s: {' '.join(str(error).split())};"
            f" try a smaller plant_step than {plant_step:g} s"
        ) from error
