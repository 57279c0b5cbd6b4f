"""`design` for one joint with known loads: motions under the loads that the user has, against the best without them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.search import Progress
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.criteria import Criterion, Discrimination, Expected, Worth, expected_of
from drake_tc.experiments.design.following import tracking_warning
from drake_tc.experiments.design.goal import Goal, criterion_of
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.loads import KnownLoad, carrying, require_usable
from drake_tc.experiments.design.motions import JointLimits
from drake_tc.experiments.design.next_log import next_log
from drake_tc.experiments.design.run import TOLD, DesignOptions, JointDesign, design_joint, motion_search, with_sinusoid
from drake_tc.experiments.design.search import MotionPlan, MotionSearch
from drake_tc.experiments.fitted import FittedJoint

BEYOND = 1e4
"""Gain beyond which there is nothing to compare with."""
WORTH = 1.1
"""Gain from which on known loads are proposed."""
NOUN = "designed experiment"


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
    wide, _, by_default = with_sinusoid(joint, limits, options)
    require_usable(wide, loads, limits)
    limits.require(wide)
    joints = tuple(carrying(wide, load) for load in loads)
    criterion = criterion_of(goal, joints[0], smallest=options.criterion == "E", under=joints)
    unloaded, refusal = None, ""
    try:
        unloaded = design_joint(joint, limits, goal, options, logs, lambda text, part: progress(text, 0.5 * part))
    except ParamsError as error:
        refusal = str(error)
    search = motion_search(joints, limits, criterion, options)
    plan = search.best(
        np.random.default_rng(options.seed),
        [unloaded.x] if unloaded is not None and unloaded.basis.period == search.basis.period else [],
        starts=options.starts,
        trials=options.iterations,
        progress=lambda text, part: progress(f"{text}, with loads", 0.5 + 0.5 * part),
    )
    made = _Experiment(wide, tuple(loads), search, plan, options.seed)
    alone = None if unloaded is None else criterion.worth(next_log([unloaded.planned("alone")], options.seed))
    designed = made.worth(plan.used)
    gain = np.inf
    if alone is not None:  # several motions can be worth more than one, whatever they carry
        gain = min(designed.gain_over(each) for each in (alone, made.worth(plan.used, heavier=0.0)))
    if gain < WORTH or not any(loads[k].mass for k in plan.used):
        if unloaded is None:
            raise ParamsError(refusal)
        return replace(unloaded, sentences=(made.no_help(gain), *unloaded.sentences))
    before, default = (None if logs is None else criterion.worth(logs.alone())), criterion.worth(by_default)
    expected = expected_of(before, default, designed)
    without = () if alone is None else expected_of(before, default, alone)
    runs = tuple(
        LoadRun(
            loads[k],
            JointDesign(joints[k], goal, limits, search.basis, plan.x[k], plan, plan.slots[k] * search.repeats),
            plan.slots[k] * search.repeats * search.basis.period,
            designed.gain_over(made.worth([j for j in plan.used if j != k])),
        )
        for k in plan.used
    )
    sentences = (
        _gained(criterion, refusal, gain),
        _best_load(criterion, runs),
        *_most_changed(criterion, expected, without),
        *criterion.sentences(expected, NOUN, designed.gain_over(default)),
        *dict.fromkeys(sentence for k in plan.used for sentence in made.resonance(k)),
    )
    if isinstance(criterion, Discrimination) and expected[0].after < TOLD:
        sentences = (*sentences, made.heavier(designed))
    return LoadDesign(wide, goal, tuple(loads), runs, unloaded, refusal, gain, expected, without, sentences)


@dataclass(frozen=True, eq=False)
class _Experiment:
    """The motions of a plan under loads, of which the joint is the one without."""

    joint: DesignJoint
    loads: tuple[KnownLoad, ...]
    search: MotionSearch
    plan: MotionPlan
    seed: int

    def worth(self, used: Sequence[int], heavier: float = 1.0) -> Worth:
        """What the logs under some of the loads are worth, which then last as long as all of them."""
        search, slots = self.search, self.plan.slots
        longer = search.repeats * search.slots / max(sum(slots[k] for k in used), 1)
        times = [max(round(longer * count), 1) if k in used else 0 for k, count in enumerate(slots)]
        joints = tuple(carrying(self.joint, replace(load, mass=heavier * load.mass)) for load in self.loads)
        runs = replace(search, joints=joints).runs(list(self.plan.x), times)
        return search.criterion.worth(next_log(runs, self.seed) if runs else None)

    def resonance(self, load: int) -> tuple[str, ...]:
        """A warning where the position servo does not follow the motion with the inertia of the load."""
        search, joint = self.search, self.search.joints[load]
        inertia = joint.numbers.inertia + joint.link_inertia - self.joint.link_inertia
        heavier = replace(joint, numbers=replace(joint.numbers, inertia=inertia))
        return tracking_warning(heavier, search.limits, search.basis.motion(self.plan.x[load]), search.basis.step)

    def no_help(self, gain: float) -> str:
        """Why the design is the one without loads."""
        names = ", ".join(load.words for load in self.loads if load.mass)
        why = f"they gain {100.0 * max(gain - 1.0, 0.0):.0f} % over the best motion without loads"
        if not any(self.loads[k].mass for k in self.plan.used):
            why = "the best experiment uses none of them"
        return f"Known loads ({names}) do not help: {why}. The design is the one without loads."

    def heavier(self, designed: Worth) -> str:
        """What twice the masses would bring at the same motions, whatever torque they need."""
        factor = self.worth(self.plan.used, heavier=2.0).gain_over(designed)
        if factor < WORTH:
            return "Twice the masses would not bring the two much further apart."
        return f"Twice the masses would make the smallest distance {factor:.2g} times as large."


def _gained(criterion: Criterion, refusal: str, gain: float) -> str:
    """What the loads bring over the best motion without them."""
    if refusal:
        return f"Without known loads the goal is out of reach: {refusal}."
    if gain > BEYOND:
        return "Without known loads no motion reaches the goal."
    return f"With the known loads {criterion.quantity} is {gain:.3g} times {criterion.better} than without loads."


def _best_load(criterion: Criterion, runs: Sequence[LoadRun]) -> str:
    """Which load brings most."""
    best = max((run for run in runs if run.load.mass), key=lambda run: run.worth)
    if len(runs) == 1:
        return f"The whole experiment is under one load: {best.load.words}."
    lost = "the goal would be out of reach"
    if best.worth < BEYOND:
        lost = f"{criterion.quantity} would be {best.worth:.3g} times {criterion.worse}"
    return f"The load that brings most is {best.load.words}: without its log {lost}."


def _most_changed(criterion: Criterion, expected: Sequence[Expected], without: Sequence[Expected]) -> tuple[str, ...]:
    """Which quantity the loads change most."""
    alone, ratios = {each.name: each.after for each in without}, {}
    for each in expected:
        larger, smaller = each.after, alone.get(each.name, np.nan)
        if criterion.better == "smaller":
            larger, smaller = smaller, larger
        if smaller > 0.0 and np.isfinite(larger / smaller) and not each.name.startswith("probability"):
            ratios[each.name] = larger / smaller
    if not ratios:
        return ()
    name = max(ratios, key=lambda each: ratios[each])
    return (f"The loads change this quantity most: {name}, {ratios[name]:.3g} times {criterion.better}.",)
