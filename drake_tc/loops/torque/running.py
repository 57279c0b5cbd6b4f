"""Run a torque loop; a solver that fails or a state that leaves all bounds says which and when."""

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import Context

from drake_tc.errors import SimulationError
from drake_tc.loops.advancing import Progress
from drake_tc.loops.torque.loop import Loop, build_loop
from drake_tc.loops.torque.recording import TorqueRecording
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.types import FloatArray, IntArray

RUNAWAY_SPEED = 100.0
"""A joint that is faster [rad/s] has run away: no geared joint gets there."""


def simulate_scenario(
    scenario: Scenario, progress: Progress | None = None, *, meshcat: bool = False, allow_runaway: bool = False
) -> TorqueRecording:
    """Build a scenario's loop, run it, and return what was logged.

    Args:
        scenario: What to run.
        progress: Told what is done and which share.
        meshcat: Show the robot in a browser.
        allow_runaway: Stop quietly where a joint runs away, and return what was logged until then.

    Raises:
        ParamsError: a scenario that cannot be built.
        SimulationError: a solver failed, or the state left all bounds; names the system and the time.
    """
    if progress:
        progress("building", 0.0)
    return run_loop(build_loop(scenario, meshcat=meshcat, fused=True), progress, allow_runaway=allow_runaway)


def run_loop(loop: Loop, progress: Progress | None = None, *, allow_runaway: bool = False) -> TorqueRecording:
    """As `simulate_scenario`, for a loop that is built."""

    def watch(context: Context) -> Callable[[float], bool]:
        def goes_on(now: float) -> bool:
            if _bounded(loop, context):
                return True
            if allow_runaway:
                return False
            raise _runaway(loop, context)

        return goes_on

    found = loop.run(watch, progress)
    signals = dict(found.signals)
    order = joint_order(loop)
    places = np.array([loop.plant.GetJointByName(name).position_start() for name in loop.robot.joints])
    states = signals["joint_state"]
    if not loop.robot.fixed_base:
        signals["base_state"] = np.delete(states, np.concatenate([places, order + loop.plant.num_positions()]), axis=1)
    signals["joint_state"] = states[:, np.concatenate([places, order + loop.plant.num_positions()])]
    signals["acceleration"] = signals["acceleration"][:, order]
    return TorqueRecording(
        **vars(found) | {"signals": signals}, robot=loop.robot, models=loop.models, plant_step=loop.plant.time_step()
    )


def joint_order(loop: Loop) -> IntArray:
    """(n,) where the plant has the robot's joints in its velocities."""
    return np.array([loop.plant.GetJointByName(name).velocity_start() for name in loop.robot.joints])


def _speeds(loop: Loop, context: Context) -> FloatArray:
    plant = loop.plant
    return np.asarray(plant.GetVelocities(plant.GetMyContextFromRoot(context)))


def _bounded(loop: Loop, context: Context) -> bool:
    speeds = _speeds(loop, context)
    return bool(np.all(np.isfinite(speeds)) and np.abs(speeds).max(initial=0.0) < RUNAWAY_SPEED)


def _runaway(loop: Loop, context: Context) -> SimulationError:
    speeds = _speeds(loop, context)
    worst = int(np.argmax(np.where(np.isfinite(speeds), np.abs(speeds), np.inf)))
    names = loop.plant.GetVelocityNames()
    at = context.get_time()
    return SimulationError(
        f"system 'plant' ran away by t = {at:.3f} s: {names[worst]} is {speeds[worst]:.3g}, beyond"
        f" {RUNAWAY_SPEED:g} rad/s; the loop is unstable, or plant_step {loop.scenario.plant_step:g} s too large"
    )
