"""An experiment with known loads: its logs, what they bring, and its files.

`design` for one joint with known loads: motions under the loads that the user has, against the best without them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from drake_tc.config.quoted import json_value
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.criteria import AllEffects, Criterion, Discrimination, Parameters
from drake_tc.experiments.design.expected import TOLD, Expected, Worth, expected_of, tracking_warning, worth_of
from drake_tc.experiments.design.goal import Goal, criterion_of
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.known import MOST_LOADS, KnownLoad, carrying, declaring, hang_angle, require_usable
from drake_tc.experiments.design.lead import default_motion
from drake_tc.experiments.design.motions import JointLimits
from drake_tc.experiments.design.next_log import PlannedRun, as_fitted, next_log
from drake_tc.experiments.design.output import motion_plot, number_text, start_text, write_told, write_trajectory
from drake_tc.experiments.design.run import (
    FINE,
    DesignOptions,
    JointDesign,
    Progress,
    design_joint,
    joint_within,
    motion_search,
)
from drake_tc.experiments.design.search import MotionPlan, MotionSearch
from drake_tc.experiments.fitted import FittedJoint
from drake_tc.logs.rig import Rig, rig_document
from drake_tc.report.plain_page import PageSection, PageTable, plain_page


@dataclass(frozen=True, eq=False)
class LoadRun:
    """One log of the experiment.

    Attributes:
        load: What hangs on the joint.
        design: The motion under it.
        seconds: That its periods last.
        worth: What the load brings: the gain of the experiment over the same one without this log; 1 if nothing.
    """

    load: KnownLoad
    design: JointDesign
    seconds: float
    worth: float


@dataclass(frozen=True, eq=False)
class LoadDesign:
    """The best experiment with known loads.

    Attributes:
        joint: The joint without loads. goal: What it is for.
        loads: That the user has.
        runs: The logs, one for each load that takes part.
        unloaded: The best design without loads; None where no motion without loads reaches the goal.
        refusal: Why none does.
        gain: Factor by which the loads lengthen the distances or shorten the intervals; infinite beside a refusal.
        expected: What the experiment is worth. without: the same of the best motion without loads, where it exists.
        sentences: In words.
    """

    joint: DesignJoint
    goal: Goal
    loads: tuple[KnownLoad, ...]
    runs: tuple[LoadRun, ...]
    unloaded: JointDesign | None
    refusal: str
    gain: float
    expected: tuple[Expected, ...]
    without: tuple[Expected, ...]
    sentences: tuple[str, ...]


BEYOND = 1e4
"""Gain beyond which there is nothing to compare with."""


@dataclass(frozen=True)
class Better:
    """How a goal is told to be better reached: a larger distance, or smaller errors."""

    quantity: str
    larger: bool

    @property
    def word(self) -> str:
        """Of a better value."""
        return "larger" if self.larger else "smaller"

    @property
    def opposite(self) -> str:
        """Of a worse value."""
        return "smaller" if self.larger else "larger"

    def ratio(self, after: float, without: float) -> float:
        """By which factor a quantity is better than without loads."""
        above, below = (after, without) if self.larger else (without, after)
        return above / below if below > 0.0 else np.nan


BETTER: Mapping[type[Criterion], Better] = {
    Discrimination: Better("the smallest distance", larger=True),
    Parameters: Better("the standard error (geometric mean)", larger=False),
    AllEffects: Better("the smallest size that is found (geometric mean)", larger=False),
}


def gain_sentences(
    criterion: Criterion,
    refusal: str,
    gain: float,
    worths: Sequence[tuple[KnownLoad, float]],
    expected: Sequence[Expected],
    without: Sequence[Expected],
) -> tuple[str, ...]:
    """What the loads bring over the best motion without them, and which of them brings most.

    Args:
        criterion: Of the goal.
        refusal: Why no motion without loads reaches the goal; empty where one does.
        gain: Factor over the best motion without loads.
        worths: Each load that takes part, and the factor that is lost without its log.
        expected: What the experiment is worth.
        without: What the best motion without loads is worth.
    """
    better = BETTER[type(criterion)]
    if refusal:
        texts = [f"Without known loads the goal is out of reach: {refusal}."]
    elif gain > BEYOND:
        texts = ["Without known loads no motion reaches the goal."]
    else:
        texts = [f"With the known loads {better.quantity} is {gain:.3g} times {better.word} than without loads."]
    best, worth = max((each for each in worths if each[0].mass), key=lambda each: each[1])
    if len(worths) == 1:
        texts.append(f"The whole experiment is under one load: {best.words}.")
    else:
        lost = "the goal would be out of reach"
        if worth < BEYOND:
            lost = f"{better.quantity} would be {worth:.3g} times {better.opposite}"
        texts.append(f"The load that brings most is {best.words}: without its log {lost}.")
    alone = {each.name: each.after for each in without}
    ratios = {each.name: better.ratio(each.after, alone.get(each.name, np.nan)) for each in expected}
    ratios = {name: r for name, r in ratios.items() if np.isfinite(r) and not name.startswith("probability")}
    if ratios:
        name = max(ratios, key=lambda each: ratios[each])
        texts.append(f"The loads change this quantity most: {name}, {ratios[name]:.3g} times {better.word}.")
    return tuple(texts)


RIG_LINES = "rig_load.yaml"
LOAD_FILES = (
    *(f"trajectory_{n + 1}{end}" for n in range(MOST_LOADS) for end in (".csv", ".yaml", ".drake.yaml")),
    RIG_LINES,
)
"""Files that an experiment with known loads may have beside `output.FILES`."""


@dataclass(frozen=True, eq=False)
class LoadExperiment:
    """An experiment with known loads on a joint of a rig.

    Attributes:
        joint: The joint. rig: Of the logs so far. design: The experiment.
    """

    joint: str
    rig: Rig
    design: LoadDesign

    def write(self, folder: Path, rate_hz: float) -> None:
        """Every file."""
        write_told(folder, self.json(), self.page())
        for name, run in self._named():
            time, motion = run.design.motion(rate_hz)
            load = {f"{self.joint}/load_mass": run.load.mass, f"{self.joint}/load_arm": run.load.arm}
            write_trajectory(folder, name, time, {self.joint: motion}, load)
            if run is self.design.runs[0]:
                write_trajectory(folder, "trajectory", time, {self.joint: motion})
        lines = self.rig_lines()
        if lines:
            (folder / RIG_LINES).write_text(lines, encoding="utf-8")

    def rig_entry(self) -> Any:
        """What the rig file says under `load`, with the masses of the new logs; None where it stays as it is."""
        rig = declaring(self.rig, self.joint, [(f"{name}*", run.load) for name, run in self._named()])
        return None if rig is None else rig_document(rig)["load"]

    def rig_lines(self) -> str:
        """The same as text; empty where the rig file stays as it is."""
        entry = self.rig_entry()
        if entry is None:
            return ""
        text = str(yaml.safe_dump(entry, sort_keys=False, allow_unicode=True, default_flow_style=True, width=10**9))
        return f"# Replaces the key `load` of the rig file; the first pattern that fits a log counts.\nload: {text}"

    def _named(self) -> list[tuple[str, LoadRun]]:
        return [(f"trajectory_{number + 1}", run) for number, run in enumerate(self.design.runs)]

    def json(self) -> dict[str, Any]:
        """The experiment as plain data."""
        design = self.design
        runs = [
            {
                "file": f"{name}.csv",
                "mass": run.load.mass,
                "arm": run.load.arm,
                "seconds": run.seconds,
                "period": run.design.basis.period,
                "repeats": run.design.repeats,
                "parameters": [float(x) for x in run.design.optimum.x],
                "largest_load_torque": self._largest(run),
                "gain_lost_without": run.worth,
            }
            for name, run in self._named()
        ]
        entry = {
            "goal": design.goal.text,
            "limits": asdict(design.runs[0].design.limits),
            "basis": design.runs[0].design.basis.kind,
            "runs": runs,
            "loads": {
                "given": [asdict(load) for load in design.loads],
                "gain": design.gain,
                "without_loads": design.refusal,
            },
            "expected": [asdict(each) for each in design.expected],
            "expected_without_loads": [asdict(each) for each in design.without],
            "sentences": [*design.sentences, *self.how()],
            "rig": {"load": self.rig_entry()} if self.rig_entry() is not None else {},
        }
        made: dict[str, Any] = json_value({"name": "design", "schema": 1, "joints": {self.joint: entry}})
        return made

    @staticmethod
    def _largest(run: LoadRun) -> float:
        return run.design.joint.largest_load(*run.design.limits.position)

    def how(self) -> tuple[str, ...]:
        """How the logs are recorded and what the rig file says of them."""
        logs = "; ".join(f"{name}.csv with {run.load.words}" for name, run in self._named())
        parts = [f"Record one log for each load: {logs}."]
        angles = {hang_angle(self.design.joint, run.load) for run in self.design.runs if run.load.arm}
        if angles:
            where = " or ".join(f"{angle:.3g} rad" for angle in sorted(angles))
            parts.append(
                f"The design assumes that an added mass hangs straight down at the position {where}. If it does not, "
                "give the position [rad] as MASS@ARM@ANGLE."
            )
        if self.rig_entry() is None:
            parts.append("The rig file stays as it is: the torque column of each log contains its load.")
        else:
            parts.append(
                f"Name each log as its trajectory, and put the lines of {RIG_LINES} into the rig file in place of the "
                "key load."
            )
        if len(self.design.runs) == 1:
            parts.append("Give the new log as --log and an earlier one as --holdout.")
        else:
            parts.append(
                "Give all the new logs as --log and an earlier one as --holdout: each of them alone does not tell what "
                "all of them together do."
            )
        return tuple(parts)

    def lines(self) -> list[str]:
        """The same as lines of text for a console."""
        out = [f"{self.joint}: goal {self.design.goal.text}"]
        out += [f"  {sentence}" for sentence in (*self.design.sentences, *self.how())]
        out += [f"  {name}: {', '.join(words[:3])}" for name, *words in self._run_rows()]
        return out + [f"  {line}" for line in self.rig_lines().splitlines()]

    def _run_rows(self) -> list[tuple[str, str, str, str, str]]:
        torque = self.design.runs[0].design.limits.units.text("N m")
        return [
            (
                f"{name}.csv",
                run.load.words,
                f"{run.seconds:.3g} s",
                f"{self._largest(run):.3g} {torque} at rest",
                "–" if run.worth > BEYOND else f"{run.worth:.3g}",
            )
            for name, run in self._named()
        ]

    def page(self) -> str:
        """The page: the loads, what they are good for, and the motion under each."""
        design = self.design
        kinds = ("logs so far", "growing sinusoid", "best motion without loads", "with known loads")
        unloaded = {e.name: e.after for e in design.without}
        rows = [
            (
                e.name,
                e.unit.removesuffix("-"),
                *map(number_text, (e.before, e.default, unloaded.get(e.name, float("nan")), e.after)),
            )
            for e in design.expected
        ]
        loads = PageTable(("log", "load", "length", "load torque", "gain lost without this log"), self._run_rows(), ())
        lines = self.rig_lines()
        tables = [PageTable(("quantity", "unit", *kinds), rows, kinds), loads]
        if lines:
            tables.append(PageTable((f"rig file ({RIG_LINES})",), [(line,) for line in lines.splitlines()]))
        sections = [
            PageSection(self.joint, (*design.sentences, *self.how()), tables=tables, aside=f"goal {design.goal.text}")
        ]
        sections += [
            PageSection(
                f"{name}.csv: {run.load.words}",
                (start_text(run.design),),
                plots=(motion_plot(run.design, f"m{number}"),),
            )
            for number, (name, run) in enumerate(self._named())
        ]
        return plain_page("The next experiment", "design", (), sections)


WORTH = 1.1
"""Gain from which on known loads are proposed."""
NOUN = "designed experiment"
ITERATIONS = 10
"""Most iterations of the solver for each load."""


def design_with_loads(
    joint: DesignJoint,
    limits: JointLimits,
    goal: Goal,
    options: DesignOptions,
    loads: Sequence[KnownLoad],
    logs: FittedJoint | None = None,
    progress: Progress = lambda text, share: None,
) -> LoadDesign | JointDesign:
    """The best experiment under known loads, and what it gains; the design without loads where they do not help.

    Args:
        joint: What is known of the joint.
        limits: Of every motion.
        goal: What it is for.
        options: How it is looked for; the duration is that of all logs together.
        loads: That the user has.
        logs: Fit of the runs so far, for comparison; None where there are none.
        progress: Told how far it is.

    Raises:
        ParamsError: Limits that no motion keeps, a load that the limits do not let the joint hold, or a goal that is
            out of reach with these loads too.
    """
    require_usable(joint_within(joint, limits), loads, limits)
    limits.require(joint.largest_load(*limits.position), joint.numbers.coulomb, joint.name)
    logged, joint = joint, joint_within(joint, limits)
    fill = default_motion(joint, limits, options.duration, FINE)
    by_default = next_log([PlannedRun("sinusoid", joint, fill, FINE)], options.seed)
    joints = tuple(carrying(as_fitted(joint, by_default), load) for load in loads)
    criterion = criterion_of(goal, joints[0], options.duration, smallest=options.criterion == "E", under=joints)
    unloaded, refusal = _unloaded(logged, limits, goal, options, logs, lambda text, part: progress(text, 0.5 * part))
    search = motion_search(joints, limits, criterion, options)
    same = unloaded is not None and unloaded.basis.period == search.basis.period
    plan = search.best(
        np.random.default_rng(options.seed),
        [unloaded.optimum.x] if unloaded is not None and same else [],
        iterations=min(options.iterations, ITERATIONS),
        progress=lambda text, part: progress(f"{text}, with loads", 0.5 + 0.5 * part),
    )
    alone = None if unloaded is None else worth_of(criterion, next_log([unloaded.planned("alone")], options.seed))
    found = _Found(joint, limits, goal, tuple(loads), search, plan, unloaded, refusal, alone, options.seed)
    before = None if logs is None else worth_of(criterion, logs.alone())
    return _told(found, before, worth_of(criterion, by_default))


@dataclass(frozen=True, eq=False)
class _Found:
    """What is known when the search has ended; `alone`: what the best design without loads is worth."""

    joint: DesignJoint
    limits: JointLimits
    goal: Goal
    loads: tuple[KnownLoad, ...]
    search: MotionSearch
    plan: MotionPlan
    unloaded: JointDesign | None
    refusal: str
    alone: Worth | None
    seed: int

    def worth(self, used: Sequence[int], heavier: float = 1.0) -> Worth:
        """What the logs under some of the loads are worth, which then last as long as all of them."""
        search, slots = self.search, self.plan.slots
        longer = search.slots / max(sum(slots[k] for k in used), 1)
        runs = []
        for k in used:
            joint = carrying(self.joint, replace(self.loads[k], mass=heavier * self.loads[k].mass))
            motion = np.tile(search.basis.motion(self.plan.x[k]), (1, max(round(longer * slots[k]), 1)))
            runs.append(PlannedRun(f"load_{k}", joint, motion, search.basis.step))
        return worth_of(search.criterion, next_log(runs, self.seed) if runs else None)


def _unloaded(
    joint: DesignJoint,
    limits: JointLimits,
    goal: Goal,
    options: DesignOptions,
    logs: FittedJoint | None,
    progress: Progress,
) -> tuple[JointDesign | None, str]:
    """The best design without loads, or why there is none."""
    try:
        return design_joint(joint, limits, goal, options, logs, progress), ""
    except ParamsError as error:
        return None, str(error)


def _told(found: _Found, before: Worth | None, default: Worth) -> LoadDesign | JointDesign:
    criterion, used, alone = found.search.criterion, found.plan.used, found.alone
    designed = found.worth(used)
    gain = np.inf if alone is None else designed.gain_over(alone)
    if gain < WORTH or not any(found.loads[k].mass for k in used):
        return _without_loads(found, gain)
    expected, sentences = expected_of(criterion, before, default, designed, NOUN)
    without = () if alone is None else expected_of(criterion, before, default, alone)[0]
    worths = {k: designed.gain_over(found.worth([j for j in used if j != k])) for k in used}
    told = [(found.loads[k], worth) for k, worth in worths.items()]
    warned = [sentence for k in used for sentence in _resonance(found, k)]
    sentences = (
        *gain_sentences(criterion, found.refusal, gain, told, expected, without),
        *sentences,
        *dict.fromkeys(warned),
    )
    if isinstance(criterion, Discrimination) and expected[0].after < TOLD:
        sentences = (*sentences, _heavier(found, designed))
    return LoadDesign(
        found.joint,
        found.goal,
        found.loads,
        tuple(_run_of(found, k, worth) for k, worth in worths.items()),
        found.unloaded,
        found.refusal,
        gain,
        expected,
        without,
        sentences,
    )


def _resonance(found: _Found, load: int) -> tuple[str, ...]:
    """A warning where the position servo does not follow the motion with the inertia of the load."""
    search, joint = found.search, found.search.joints[load]
    inertia = joint.numbers.inertia + joint.link_inertia - found.joint.link_inertia
    heavier = replace(joint, numbers=replace(joint.numbers, inertia=inertia))
    motion = search.basis.motion(found.plan.x[load])
    return tracking_warning(heavier, found.limits, motion, search.basis.step)


def _run_of(found: _Found, load: int, worth: float) -> LoadRun:
    search, plan = found.search, found.plan
    optimum = plan.optimum(load, len(plan.used))
    slots = plan.slots[load]
    made = JointDesign(search.joints[load], found.goal, found.limits, search.basis, optimum, slots, (), ())
    return LoadRun(found.loads[load], made, slots * search.basis.period, worth)


def _without_loads(found: _Found, gain: float) -> JointDesign:
    """The design without loads, with a line that says why.

    Raises:
        ParamsError: There is none: no motion reaches the goal, with these loads or without them.
    """
    if found.unloaded is None:
        raise ParamsError(found.refusal)
    names = ", ".join(load.words for load in found.loads if load.mass)
    why = f"they gain {100.0 * max(gain - 1.0, 0.0):.0f} % over the best motion without loads"
    if not any(found.loads[k].mass for k in found.plan.used):
        why = "the best experiment uses none of them"
    text = f"Known loads ({names}) do not help: {why}. The design is the one without loads."
    return replace(found.unloaded, sentences=(text, *found.unloaded.sentences))


def _heavier(found: _Found, designed: Worth) -> str:
    """What twice the masses would bring at the same motions, whatever torque they need."""
    factor = found.worth(found.plan.used, heavier=2.0).gain_over(designed)
    if factor < WORTH:
        return "Twice the masses would not bring the two much further apart."
    return f"Twice the masses would make the smallest distance {factor:.2g} times as large."
