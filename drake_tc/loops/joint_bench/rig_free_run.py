"""Free run of a recorded run: from a rig's canonical columns to the Drake diagram and back."""

import math

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.recorded_run import in_plant
from drake_tc.diagnosis.data.recordings import LONGEST, longest_stretch, recording_of
from drake_tc.errors import ParamsError
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.loops.joint_bench.free_run import free_run
from drake_tc.types import FloatArray

LONGEST_STEP = 1.5e-3
"""Logs on slower clocks are simulated in several steps a sample [s]; the command is held between them."""


def rig_free_run(
    model: ActuatorModel, rig: Rig, joint: str, run: Run, longest: float = LONGEST
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """(time, recorded, simulated position), (T,) each, over the longest usable stretch of `run` up to `longest` [s].

    None where the model has no inertia that a free run could move, or where a load that is a curve over the position
    meets an effect that depends on the load (`in_plant`). A diverged run is NaN from there on.
    """
    stretch = longest_stretch(run, longest)
    if stretch is None:
        return None
    placed = in_plant(model, recording_of(rig, joint, run, stretch))
    if placed is None:
        return None
    try:
        simulated = free_run(*placed, substeps=max(1, math.ceil(run.period / LONGEST_STEP - 1e-9)))
    except ParamsError:
        return None
    recorded = run.columns[f"{joint}/position"][stretch]
    return np.asarray(run.time[stretch] - run.time[0]), recorded, simulated
