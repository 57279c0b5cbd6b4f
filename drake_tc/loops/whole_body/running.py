"""A legged robot on a floor under robust TSID (Del Prete and Mansard, 2015), as a scenario describes it, and its runs.

The wiring is that of `add_whole_body_loop` (`drake_tc.loops.whole_body.wiring`); here stand the floor, what pushes, and
what the tasks follow. A run tells how the tasks were followed, how safe it was, what gave way, and which limits the
simulated robot itself broke: its true contact wrenches, torques, positions and velocities.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from scipy.ndimage import uniform_filter1d
from threadpoolctl import threadpool_limits

from drake_tc.errors import ParamsError, SimulationError
from drake_tc.loops.built_loop import BuiltLoop, Start
from drake_tc.loops.fused import StageValues, fused_stages
from drake_tc.loops.loop_builder import behind
from drake_tc.loops.plant import add_pushes, add_robot_plant, check_masses, set_masses
from drake_tc.loops.recording import Progress, Recording, write_log
from drake_tc.loops.whole_body.drives import drive_models, known_drives
from drake_tc.loops.whole_body.ground import add_ground
from drake_tc.loops.whole_body.references import POSITION, contact_source, task_source
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.loops.whole_body.wiring import add_whole_body_loop
from drake_tc.robot.link_changes import link_changes
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.controller import RobustTsid
from drake_tc.tsid.fallbacks import START
from drake_tc.tsid.law import Law, Status
from drake_tc.tsid.limits import WrenchCones
from drake_tc.types import BoolArray, FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class TsidLoop(BuiltLoop[TsidScenario]):
    """A built whole-body loop.

    Attributes:
        law, controller: What it was built around.
        starts: Put parts of a context where the robot starts, in this order.
    """

    law: Law
    controller: RobustTsid
    starts: tuple[Start, ...] = ()

    @property
    def period(self) -> float:
        """Period of the controller [s]."""
        return self.law.period

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.law.model.robot

    def start(self, context: Context) -> None:
        """Give the links the scenario's masses; the robot starts at rest in its posture."""
        set_masses(self.plant, self.plant.GetMyContextFromRoot(context), self.scenario.masses)
        values = StageValues(context, fused_stages(self.diagram))
        for start in self.starts:
            start(values)


def build_tsid(scenario: TsidScenario, *, meshcat: bool = False, fused: bool = False) -> TsidLoop:
    """Build the diagram of a scenario.

    Args:
        scenario: What to build.
        meshcat: Show the robot in a browser.
        fused: Run the stages in one system, which gives the same numbers in less time (`drake_tc.loops.fused`).

    Raises:
        ParamsError: a file that cannot be read, or names or times that do not fit.
    """
    law = _law(scenario)
    robot = law.model.robot
    builder = DiagramBuilder()
    plant = add_grounded_plant(builder, scenario, law, meshcat=meshcat)
    loop = add_whole_body_loop(
        builder,
        plant,
        law,
        scenario,
        models=drive_models(scenario, robot),
        controller_models=drive_models(scenario, robot, controller=True),
        references={name: task_source(law, name, spec) for name, spec in scenario.motion.items()},
        contacts=_contacts(builder, scenario, law),
    )
    diagram, log = loop.build(builder, f"{robot.name}_tsid", fused=fused)
    return TsidLoop(
        scenario=scenario,
        law=law,
        controller=loop.systems["tsid"],
        diagram=diagram,
        plant=plant,
        log=log,
        starts=loop.starts,
        flag_names=loop.flag_names,
    )


def add_grounded_plant(
    builder: DiagramBuilder, scenario: TsidScenario, law: Law, *, meshcat: bool = False
) -> MultibodyPlant:
    """Add a scenario's plant: the robot on its floor, and what pushes it.

    Args:
        builder: Takes the plant.
        scenario: With floor, step and pushes.
        law: Of the controller.
        meshcat: Show the robot in a browser.

    Raises:
        ParamsError: a file that cannot be read, or links that the robot does not have.
    """

    def surround(plant: MultibodyPlant) -> None:
        add_ground(plant, law.model.contacts, scenario.ground)

    robot, drives = law.model.robot, scenario.drives.actuators
    if scenario.torque == "drives" and drives is not None:
        robot = replace(robot, changes=link_changes(scenario.path(drives)))
    plant = add_robot_plant(builder, robot, scenario.plant_step, scene=True, meshcat=meshcat, prepare=surround)
    check_masses(plant, robot, scenario.masses)
    add_pushes(builder, plant, scenario.pushes)
    return plant


def _contacts(builder: DiagramBuilder, scenario: TsidScenario, law: Law) -> OutputPort | None:
    """The contacts on which the controller stands; None where it stands on all of them."""
    if not scenario.lifted:
        return None
    switch = contact_source(law.model.contacts, scenario.lifted, scenario.duration, law.period)
    return behind(builder, "contacts", switch)


def _law(scenario: TsidScenario) -> Law:
    """The controller's law.

    Raises:
        ParamsError: a file that cannot be read, a step that does not divide the period, or no contacts.
    """
    law = load_law(scenario.path(scenario.controller), scenario.changes, known_drives(scenario))
    steps = law.period / scenario.plant_step
    if not (steps > 0.5 and abs(steps - round(steps)) < 1e-6):
        raise ParamsError(
            f"plant_step: expected the controller's period, {law.period:g} s, or a whole part of it,"
            f" got {scenario.plant_step:g}"
        )
    if not law.model.contacts:
        raise ParamsError(
            f"{scenario.path(scenario.controller)}: contacts: expected at least one to stand on, got none"
        )
    return law


FALLEN = 0.6
"""Share of its first height above the floor below which the base counts as fallen."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TsidRecording(Recording):
    """A run of the whole-body loop, sampled every tick of the controller.

    Signals: of the plant "state" (nq + nv) and "contact" (nv), the generalized forces of its true contacts; of the
    controller "torque", "acceleration", "contact_force", "status"; "applied_torque" at the joints; with drives
    "estimated_torque" and "command" too, and "estimated_state" where it is estimated; "flags" of sensors, SENSOR/WHAT,
    where they are checked.

    Attributes:
        scenario, law: What was simulated.
        constraints: Names of the rows that `Status.LIMIT` counts.
        fell: When the robot was found fallen [s]; None: it stands.
    """

    scenario: TsidScenario
    law: Law
    constraints: tuple[str, ...]
    fell: float | None

    def status(self, which: Status) -> FloatArray:
        """(T,) of one part of the status."""
        return self["status"][:, which]


def simulate_tsid(scenario: TsidScenario, progress: Progress | None = None, *, meshcat: bool = False) -> TsidRecording:
    """Build a scenario's diagram, run it, and return what was logged; a robot that falls ends the run.

    Args:
        scenario: What to run.
        progress: Told what is done and which share.
        meshcat: Show the robot in a browser.

    Raises:
        ParamsError: a scenario that cannot be built.
        SimulationError: the plant's solver failed, or its state is not finite; says when.
    """
    if progress:
        progress("building", 0.0)
    return run_tsid(build_tsid(scenario, meshcat=meshcat, fused=True), progress)


def run_tsid(loop: TsidLoop, progress: Progress | None = None) -> TsidRecording:
    """As `simulate_tsid`, for a diagram that is built."""
    fallen = list[float]()

    def watch(context: Context) -> Callable[[float], bool]:
        first = _height(loop, context)

        def goes_on(now: float) -> bool:
            height = _height(loop, context)
            if not math.isfinite(height):
                raise SimulationError(f"system 'plant' has a state that is not finite by t = {now:.3f} s")
            if height < FALLEN * first:
                fallen.append(now)
            return not fallen

        return goes_on

    with threadpool_limits(1):
        found = loop.run(watch, progress)
    return TsidRecording(
        **vars(found),
        scenario=loop.scenario,
        law=loop.law,
        constraints=loop.controller.constraints,
        fell=fallen[0] if fallen else None,
    )


def _height(loop: TsidLoop, context: Context) -> float:
    """Of the base [m]."""
    plant: Any = loop.plant
    body = plant.GetBodyByName(loop.robot.base)
    return float(plant.EvalBodyPoseInWorld(plant.GetMyContextFromRoot(context), body).translation()[2])


def task_errors(recording: TsidRecording, every: int = 10) -> dict[str, FloatArray]:
    """Desired minus true place (S, 3) [m] of the centre of mass and of every frame that is followed, by task.

    Args:
        recording: Of the run.
        every: One sample in so many is looked at.
    """
    law, nq = recording.law, recording.law.model.nq
    scratch, rest = law.model.create_scratch(), law.starting_terms()
    followed = {task.name: (task, POSITION[type(task)][0]) for task in law.tasks if type(task) in POSITION}
    desired: dict[str, list[FloatArray]] = {name: [] for name in followed}
    found: dict[str, list[FloatArray]] = {name: [] for name in followed}
    sources = {name: task_source(law, name, spec) for name, spec in recording.scenario.motion.items()}
    contexts = {name: source.CreateDefaultContext() for name, source in sources.items()}
    for instant, state in zip(recording.time[::every], recording["state"][::every], strict=True):
        terms = law.model.terms(scratch, state[:nq], state[nq:])
        for name, (task, place) in followed.items():
            reference = task.rest(rest)
            if name in sources:
                contexts[name].SetTime(instant)
                reference = np.asarray(sources[name].get_output_port().Eval(contexts[name]))
            desired[name].append(reference[place : place + 3])
            found[name].append(task.rest(terms)[place : place + 3])
    return {name: np.array(desired[name]) - np.array(found[name]) for name in followed}


def summarise_tsid(recording: TsidRecording) -> dict[str, Any]:
    """Errors, torques, probabilities and faults as plain data."""
    robot = recording.law.model.robot
    largest = np.abs(recording["torque"]).max(axis=0)
    efforts = joint_limits(robot).effort
    distances = {name: np.linalg.norm(error, axis=1) for name, error in task_errors(recording).items()}
    p_ind = recording.status(Status.P_IND)
    return {
        "robot": robot.name,
        "duration": float(recording.time[-1]),
        "real_time_factor": recording.real_time_factor,
        "joints": [
            {"joint": joint, "max_torque": float(torque), "share": float(torque / effort)}
            for joint, torque, effort in zip(robot.joints, largest, efforts, strict=True)
        ],
        "tasks": [
            {"task": name, "rms_error": float(np.sqrt(np.mean(d**2))), "max_error": float(d.max())}
            for name, d in distances.items()
        ],
        "p_ind": {"median": float(np.median(p_ind)), "min": float(p_ind.min())},
        "fell": recording.fell,
        "faults": _faults(recording),
        "flags": recording.raised_flags(),
    }


def _faults(recording: TsidRecording) -> list[dict[str, Any]]:
    """Each limit that gave way, damping of a fall, or the lack of any answer: when first, for how many ticks."""
    fallback = recording.status(Status.FALLBACK) > 0.0
    which = recording.status(Status.LIMIT).astype(int)
    damped = recording.status(Status.FALLING) > START
    found = []
    if damped.any():
        first = float(recording.time[int(np.argmax(damped))])
        found.append({"name": "falling, joints damped", "first": first, "ticks": int(damped.sum())})
    fallback &= ~(damped & (which < 0))
    for limit in np.unique(which[fallback]):
        times = recording.time[fallback & (which == limit)]
        name = recording.constraints[limit] if limit >= 0 else "no answer"
        found.append({"name": name, "first": float(times[0]), "ticks": int(times.size)})
    return found


def write_tsid(
    recording: TsidRecording, folder: Path, ending: str, tell: Callable[[str], None] | None = None
) -> list[Path]:
    """Write `log.ENDING`: torques by joint, contact forces, status and state, one row a tick.

    Raises:
        LogError: a file that cannot be written.
    """
    model = recording.law.model
    columns = {"time": recording.time}
    for i, joint in enumerate(model.robot.joints):
        columns[f"{joint}/position"] = recording["state"][:, model.positions[i]]
        columns[f"{joint}/velocity"] = recording["state"][:, model.nq + model.actuated[i]]
        columns[f"{joint}/torque"] = recording["applied_torque"][:, i]
        columns[f"{joint}/torque_desired"] = recording["torque"][:, i]
    first = 0
    for contact in model.contacts:
        for axis in ("fx", "fy", "fz", "tx", "ty", "tz")[: contact.size]:
            columns[f"{contact.name}/{axis}_desired"] = recording["contact_force"][:, first]
            first += 1
    for part in Status:
        columns[f"status/{part.name.lower()}"] = recording.status(part)
    return [write_log(columns, folder / f"log.{ending}")]


def contact_wrenches(recording: TsidRecording, every: int = 1) -> FloatArray:
    """(S, K) true forces of all contacts, in their `axes` [N, N m]: what J^T f = (generalized contact forces) leaves.

    The robot touches the floor with its contacts alone, so f is exact where J has full row rank, and of least norm
    else. Contacts that the controller lifts may touch as well, so all of them count.

    Args:
        recording: Of the run.
        every: One sample in so many.
    """
    model = recording.law.model
    scratch = model.create_scratch()
    found = []
    for state, force in zip(recording["state"][::every], recording["contact"][::every], strict=True):
        terms = model.terms(scratch, state[: model.nq], state[model.nq :])
        found.append(np.linalg.lstsq(terms.contact_jacobian.T, force, rcond=None)[0])
    return np.array(found)


def contact_misses(recording: TsidRecording, every: int = 1, window: int = 1) -> FloatArray:
    """(S,) by how much the worst row of all cones is missed by the true wrenches [N, N m]; negative: none is.

    The cones are the controller's, "inner" ones where it has none. A contact counts while the scenario does not lift
    it.

    Args:
        recording: Of the run.
        every: One sample in so many.
        window: Wrenches are means of so many samples around each.
    """
    law, model = recording.law, recording.law.model
    wrenches = contact_wrenches(recording, every if window == 1 else 1)
    if window > 1:
        wrenches = uniform_filter1d(wrenches, window, axis=0, mode="nearest")[::every]
    cones = next((limit for limit in law.limits if isinstance(limit, WrenchCones)), WrenchCones(model.contacts))
    scratch, worst = model.create_scratch(), []
    carrying = _carrying(recording)[::every].tolist()
    for state, wrench, active in zip(recording["state"][::every], wrenches, carrying, strict=True):
        terms = model.terms(scratch, state[: model.nq], state[model.nq :], tuple(active))
        rows, force = cones.rows(terms), wrench[terms.contacts.entries]
        value = force if rows.matrix.force is None else rows.matrix.force @ force
        worst.append(np.maximum(rows.lower - value, value - rows.upper).max(initial=-np.inf))
    return np.array(worst)


def _carrying(recording: TsidRecording) -> BoolArray:
    """(T, contacts) which the scenario does not lift."""
    scenario, law = recording.scenario, recording.law
    source = contact_source(law.model.contacts, scenario.lifted, scenario.duration, law.period)
    context, found = source.CreateDefaultContext(), []
    for instant in recording.time:
        context.SetTime(instant)
        found.append(np.asarray(source.get_output_port().Eval(context)) > 0.5)
    return np.array(found)


def joint_misses(recording: TsidRecording) -> dict[str, FloatArray]:
    """(T,) each: by how much the worst joint misses its limit; negative: none does.

    "torque": what the joints got, against the effort limits [N m]; "position", "velocity" [rad, rad/s].

    Args:
        recording: Of the run.
    """
    model = recording.law.model
    limits = joint_limits(model.robot)
    position = recording["state"][:, model.positions]
    velocity = recording["state"][:, model.nq + model.actuated]
    return {
        "torque": (np.abs(recording["applied_torque"]) - limits.effort).max(axis=1),
        "position": np.maximum(position - limits.upper, limits.lower - position).max(axis=1),
        "velocity": (np.abs(velocity) - limits.velocity).max(axis=1),
    }


def worst_misses(recording: TsidRecording, every: int = 1, since: float = 0.1) -> dict[str, float]:
    """By how much each kind of limit was missed at worst, in its rows' unit; 0 or negative: never.

    "contact": see `contact_misses`; "torque", "position", "velocity": see `joint_misses`.

    Args:
        recording: Of the run.
        every: One sample in so many is looked at for contacts.
        since: Contacts count from here on [s]: the soles start above the floor, without load.
    """
    contact = contact_misses(recording, every)[recording.time[::every] >= since]
    joints = {name: float(missed.max()) for name, missed in joint_misses(recording).items()}
    return {"contact": float(contact.max(initial=-np.inf)), **joints}
