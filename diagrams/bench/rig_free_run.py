"""Free run of a recorded run: from a rig's canonical columns to the Drake diagram and back."""

import math

import numpy as np
from drake_tc.diagrams.bench.diagram import Link
from drake_tc.diagrams.bench.free_run import Recording, free_run

from drake_tc.actuation.model import ActuatorModel
from drake_tc.errors import ParamsError
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.logs.loads import GRAVITY, Pendulum
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

LONGEST = 60.0
"""At most this much of a run is simulated [s]; the report says so when it is cut."""
LONGEST_STEP = 1.5e-3
"""Logs on slower clocks are simulated in several steps a sample [s]; the command is held between them."""


def rig_free_run(
    model: ActuatorModel, rig: Rig, joint: str, run: Run, longest: float = LONGEST
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """(time, recorded, simulated position), (T,) each, over the longest usable stretch of `run` up to `longest` [s].

    None where the model has no inertia that a free run could move, or the load is unknown. A diverged run is NaN
    from there on.
    """
    stretch = max(run.segments(), key=lambda s: s.stop - s.start)
    stretch = slice(stretch.start, min(stretch.stop, stretch.start + round(longest / run.period)))
    q = run.columns[f"{joint}/position"][stretch]
    if q.size < 20:
        return None
    kernel = CommonKernel(max(0.02, 5.0 * run.period), run.period)
    load = rig.load[joint]
    zero = load.zero if isinstance(load, Pendulum) else 0.0
    command = run.columns[rig.command_column(joint)][stretch]
    warm, supply = (run.columns.get(f"{joint}/{channel}") for channel in ("temperature", "supply_voltage"))
    torque = run.columns.get(f"{joint}/torque")
    recording = Recording(
        time=run.time[stretch] - run.time[stretch.start],
        command=command - zero if rig.drive[joint] == "position_servo" else command,
        initial_position=float(q[0]) - zero,
        initial_velocity=float(kernel.derivative(q)[0]),
        position_span=(float(q.min()) - zero, float(q.max()) - zero),
        load_torque=None if isinstance(load, Pendulum) or torque is None else kernel.smooth(torque[stretch]),
        pendulum=Link(load.inertia, load.mass * GRAVITY * load.length) if isinstance(load, Pendulum) else None,
        temperature=None if warm is None else warm[stretch],
        supply_voltage=None if supply is None else supply[stretch],
    )
    try:
        simulated = free_run(model, recording, substeps=max(1, math.ceil(run.period / LONGEST_STEP - 1e-9)))
    except ParamsError:
        return None
    return np.asarray(run.time[stretch] - run.time[0]), q, simulated + zero
