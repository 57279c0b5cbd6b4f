"""`design` for one joint with known loads: motions under the loads that the user has, against the best without them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.basis import MotionBasis, motion_basis, scaled, whole_step
from drake_tc.experiments.design.criteria import Criterion, Parameters
from drake_tc.experiments.design.default_motion import default_motion
from drake_tc.experiments.design.discrimination import Discrimination
from drake_tc.experiments.design.expected import TOLD, expected_of
from drake_tc.experiments.design.goal import Goal, criterion_of
from drake_tc.experiments.design.joint import BalanceColumns, DesignJoint, LogColumns, MotionColumns
from drake_tc.experiments.design.known_loads import KnownLoad, carrying, require_usable
from drake_tc.experiments.design.limits import JointLimits
from drake_tc.experiments.design.load_result import LoadDesign, LoadRun
from drake_tc.experiments.design.load_search import LoadPlan, LoadSearch
from drake_tc.experiments.design.load_sentences import gain_sentences
from drake_tc.experiments.design.noise import measured_as, measured_together
from drake_tc.experiments.design.run import (
    FINE,
    PERIOD,
    STEP,
    DesignOptions,
    JointDesign,
    Progress,
    design_joint,
    joint_within,
)
from drake_tc.experiments.design.solve import Optimum
from drake_tc.experiments.design.stacked import StackedColumns
from drake_tc.experiments.design.tracking import tracking_warning
from drake_tc.types import FloatArray

WORTH = 1.1
"""Gain from which on known loads are proposed."""
NOUN = "designed experiment"
ROUGH = 0.01
"""Time between the samples that the solver sees [s]."""
ITERATIONS = 10
"""Most iterations of the solver for each load."""


def design_with_loads(
    joint: DesignJoint,
    limits: JointLimits,
    goal: Goal,
    options: DesignOptions,
    loads: Sequence[KnownLoad],
    logs: Prepared | None = None,
    progress: Progress = lambda text, share: None,
) -> LoadDesign | JointDesign:
    """The best experiment under known loads, and what it gains; the design without loads where they do not help.

    Args:
        joint: What is known of the joint.
        limits: Of every motion.
        goal: What it is for.
        options: How it is looked for; the duration is that of all logs together.
        loads: That the user has.
        logs: The runs so far, for comparison; None where there are none.
        progress: Told how far it is.

    Raises:
        ParamsError: Limits that no motion keeps, a load that the limits do not let the joint hold, or a goal that is
            out of reach with these loads too.
    """
    require_usable(joint_within(joint, limits), loads, limits)
    limits.require(joint.largest_load(*limits.position), joint.numbers.coulomb, joint.name)
    logged, joint = joint, joint_within(joint, limits)
    joints = tuple(carrying(joint, load) for load in loads)
    fills = [default_motion(each, limits, options.duration, FINE) for each in joints]
    if goal.kind != "all":
        joints = measured_together(joints, fills, FINE)
    criterion = criterion_of(goal, joints[0], options.duration, smallest=options.smallest, under=joints)
    unloaded, refusal = _unloaded(logged, limits, goal, options, logs, lambda text, part: progress(text, 0.5 * part))
    search, alone = _search(joints, limits, criterion, options), None
    known: list[FloatArray] = []
    if unloaded is not None:
        fill = default_motion(joint, limits, options.duration, FINE)
        base = measured_as(joint, fill, FINE) if goal.kind != "all" else joint
        single = _search((base,), limits, criterion, options)
        plan = _best(single, [unloaded.optimum.x], options, lambda text, part: progress(text, 0.5 + 0.2 * part))
        alone = single.basis, plan.x[0]
        known = [plan.x[0]] if single.basis.period == search.basis.period else []
    plan = _best(search, known, options, lambda text, part: progress(f"{text}, with loads", 0.7 + 0.3 * part))
    return _told(_Found(logged, joint, limits, goal, tuple(loads), search, plan, unloaded, refusal, alone), logs)


def _best(search: LoadSearch, known: Sequence[FloatArray], options: DesignOptions, progress: Progress) -> LoadPlan:
    iterations = min(options.iterations, ITERATIONS)
    return search.best(np.random.default_rng(options.seed), known, iterations, progress)


@dataclass(frozen=True, eq=False)
class _Found:
    """What is known when the search has ended.

    Attributes:
        alone: Functions and parameters of the best motion without loads by the criterion of the search, which
            begins with that of `unloaded`; None where there is none.
    """

    logged: DesignJoint
    joint: DesignJoint
    limits: JointLimits
    goal: Goal
    loads: tuple[KnownLoad, ...]
    search: LoadSearch
    plan: LoadPlan
    unloaded: JointDesign | None
    refusal: str
    alone: tuple[MotionBasis, FloatArray] | None

    def designed(self) -> list[MotionColumns]:
        """Rows of each log, with the noise that they have together."""
        search, used = self.search, self.plan.used
        motions = [search.basis.motion(self.plan.x[k]) for k in used]
        joints = [search.joints[k] for k in used]
        if self.goal.kind != "all":
            joints = list(measured_together(joints, motions, search.basis.step))
        return [MotionColumns(j, m, search.basis.step, sharp=True) for j, m in zip(joints, motions, strict=True)]

    def without(self) -> BalanceColumns | None:
        """Rows of the best motion without loads."""
        if self.alone is None:
            return None
        basis, x = self.alone
        motion = basis.motion(x)
        own = measured_as(self.joint, motion, basis.step) if self.goal.kind != "all" else self.joint
        return MotionColumns(own, motion, basis.step, sharp=True)

    def default(self) -> BalanceColumns:
        """Rows of a growing sinusoid without loads."""
        fill = default_motion(self.joint, self.limits, self.search.criterion.duration, FINE)
        own = measured_as(self.joint, fill, FINE) if self.goal.kind != "all" else self.joint
        return MotionColumns(own, fill, FINE, periodic=False, sharp=True)

    def gain(self, better: float, worse: float) -> float:
        """Factor between the standard errors, or the distances, of two values of the criterion."""
        criterion = self.search.criterion
        many = 1
        if isinstance(criterion, Parameters) and not criterion.smallest:
            many = len(criterion.names)
        power = 0.5 * (better - worse) / many
        return float(np.exp(power)) if power < 100.0 else float("inf")


def _unloaded(
    joint: DesignJoint,
    limits: JointLimits,
    goal: Goal,
    options: DesignOptions,
    logs: Prepared | None,
    progress: Progress,
) -> tuple[JointDesign | None, str]:
    """The best design without loads, or why there is none."""
    try:
        return design_joint(joint, limits, goal, options, logs, progress), ""
    except ParamsError as error:
        return None, str(error)


def _search(
    joints: tuple[DesignJoint, ...], limits: JointLimits, criterion: Criterion, options: DesignOptions
) -> LoadSearch:
    slots = max(round(options.duration / PERIOD), len(joints))
    period, limit = options.duration / slots, limits.bandwidth_hz
    fine, rough = (
        scaled(motion_basis(options.basis, period, whole_step(period, step), limit), limits) for step in (STEP, ROUGH)
    )
    return LoadSearch(joints, fine, rough, limits, criterion, slots)


def _told(found: _Found, logs: Prepared | None) -> LoadDesign | JointDesign:
    search, plan, used = found.search, found.plan, found.plan.used
    parts, alone, default = found.designed(), found.without(), found.default()
    shares = [plan.slots[k] / search.slots for k in used]
    designed = StackedColumns(parts, shares)
    value = search.criterion.value(designed)
    gain = np.inf if alone is None else found.gain(value, search.criterion.value(alone))
    if gain < WORTH or not any(found.loads[k].mass for k in used):
        return _without_loads(found, gain)
    before = None if logs is None else LogColumns(found.logged, logs.train)
    expected, sentences = expected_of(search.criterion, before, default, designed, NOUN)
    without = () if alone is None else expected_of(search.criterion, before, default, alone)[0]
    runs, worths = [], []
    for number, k in enumerate(used):
        rest = [j for j in range(len(used)) if j != number]
        worth = found.gain(value, _value_of(search.criterion, [parts[j] for j in rest], [shares[j] for j in rest]))
        runs.append(_run_of(found, k, worth))
        worths.append((found.loads[k], worth))
    sentences = (*gain_sentences(search.criterion, found.refusal, gain, worths, expected, without), *sentences)
    warned = [sentence for k in used for sentence in _resonance(found, k)]
    sentences = (*sentences, *dict.fromkeys(warned))
    if isinstance(search.criterion, Discrimination) and expected[0].after < TOLD:
        sentences = (*sentences, _heavier(found, parts, value))
    return LoadDesign(
        found.joint,
        found.goal,
        found.loads,
        tuple(runs),
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


def _value_of(criterion: Criterion, parts: Sequence[BalanceColumns], shares: Sequence[float]) -> float:
    """Of some of the logs alone, which then last as long as all of them; minus infinity of none."""
    if not parts:
        return -np.inf
    return criterion.value(StackedColumns(parts, [share / sum(shares) for share in shares]))


def _run_of(found: _Found, load: int, worth: float) -> LoadRun:
    search, plan = found.search, found.plan
    optimum = Optimum(plan.x[load], plan.value, plan.start_value, plan.solver, len(plan.used), plan.solved)
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


def _heavier(found: _Found, parts: Sequence[MotionColumns], value: float) -> str:
    """What twice the masses would bring at the same motions, whatever torque they need."""
    search, used = found.search, found.plan.used
    doubled = [
        MotionColumns(carrying(part.joint, found.loads[k]), search.basis.motion(found.plan.x[k]), part.step, sharp=True)
        for part, k in zip(parts, used, strict=True)
    ]
    heavier = search.criterion.value(StackedColumns(doubled, [found.plan.slots[k] / search.slots for k in used]))
    factor = found.gain(heavier, value)
    if factor < WORTH:
        return "Twice the masses would not bring the two much further apart."
    return f"Twice the masses would make the smallest distance {factor:.2g} times as large."
