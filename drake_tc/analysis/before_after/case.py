"""Robots of the comparison: the pendulum that stands for a joint, and a robot with changed parts.

A robot file of joints that stand by themselves, each with a pendulum or a sliding mass: for rigs without a robot.

A robot's file with its base held, for one of which nothing says what carries it.

What the closed loop before and after is made of: a result's models, its robot or pendulums, a held-out motion.

The motion of a held-out run as a reference: its liveliest stretch, begun and ended at rest, as knots.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import yaml

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.model_file import OF_LINKS
from drake_tc.config.yaml_file import read_yaml
from drake_tc.diagnosis.data.samples import Samples, one_clock
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.models import links_entry, model_of, shared_entry
from drake_tc.diagnosis.result.rig_result import CloseLoopResult, SharedEffect
from drake_tc.errors import ParamsError
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.rig import Rig, load_rig
from drake_tc.loops.scenarios import MotionSpec
from drake_tc.robot.robot import Robot
from drake_tc.types import GRAVITY, FloatArray

WEIGHT_MARGIN = 1.05
"""Over the weight that a mass can have, for the error of the fit."""
LEAST_EXPLAINED = 0.9
"""Share of the load torque's variance that a pendulum must explain before a measured load counts as one."""
EFFORT = 1e5
"""Torque limit of a joint whose rig knows none [N m]."""


@dataclass(frozen=True)
class Swing:
    """tau = inertia qddot + weight sin(q - zero): [kg m^2], [N m], [rad]."""

    inertia: float
    weight: float
    zero: float = 0.0

    def __post_init__(self) -> None:
        if not (0.0 < self.inertia < math.inf and 0.0 <= self.weight < math.inf and math.isfinite(self.zero)):
            raise ParamsError(f"pendulum: expected inertia > 0, weight >= 0 and a finite zero, got {self}")


@dataclass(frozen=True)
class Slide:
    """force = mass qddot + weight, of a joint that slides: [kg], [N] along its axis, |weight| <= mass g."""

    mass: float
    weight: float = 0.0

    def __post_init__(self) -> None:
        if not (0.0 < self.mass < math.inf and abs(self.weight) <= GRAVITY * self.mass):
            raise ParamsError(f"sliding mass: expected mass > 0 and a weight of at most mass g, got {self}")


def swing_of(pendulum: Pendulum) -> Swing:
    """The pendulum that a rig file gives."""
    return Swing(pendulum.inertia, pendulum.weight, pendulum.zero)


def fitted_swing(
    position: FloatArray, velocity: FloatArray, acceleration: FloatArray, torque: FloatArray
) -> tuple[Swing, float] | None:
    """The pendulum nearest to a measured load, and the share of its variance that it explains.

    What the load loses with its speed, beyond the sensor, is fitted beside it and counts as explained.

    Args:
        position: (T,) [rad].
        velocity: (T,) [rad/s].
        acceleration: (T,) [rad/s^2].
        torque: (T,) link side [N m].

    Returns:
        None where no pendulum explains `LEAST_EXPLAINED` of the load.
    """
    columns = np.stack([acceleration, np.sin(position), np.cos(position), velocity], axis=1)
    found = np.linalg.lstsq(columns, torque, rcond=None)[0]
    spread = float(np.sum((torque - torque.mean()) ** 2))
    share = 1.0 - float(np.sum((torque - columns @ found) ** 2)) / max(spread, 1e-300)
    inertia, sine, cosine = (float(value) for value in found[:3])
    if inertia <= 0.0 or share < LEAST_EXPLAINED:
        return None
    return Swing(inertia, math.hypot(sine, cosine), math.atan2(-cosine, sine)), share


def fitted_slide(velocity: FloatArray, acceleration: FloatArray, force: FloatArray) -> tuple[Slide, float] | None:
    """The mass with its weight that is nearest to a measured load of a joint that slides, and the share it explains.

    What the load loses with its speed, beyond the sensor, is fitted beside it and counts as explained.

    Args:
        velocity: (T,) [m/s].
        acceleration: (T,) [m/s^2].
        force: (T,) link side [N].

    Returns:
        None where no mass explains `LEAST_EXPLAINED` of the load, or where the constant force is no weight of it.
    """
    columns = np.stack([acceleration, np.ones(force.size), velocity], axis=1)
    found = np.linalg.lstsq(columns, force, rcond=None)[0]
    spread = float(np.sum((force - force.mean()) ** 2))
    share = 1.0 - float(np.sum((force - columns @ found) ** 2)) / max(spread, 1e-300)
    mass, weight = float(found[0]), float(found[1])
    if mass <= 0.0 or share < LEAST_EXPLAINED or abs(weight) > WEIGHT_MARGIN * GRAVITY * mass:
        return None
    return Slide(mass, float(np.clip(weight, -GRAVITY * mass, GRAVITY * mass))), share


def write_pendulum_robot(swings: Mapping[str, Swing | Slide], folder: Path) -> Path:
    """Write `pendulums.urdf` and `pendulums.yaml`: one joint beside the other on a fixed base.

    Of each link only inertia and weight matter. The axis of a pendulum is level, and its centre of mass lies where at
    least half the inertia is about it. The axis of a joint that slides rises at the slope at which the mass has its
    weight along it.

    Returns:
        The robot file.
    """
    parts = ['<link name="base"/>']
    for i, (joint, swing) in enumerate(swings.items()):
        if isinstance(swing, Slide):
            parts.append(_slide_parts(i, joint, swing))
            continue
        length = min(0.5 * GRAVITY * swing.inertia / swing.weight, 1.0) if swing.weight > 0.0 else 0.0
        mass = swing.weight / (GRAVITY * length) if length > 0.0 else 1.0
        about = swing.inertia - mass * length**2
        x, z = length * math.sin(swing.zero), -length * math.cos(swing.zero)
        parts.append(
            f'<link name="link_{i}"><inertial><origin xyz="{x!r} 0 {z!r}"/><mass value="{mass!r}"/>'
            f'<inertia ixx="{about!r}" iyy="{about!r}" izz="{about!r}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name={quoteattr(joint)} type="revolute"><parent link="base"/><child link="link_{i}"/>'
            f'<origin xyz="0 {2.0 * i!r} 0"/><axis xyz="0 1 0"/>'
            f'<limit effort="{EFFORT!r}" velocity="1000.0" lower="-1000.0" upper="1000.0"/></joint>'
        )
    (folder / "pendulums.urdf").write_text(f'<robot name="pendulums">{"".join(parts)}</robot>\n', encoding="utf-8")
    robot = {
        "name": "pendulums",
        "urdf": "pendulums.urdf",
        "base": "base",
        "fixed_base": True,
        "joints": list(swings),
    }
    path = folder / "pendulums.yaml"
    path.write_text(yaml.safe_dump(robot, sort_keys=False, allow_unicode=True), encoding="utf-8")
    return path


def _slide_parts(number: int, joint: str, slide: Slide) -> str:
    rise = slide.weight / (GRAVITY * slide.mass)
    axis = f"{math.sqrt(1.0 - rise**2)!r} 0 {rise!r}"
    return (
        f'<link name="link_{number}"><inertial><mass value="{slide.mass!r}"/>'
        f'<inertia ixx="{slide.mass!r}" iyy="{slide.mass!r}" izz="{slide.mass!r}" ixy="0" ixz="0" iyz="0"/>'
        f'</inertial></link><joint name={quoteattr(joint)} type="prismatic"><parent link="base"/>'
        f'<child link="link_{number}"/><origin xyz="0 {2.0 * number!r} 0"/><axis xyz="{axis}"/>'
        f'<limit effort="{EFFORT!r}" velocity="1000.0" lower="-1000.0" upper="1000.0"/></joint>'
    )


def write_welded_robot(robot: Robot, folder: Path) -> Path:
    """Write `welded.yaml`: the robot with `fixed_base: true`, for one of which nothing says what carries it.

    Returns:
        The file.

    Raises:
        ParamsError: the robot's file cannot be read.
    """
    return _write(robot, folder / "welded.yaml", {"fixed_base": True})


def _write(robot: Robot, path: Path, changes: Mapping[str, object]) -> Path:
    """The robot's file with some fields changed, its files named from the root."""
    document = read_yaml(robot.source, "robot file") | {"urdf": str(robot.urdf.resolve())}
    if robot.actuators is not None:
        document["actuators"] = str(robot.actuators.resolve())
    path.write_text(yaml.safe_dump(document | dict(changes), sort_keys=False, allow_unicode=True), encoding="utf-8")
    return path


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
