"""Runs of a twin: references and loads on the simulator's clock, and their integration in one time loop."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.errors import SimulationError
from drake_tc.joint_simulator.physics import CHANNELS, Batch, Record
from drake_tc.joint_simulator.reference import LOG_PERIOD, Motion
from drake_tc.joint_simulator.spec import RigSpec
from drake_tc.types import FloatArray

STEP = 2e-4
"""Integration step [s]."""
FARTHEST = 3.0
"""Travel of a simulation over that of the log, above which it has run away."""


@dataclass(frozen=True, eq=False)
class TwinRun:
    """One run as the twin repeats it: reference [rad] and load by hand [N m] at `LOG_PERIOD`, logged at `time` [s]."""

    name: str
    motion: Motion
    time: FloatArray


def integrated(specs: Sequence[RigSpec], runs: Sequence[TwinRun]) -> list[Record]:
    """Run i of joint i, all in one time loop; a motion that is shorter than the longest one rests at its end.

    Raises:
        SimulationError: A joint ran away.
    """
    size = max(run.motion.position.size for run in runs)
    motions = [_held(run.motion, size) for run in runs]
    lasting = [replace(spec, duration=float((size - 1) * LOG_PERIOD)) for spec in specs]
    batch = Batch(lasting, ["sine"] * len(lasting), motions, STEP)
    reference = np.stack([motion.position for motion in motions], axis=1)
    batch.state.q[:] = reference[0]
    batch.link_q = batch.state.q.copy()
    kept = batch.integrate(round(LOG_PERIOD / STEP), 1)
    travel = np.max(np.abs(kept[CHANNELS.index("position")] - reference[:-1]), axis=0)
    span = np.maximum(np.ptp(reference, axis=0), 0.1)
    for spec, run, bad in zip(specs, runs, ~(travel < FARTHEST * span), strict=True):
        if bad:
            names = ", ".join(sorted(spec.causes)) or "no effect"
            raise SimulationError(f"run {run.name}: the simulated joint with {names} runs away; choose a smaller size")
    out = []
    for i, (spec, run) in enumerate(zip(lasting, runs, strict=True)):
        count = run.motion.position.size - 1
        own = replace(spec, duration=float(count * LOG_PERIOD))
        out.append(Record(own, run.name, {name: kept[k, :count, i] for k, name in enumerate(CHANNELS)}))
    return out


def _held(motion: Motion, size: int) -> Motion:
    """The motion with its last position and load held until it has `size` samples."""
    more = size - motion.position.size
    position, load = (np.pad(x, (0, more), mode="edge") for x in (motion.position, motion.load))
    return Motion(position, np.pad(motion.velocity, (0, more)), load)


def on_clock(time: FloatArray, reference: FloatArray, hand: FloatArray) -> Motion:
    """A reference (T,) [rad] and a load (T,) [N m] at times (T,) [s], on the simulator's clock."""
    count = int(np.ceil(time[-1] / LOG_PERIOD)) + 2
    grid: FloatArray = np.asarray(np.arange(count) * LOG_PERIOD, dtype=np.float64)
    q = np.interp(grid, time, reference)
    return Motion(q, np.gradient(q, LOG_PERIOD), np.interp(grid, time, hand))
