"""What the closed loop before and after is made of: a result's models, its robot or pendulums, a held-out motion.

The motion of a held-out run as a reference: its liveliest stretch, begun and ended at rest, as knots.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.analysis.before_after.pendulum_robot import (
    Slide,
    Swing,
    fitted_slide,
    fitted_swing,
    swing_of,
    write_pendulum_robot,
)
from drake_tc.diagnosis.data.samples import Samples, one_clock
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.models import links_entry, model_of, shared_entry
from drake_tc.diagnosis.result.rig_result import CloseLoopResult, SharedEffect
from drake_tc.errors import ParamsError
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.rig import Rig, load_rig
from drake_tc.loops.scenarios.parts import MotionSpec
from drake_tc.robot.link_changes import OF_LINKS
from drake_tc.types import FloatArray

KNOT = 0.05
"""Between knots [s]."""
RAMP = 0.5
"""Over which the motion comes up to its own speed, and slows down again [s]."""


@dataclass(frozen=True)
class HeldOutMotion:
    """A reference and where it comes from.

    Attributes:
        spec: Knots.
        run: Name of the run. start, end: of the stretch in it [s].
        begin, finish: When the reference moves [s].
    """

    spec: MotionSpec
    run: str
    start: float
    end: float
    begin: float
    finish: float


def held_out_motion(samples: Mapping[str, Samples], longest: float, lead: float) -> HeldOutMotion | None:
    """The stretch of at most `longest` [s] in which the joints move most, each measured by its own speed.

    Args:
        samples: Joint to its held-out side; all of one clock.
        longest: Of the stretch [s].
        lead: Rest before it [s].

    Returns:
        None where no stretch is as long as a second.
    """
    first = next(iter(samples.values()))
    period = first.signals.period
    speed = np.zeros(len(first.signals))
    for each in samples.values():
        own = np.abs(each.signals.velocity)
        speed += own / max(float(own.mean()), 1e-12)
    best: tuple[float, slice] | None = None
    for segment in first.segments:
        margin = max(each.light.margin for each in samples.values())
        begin, stop = segment.start + margin, segment.stop - margin
        size = min(round(longest / period), stop - begin)
        if size * period < 1.0:
            continue
        total = np.concatenate([[0.0], np.cumsum(speed[begin:stop])])
        sums = total[size:] - total[:-size]
        at = int(np.argmax(sums))
        if best is None or sums[at] > best[0]:
            best = (float(sums[at]), slice(begin + at, begin + at + size))
    if best is None:
        return None
    part = best[1]
    time = (np.arange(part.stop - part.start)) * period
    times, progress = eased(float(time[-1]))
    knots = {joint: _knots(each.signals.position[part], time, progress) for joint, each in samples.items()}
    clock = first.signals.time[part]
    spec = MotionSpec(
        posture={joint: values[0] for joint, values in knots.items()},
        times=tuple(float(t) for t in times + lead),
        knots=knots,
    )
    run = first.runs[int(first.run_of_sample[part.start])]
    return HeldOutMotion(spec, run, float(clock[0]), float(clock[-1]), lead, lead + float(times[-1]))


def eased(duration: float) -> tuple[FloatArray, FloatArray]:
    """(times of knots, places s in the stretch) [s], with ds/dt risen to 1 and fallen to 0 over `RAMP`."""
    ramp = min(RAMP, 0.5 * duration)
    count = max(2, round((duration + ramp) / KNOT) + 1)
    times = np.linspace(0.0, duration + ramp, count)
    fine = np.linspace(0.0, duration + ramp, 20 * count)
    rise = np.clip(np.minimum(fine, fine[-1] - fine) / ramp, 0.0, 1.0)
    rate = rise**3 * (10.0 - 15.0 * rise + 6.0 * rise**2)
    places = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(fine))])
    return times, np.asarray(np.interp(times, fine, places * duration / places[-1]))


def _knots(position: FloatArray, time: FloatArray, places: FloatArray) -> tuple[float, ...]:
    """Means over the time between knots: what the knots cannot follow must not be folded into them."""
    period = float(time[1] - time[0])
    box = max(1, round(KNOT / period)) | 1
    padded = np.pad(position, box // 2, mode="edge")
    smooth = np.convolve(padded, np.full(box, 1.0 / box), mode="valid")
    return tuple(float(q) for q in np.interp(places, time, smooth))


LONGEST = 3.5
LONGEST_PENDULUM = 1.5
"""Of the motion that is followed by a robot, and by a rig without one [s]."""
LEAD = 0.7
"""Rest before it: filters fill, the F/T sensors are zeroed, the guard lets go [s]."""
FEWEST_ROWS = 50
"""Of a run whose load is held against a pendulum's."""


@dataclass(frozen=True)
class LoopCase:
    """What is compared.

    Attributes:
        robot: Robot file.
        plant: What it is, in words.
        before, after: Joint of the rig to its model; `after` is simulated as well.
        motion: The reference.
        offset: Largest q_d - q that the guard lets pass [rad].
        seed: Of the sensors' noise.
        shared: Causes of links as a model file has them; the controller before does not know them.
        links: Links' inertial parameters that were fitted, likewise; both controllers know them.
        notes: What the comparison leaves out.
    """

    robot: Path
    plant: str
    before: Mapping[str, ActuatorModel]
    after: Mapping[str, ActuatorModel]
    motion: HeldOutMotion
    offset: float = 0.2
    seed: int = 0
    shared: tuple[Mapping[str, Any], ...] = ()
    links: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def loop_case(result: CloseLoopResult, folder: Path, seed: int = 0) -> LoopCase:
    """What there is to compare of a result.

    Args:
        result: Of `close_loop`.
        folder: Where to write a robot file for a rig without one.
        seed: Of the sensors' noise.

    Raises:
        RigError: the rig file is not there any more.
        ParamsError: no robot and no pendulum, or logs without a common stretch.
    """
    rig = load_rig(result.rig_file) if result.rig is None else result.rig
    sides = {name: joint.heldout.samples for name, joint in result.joints.items()}
    if not one_clock(list(sides.values())):
        raise ParamsError("the joints' held-out rows count different samples, so there is no common motion")
    motion = held_out_motion(sides, LONGEST_PENDULUM if rig.robot is None else LONGEST, LEAD)
    if motion is None:
        raise ParamsError("expected a held-out stretch of at least one second to follow")
    before, after = ({n: model_of(j, final=final) for n, j in result.joints.items()} for final in (False, True))
    if rig.robot is not None:
        path, plant = rig.robot, f"the robot of {rig.robot.name}"
    else:
        path = write_pendulum_robot({name: _swing(rig, joint) for name, joint in result.joints.items()}, folder)
        given = all(isinstance(load, Pendulum) for load in rig.load.values())
        plant = f"{_carried(result)} on each joint, " + (
            "as the rig file gives it (of runs with different masses, the first)"
            if given
            else "of the inertia and the weight that the logged load torque shows"
        )
    largest = max(float(np.abs(side.signals.effort).max()) for side in sides.values())
    shared, notes = _shared(result.shared)
    links = None if result.links is None else links_entry(result.links)
    return LoopCase(path, plant, before, after, motion, max(0.2, 3.0 * largest), seed, shared, links or {}, notes)


def _carried(result: CloseLoopResult) -> str:
    sliding = {joint.units.slides for joint in result.joints.values()}
    return "a pendulum or a sliding mass" if len(sliding) > 1 else "a mass" if True in sliding else "a pendulum"


def _shared(causes: Sequence[SharedEffect]) -> tuple[tuple[Mapping[str, Any], ...], tuple[str, ...]]:
    """What the links turned out to be, as a model file has it, and what of the shared causes the loop does not show."""
    of_links = [cause for cause in causes if cause.id in OF_LINKS]
    left = [f"{cause.title} ({cause.where})" for cause in causes if cause not in of_links]
    notes = []
    if of_links:
        found = ", ".join(f"{cause.title} ({cause.where})" for cause in of_links)
        notes.append(f"The simulated links are as they were found: {found}; the controller before does not know it.")
    if left:
        notes.append(f"Not part of the simulated loop, neither before nor after: {', '.join(left)}.")
    return tuple(shared_entry(cause) for cause in of_links), tuple(notes)


def _swing(rig: Rig, joint: JointResult) -> Swing | Slide:
    """The pendulum or sliding mass on a joint: the rig's, or the one that a run's load is most alike."""
    load = rig.load[joint.joint]
    if isinstance(load, Pendulum):
        return swing_of(load)
    if load == "unknown":
        raise ParamsError(f"the load of {joint.joint} is unknown, so there is no plant to simulate")
    found: list[tuple[Swing | Slide, float] | None] = []
    for samples in (joint.train.samples, joint.heldout.samples):
        signals = samples.signals
        for run in range(len(samples.runs)):
            rows = samples.rows[samples.run == run]
            if rows.size >= FEWEST_ROWS:
                q, v, a = (x[rows] for x in (signals.position, signals.velocity, signals.acceleration))
                tau = signals.load_torque[rows]
                found.append(fitted_slide(v, a, tau) if joint.units.slides else fitted_swing(q, v, a, tau))
    best = max((each for each in found if each is not None), key=lambda each: each[1], default=None)
    if best is None:
        kind = "mass with its weight" if joint.units.slides else "pendulum"
        raise ParamsError(
            f"the logged load of {joint.joint} is not that of a {kind}, so there is no plant to simulate;"
            " `robot:` in the rig file would give one"
        )
    return best[0]
