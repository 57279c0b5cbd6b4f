"""`design` for one joint: from what is known to the best motion, and what it is expected to tell."""

from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.search import Progress
from drake_tc.experiments.design.criteria import Criterion, Discrimination, Expected, expected_of
from drake_tc.experiments.design.following import tracking_warning, what_limits
from drake_tc.experiments.design.goal import Goal, criterion_of
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.lead import Experiment, default_motion
from drake_tc.experiments.design.motions import BasisKind, JointLimits, MotionBasis, motion_basis, whole_step
from drake_tc.experiments.design.next_log import PlannedRun, next_log
from drake_tc.experiments.design.robot_goal import CriterionName
from drake_tc.experiments.design.search import MotionPlan, MotionSearch
from drake_tc.experiments.fitted import FittedJoint
from drake_tc.types import FloatArray

PERIOD = 10.0
"""Period of the motion [s], about: the experiment holds a whole number of them."""
STEP = 0.005
"""Time between the samples of a design [s]."""
FINE = 1e-3
"""The same of the motion with which it is compared, which is computed once [s]."""
MOST_SLOTS = 6
"""Parts of the time that several loads share."""
TOLD = 0.8
"""Probability of separating a pair of effects, below which the page says which limit prevents it."""
NOUN = "designed motion"

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
        starts: Of the search. iterations: motions that it tries after the candidates.
        seed: Of all that is drawn.
    """

    duration: float = 30.0
    basis: BasisKind = "fourier"
    criterion: CriterionName = "D"
    starts: int = 2
    iterations: int = 100
    seed: int = 0


@dataclass(frozen=True, eq=False)
class JointDesign:
    """The designed motion of one joint.

    Attributes:
        joint: The joint. goal: What it is for. limits: That it keeps.
        basis, x: The motion. plan: What the search found.
        repeats: Periods in the experiment.
        expected: What it is expected to bring.
        sentences: The same in words.
        sinusoid: (4, T) the growing sinusoid at a step of `FINE`, where no motion of the basis is better.
    """

    joint: DesignJoint
    goal: Goal
    limits: JointLimits
    basis: MotionBasis
    x: FloatArray
    plan: MotionPlan
    repeats: int
    expected: tuple[Expected, ...] = ()
    sentences: tuple[str, ...] = ()
    sinusoid: FloatArray | None = None

    @property
    def one(self) -> tuple[FloatArray, float]:
        """(one period (4, T), or the whole sinusoid; step [s]) of the motion."""
        if self.sinusoid is not None:
            return self.sinusoid, FINE
        return self.basis.motion(self.x), self.basis.step

    def planned(self, name: str) -> PlannedRun:
        """The motion without lead-in and lead-out, as a run."""
        one, step = self.one
        return PlannedRun(name, self.joint, np.tile(one, (1, 1 if self.sinusoid is not None else self.repeats)), step)

    def motion(self, rate_hz: float) -> tuple[FloatArray, FloatArray]:
        """(time (T,), motion (4, T)) of the whole experiment at a rate [Hz]; it begins and ends at rest."""
        one, step = self.one
        periods = 0 if self.sinusoid is not None else self.repeats
        one = _from_reversal(one) if periods else one
        made = Experiment((self.joint.name,), (self.limits,), one[:, :, None], step, periods, self._torque)
        time, motions = made.sampled(rate_hz)
        return time, motions[self.joint.name]

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
    limits.require_resolved(joint)
    joint, fill, by_default = with_sinusoid(joint, limits, options)
    criterion = criterion_of(goal, joint, smallest=options.criterion == "E")
    limits.require(joint)
    search, rng = motion_search((joint,), limits, criterion, options), np.random.default_rng(options.seed)
    plan = search.best(rng, starts=options.starts, trials=options.iterations, progress=progress)
    made = JointDesign(joint, goal, limits, search.basis, plan.x[0], plan, search.repeats)
    default, designed = (
        criterion.worth(log) for log in (by_default, next_log([made.planned("designed")], options.seed))
    )
    if designed.total < default.total:
        made, designed = replace(made, sinusoid=fill), default
    expected = expected_of(None if logs is None else criterion.worth(logs.alone()), default, designed)
    sentences = [*criterion.sentences(expected, NOUN, designed.gain_over(default))]
    sentences += [BETTER_SINUSOID] if made.sinusoid is not None else []
    if isinstance(criterion, Discrimination):
        if expected[0].after < TOLD:
            sentences.append(what_limits(search, options.seed))
        elif logs is not None:
            sentences.append(REFIT)
    sentences += tracking_warning(joint, limits, *made.one)
    return replace(made, expected=expected, sentences=tuple(sentences))


def with_sinusoid(
    joint: DesignJoint, limits: JointLimits, options: DesignOptions
) -> tuple[DesignJoint, FloatArray, FittedJoint | None]:
    """(joint within the limits, (4, T) growing sinusoid, its log).

    The joint has the positions and speeds of a run that spans the limits: the effects that can be looked for, and their
    shapes, depend on both.
    """
    wide = replace(joint.context, position_span=limits.position, max_speed=limits.velocity)
    joint = replace(joint, context=wide)
    fill = default_motion(joint, limits, options.duration, FINE)
    return joint, fill, next_log([PlannedRun("sinusoid", joint, fill, FINE)], options.seed)


def motion_search(
    joints: tuple[DesignJoint, ...], limits: JointLimits, criterion: Criterion, options: DesignOptions
) -> MotionSearch:
    """The search for the motions of a joint under each of some loads; a period lasts about `PERIOD`."""
    periods = max(round(options.duration / PERIOD), 1)
    slots = 1 if len(joints) == 1 else max(min(periods, MOST_SLOTS), len(joints))
    repeats = max(round(periods / slots), 1)
    period = options.duration / (slots * repeats)
    basis = motion_basis(options.basis, period, whole_step(period, STEP), limits)
    return MotionSearch(joints, basis, limits, criterion, slots, repeats, options.seed)
