"""One loop of the comparison before and after: simulated in a process of its own or here, and cut to its motion."""

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from drake_tc.control.guard import GuardMode
from drake_tc.loops.advancing import Progress
from drake_tc.loops.torque.running import simulate_scenario
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class Trace:
    """A simulated motion of n joints.

    Attributes:
        time: (T,) [s].
        reference, error: (T, n) q_d, q_d - q [rad]; NaN from where a joint ran away.
        ran_away: That it did.
        held: That the guard did not pass the controller's command all the time.
    """

    time: FloatArray
    reference: FloatArray
    error: FloatArray
    ran_away: bool
    held: bool


def simulated(scenarios: Mapping[str, Scenario], progress: Progress, executor: Executor | None) -> dict[str, Trace]:
    """One trace a scenario, beside each other where there is an executor."""
    progress("closed loop, simulating", 0.1)
    if executor is not None:
        futures = {side: executor.submit(track, scenario) for side, scenario in scenarios.items()}
        return {side: future.result() for side, future in futures.items()}
    traces = {}
    for number, (side, scenario) in enumerate(scenarios.items()):
        progress(f"closed loop, simulating {side}", 0.1 + 0.8 * number / len(scenarios))
        traces[side] = track(scenario)
    return traces


def track(scenario: Scenario) -> Trace:
    """Simulate one loop.

    Raises:
        ParamsError: a scenario that cannot be built.
        SimulationError: a solver failed.
    """
    made = simulate_scenario(scenario, allow_runaway=True)
    begin = scenario.motion.times[0]
    n, done = made.size, made.time.size
    ran_away = made.time[-1] < scenario.duration - 1.5 * scenario.dt
    ticks = round(scenario.duration / scenario.dt) + 1 if ran_away else done
    time = np.arange(ticks, dtype=np.float64) * scenario.dt
    reference, error = np.full((ticks, n), np.nan), np.full((ticks, n), np.nan)
    reference[:done] = made["reference"][:, :n]
    error[:done] = made.tracking_error
    kept = time >= begin
    mode = made["mode"][made.time >= begin]
    held = bool((mode != GuardMode.NORMAL).any())
    return Trace(time[kept] - begin, reference[kept], error[kept], bool(ran_away), held)


def remarks(side: str, trace: Trace) -> list[str]:
    """What the reader must know of a trace."""
    words = {"before": "the model before", "after": "the model after"}[side]
    if trace.ran_away:
        until = float(trace.time[int(np.argmin(np.isfinite(trace.error).all(axis=1)))])
        return [f"With {words} compensated, the simulated robot ran away {until:.2f} s into the motion."]
    return [f"With {words} compensated, the guard held back the command for a while."] if trace.held else []
