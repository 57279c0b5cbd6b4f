"""From a rig's canonical columns to what a free run is given."""

import numpy as np

from drake_tc.actuation.recorded_run import Link, PositionLoop, Recording
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig

SHORTEST = 20
"""A run of fewer samples is not simulated."""
LONGEST = 60.0
"""At most this much of a run is simulated [s]; the report says so when it is cut."""


def longest_stretch(run: Run, longest: float = LONGEST) -> slice | None:
    """The longest usable stretch of a run, its first `longest` [s]; None where it is too short."""
    stretch = max(run.segments(), key=lambda s: s.stop - s.start, default=slice(0, 0))
    stretch = slice(stretch.start, min(stretch.stop, stretch.start + round(longest / run.period)))
    return stretch if stretch.stop - stretch.start >= SHORTEST else None


def loop_of(rig: Rig, joint: str, run: Run) -> PositionLoop | None:
    """The position loop around a current or voltage drive, where the run has its gain and the position command."""
    gain = run.columns.get(f"{joint}/position_gain")
    if rig.drive[joint] == "position_servo" or gain is None or f"{joint}/position_command" not in run.columns:
        return None
    value = float(np.median(gain))
    return PositionLoop(value, rig.saturation.get(joint, np.inf)) if value > 0.0 else None


def recording_of(rig: Rig, joint: str, run: Run, stretch: slice) -> Recording:
    """What a free run over one stretch of a run is given; the load of a rig that does not know it stays open."""
    q = run.columns[f"{joint}/position"][stretch]
    loop = loop_of(rig, joint, run)
    command = rig.command_column(joint) if loop is None else f"{joint}/position_command"
    kernel = CommonKernel(max(0.02, 5.0 * run.period), run.period)
    load = rig.load[joint]
    if isinstance(load, Pendulum):
        load = load.in_run(run)
    channels = ("temperature", "supply_voltage", "torque")
    warm, supply, torque = (run.columns.get(f"{joint}/{channel}") for channel in channels)
    known = Link(load.inertia, load.weight, load.zero) if isinstance(load, Pendulum) else None
    return Recording(
        time=run.time[stretch] - run.time[stretch.start],
        command=run.columns[command][stretch],
        initial_position=float(q[0]),
        initial_velocity=float(kernel.derivative(q)[0]),
        position_span=(float(q.min()), float(q.max())),
        load_torque=None if known is not None or torque is None else np.asarray(kernel.smooth(torque[stretch])),
        pendulum=known,
        temperature=None if warm is None else warm[stretch],
        supply_voltage=None if supply is None else supply[stretch],
        loop=loop,
    )
