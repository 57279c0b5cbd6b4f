"""`design` for one joint: from what is known to the best motion, and what it is expected to tell."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.experiments.design.criteria import Criterion, Discrimination
from drake_tc.experiments.design.expected import TOLD, Expected, expected_of, tracking_warning, what_limits, worth_of
from drake_tc.experiments.design.goal import Goal, criterion_of
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.lead import Core, default_motion, from_rest_to_rest
from drake_tc.experiments.design.motions import BasisKind, JointLimits, MotionBasis, motion_basis, scaled, whole_step
from drake_tc.experiments.design.next_log import PlannedRun, as_fitted, next_log
from drake_tc.experiments.design.robot_goal import CriterionName
from drake_tc.experiments.design.search import MotionSearch, Optimum
from drake_tc.experiments.fitted import FittedJoint
from drake_tc.types import FloatArray

Progress = Callable[[str, float], None]
PERIOD = 10.0
"""Period of the motion [s], about: the experiment holds a whole number of them."""
STEP = 0.005
"""Time between the samples of a design [s]."""
ROUGH = 0.01
"""The same of those that the solver sees [s]."""
FINE = 1e-3
"""The same of the motion with which it is compared, which is computed once [s]."""

REFIT = (
    "Pass the new run as --log and the earlier runs as --holdout. Fitted together with it, the earlier runs could bias "
    "the fit and hide the true effect."
)


BETTER_SINUSOID = (
    "No designed motion was better than the growing sinusoid, which is therefore the motion of this design."
)


@dataclass(frozen=True)
class DesignOptions:
    """How a motion is looked for.

    Attributes:
        duration: Of the experiment [s].
        basis: Functions of the motion.
        criterion: D- or E-optimality of parameters.
        starts: Of the solver. iterations: from each of them.
        seed: Of the random starts.
    """

    duration: float = 30.0
    basis: BasisKind = "fourier"
    criterion: CriterionName = "D"
    starts: int = 2
    iterations: int = 20
    seed: int = 0


@dataclass(frozen=True, eq=False)
class JointDesign:
    """The designed motion of one joint.

    Attributes:
        joint: The joint. goal: What it is for. limits: That it keeps. basis, optimum: The motion.
        repeats: Periods in the experiment.
        expected: What it is expected to bring.
        sentences: The same in words.
        contained: (truth, other, proof) of an effect that the other one contains: no motion rules that other out.
        sinusoid: (4, T) the growing sinusoid at a step of `FINE`, where no motion of the basis is better.
    """

    joint: DesignJoint
    goal: Goal
    limits: JointLimits
    basis: MotionBasis
    optimum: Optimum
    repeats: int
    expected: tuple[Expected, ...]
    sentences: tuple[str, ...]
    contained: tuple[tuple[str, str, str], ...] = ()
    sinusoid: FloatArray | None = None

    @property
    def one(self) -> tuple[FloatArray, float]:
        """(one period (4, T), or the whole sinusoid; step [s]) of the motion."""
        if self.sinusoid is not None:
            return self.sinusoid, FINE
        return self.basis.motion(self.optimum.x), self.basis.step

    def planned(self, name: str) -> PlannedRun:
        """The motion without lead-in and lead-out, as a run."""
        one, step = self.one
        return PlannedRun(name, self.joint, np.tile(one, (1, 1 if self.sinusoid is not None else self.repeats)), step)

    def motion(self, rate_hz: float) -> tuple[FloatArray, FloatArray]:
        """(time (T,), motion (4, T)) of the whole experiment at a rate [Hz]; it begins and ends at rest."""
        one, step = self.one
        core = Core(self.joint.name, self.limits, one, step, torque=self._torque)
        if self.sinusoid is None:
            one = _from_reversal(one)
            core = replace(core, motion=np.concatenate([one, one[:, :1]], axis=1), repeats=self.repeats)
        time, (motion,) = from_rest_to_rest([core], rate_hz)
        return time, motion

    def _torque(self, motion: FloatArray) -> FloatArray:
        return self.joint.motor_torque(motion, self.basis.step)


def _from_reversal(motion: FloatArray) -> FloatArray:
    """The periodic motion (4, T), begun at the reversal with the smallest acceleration."""
    turns = np.flatnonzero(np.diff(np.sign(motion[1])) != 0.0)
    if not turns.size:
        return motion
    first = int(turns[np.argmin(np.abs(motion[2, turns]))])
    return np.roll(motion, -first, axis=1)


def design_joint(
    joint: DesignJoint,
    limits: JointLimits,
    goal: Goal,
    options: DesignOptions,
    logs: FittedJoint | None = None,
    progress: Progress = lambda text, share: None,
) -> JointDesign:
    """The best motion for a goal within limits.

    Args:
        joint: What is known of the joint.
        limits: Of the motion.
        goal: What it is for.
        options: How it is looked for.
        logs: Fit of the runs so far, for comparison; None where there are none.
        progress: Told how far it is.

    Raises:
        ParamsError: Limits that no motion keeps, or a goal that no motion reaches.
    """
    limits.require_resolved(joint.slowest, joint.name)
    joint = joint_within(joint, limits)
    fill = default_motion(joint, limits, options.duration, FINE)
    by_default = next_log([PlannedRun("sinusoid", joint, fill, FINE)], options.seed)
    seen = as_fitted(joint, by_default)
    criterion = criterion_of(goal, seen, options.duration, smallest=options.criterion == "E")
    limits.require(joint.largest_load(*limits.position), joint.numbers.coulomb, joint.name)
    search = motion_search((seen,), limits, criterion, options)
    starts, repeats, basis = options.starts, search.slots, search.basis
    rng = np.random.default_rng(options.seed)
    plan = search.best(rng, starts=starts, iterations=options.iterations, progress=progress)
    made = JointDesign(joint, goal, limits, basis, plan.optimum(0, starts), repeats, (), ())
    default = worth_of(criterion, by_default)
    designed = worth_of(criterion, next_log([made.planned("designed")], options.seed))
    if designed.total < default.total:
        made, designed = replace(made, sinusoid=fill), default
    expected, sentences = expected_of(
        criterion, None if logs is None else worth_of(criterion, logs.alone()), default, designed
    )
    sentences = (*sentences, *([BETTER_SINUSOID] if made.sinusoid is not None else []))
    if isinstance(criterion, Discrimination) and expected[0].after < TOLD:
        sentences = (*sentences, what_limits(seen, limits, criterion, basis, options.seed))
    elif isinstance(criterion, Discrimination) and logs is not None:
        sentences = (*sentences, REFIT)
    sentences = (*sentences, *tracking_warning(joint, limits, *made.one))
    contained = criterion.contained if isinstance(criterion, Discrimination) else ()
    return replace(made, expected=expected, sentences=sentences, contained=contained)


def motion_search(
    joints: tuple[DesignJoint, ...], limits: JointLimits, criterion: Criterion, options: DesignOptions
) -> MotionSearch:
    """The search for the motions of a joint under each of some loads; a slot lasts about `PERIOD`."""
    slots = max(round(options.duration / PERIOD), len(joints))
    period, limit = options.duration / slots, limits.bandwidth_hz
    fine, rough = (
        scaled(motion_basis(options.basis, period, whole_step(period, step), limit), limits) for step in (STEP, ROUGH)
    )
    return MotionSearch(joints, fine, rough, limits, criterion, slots)


def joint_within(joint: DesignJoint, limits: JointLimits) -> DesignJoint:
    """The joint with the positions and speeds of a run that spans the limits.

    The effects that can be looked for, and their shapes, depend on both.
    """
    wide = replace(joint.context, position_span=limits.position, max_speed=limits.velocity)
    return replace(joint, context=wide)
