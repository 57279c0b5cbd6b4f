"""`design` for one joint with known loads: motions under the loads that the user has, against the best without them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.experiments.design.advice import tracking_warning
from drake_tc.experiments.design.criteria import Discrimination
from drake_tc.experiments.design.expected import TOLD, Worth, expected_of, worth_of
from drake_tc.experiments.design.goal import Goal, criterion_of
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.known_loads import KnownLoad, carrying, require_usable
from drake_tc.experiments.design.lead import default_motion
from drake_tc.experiments.design.limits import JointLimits
from drake_tc.experiments.design.load_output import LoadDesign, LoadRun, gain_sentences
from drake_tc.experiments.design.next_log import PlannedRun, as_fitted, next_log
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
    criterion = criterion_of(goal, joints[0], options.duration, smallest=options.smallest, under=joints)
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
