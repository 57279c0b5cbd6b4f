"""The motions of an experiment: of the joint as it is, or under known loads, each with its own motion and time.

The experiment has N equal slots of time. Load k takes n_k of them, in which it repeats its own motion x_k, and

    max_{n, x} f(posterior of the rows of all loads),   n_k >= 0, sum n_k = N

for a criterion f of the log of the whole experiment, since a diagnosis fits all logs of a joint with one model. The
search begins with candidates (random motions, sinusoids, slow passes over the whole range in both directions). Under
several loads it exchanges them load by load, and then tries every split of the slots. From the best points,

    x' = x + s m o n,   n ~ N(0, I),   m: a few random functions

within the limits is kept where the criterion is larger; s grows by half after a success and shrinks after a failure, so
that about one trial in five succeeds (Rechenberg, 1973). A step that has become too small begins anew. All this is done
with rough logs. Of the best candidates and of what became of them, the simulated logs tell the best.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from drake_tc.config.joint_units import TORQUE
from drake_tc.diagnosis.search import Progress
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.criteria import Criterion, Worth
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.motions import JointLimits, MotionBasis, shrunk
from drake_tc.experiments.design.next_log import PlannedRun, next_log, rough_log
from drake_tc.types import FloatArray

MARGIN = 0.01
"""Share by which the limits are narrowed, for what the motion does between two samples."""
RANDOM_STARTS = 16
"""Random motions among which the best are taken as starts."""
SHARES = (1.0, 0.3, 0.1)
"""Sizes of single waves among the starts, over what the limits allow: effects of small speeds need slow motions."""
PASSES = (1.0, 0.5)
"""Shares of the position range that slow passes cover."""
FIRST_STEP, LEAST_STEP = 0.1, 1e-3
"""Steps s, over the amplitude that the limits allow each function alone."""
GROWTH = 1.5
CHANGED = 3
"""Functions of each motion that are changed together, on average: a change of many breaks a limit somewhere."""


@dataclass(frozen=True, eq=False)
class MotionPlan:
    """The motions of an experiment, the joint as it is being one load.

    Attributes:
        x: (loads, n) parameters of the motion under each load.
        slots: By load, the slots of time that it takes; 0 for one that is not used.
        value: Of the criterion; in the end on a simulated log. start_value: of the best plan of candidates.
        starts: Points from which the search began.
    """

    x: FloatArray
    slots: tuple[int, ...]
    value: float
    start_value: float
    starts: int = 0

    @property
    def used(self) -> tuple[int, ...]:
        """Numbers of the loads that take part."""
        return tuple(k for k, count in enumerate(self.slots) if count)


@dataclass(frozen=True, eq=False)
class MotionSearch:
    """What a plan is looked for with.

    Attributes:
        joints: The joint under each load.
        basis: Of every motion; its period is one slot, or a whole part of it.
        limits: That every motion keeps.
        criterion: Of the whole log.
        slots: N. repeats: periods in a slot.
        seed: Of the noise of simulated logs.
    """

    joints: tuple[DesignJoint, ...]
    basis: MotionBasis
    limits: JointLimits
    criterion: Criterion
    slots: int
    repeats: int = 1
    seed: int = 0

    def worth(self, x: Sequence[FloatArray], slots: Sequence[int]) -> Worth:
        """What the rough log of motions (n,) under each load is worth with so many slots of each load."""
        return self.criterion.worth(rough_log(self.runs(x, slots), self.repeats))

    def runs(self, x: Sequence[FloatArray], times: Sequence[int]) -> list[PlannedRun]:
        """Those of the loads that take part, with so many periods of each."""
        return [
            PlannedRun(f"load_{k}", joint, np.tile(self.basis.motion(own), (1, count)), self.basis.step)
            for k, (joint, own, count) in enumerate(zip(self.joints, x, times, strict=True))
            if count
        ]

    def _simulated(self, plan: MotionPlan) -> float:
        """The criterion on the simulated log of a plan."""
        runs = self.runs(list(plan.x), [self.repeats * count for count in plan.slots])
        return self.criterion.worth(next_log(runs, self.seed)).total

    def best(
        self,
        rng: np.random.Generator,
        known: Sequence[FloatArray] = (),
        *,
        starts: int = 1,
        trials: int,
        progress: Progress = lambda text, share: None,
    ) -> MotionPlan:
        """The best plan.

        Args:
            rng: Of the random motions.
            known: Motions (n,) that are candidates under every load.
            starts: Candidates of a single motion, or plans, from which the search begins; at least 1.
            trials: Motions that are tried in all: half of them from each start, the others from the best.
            progress: Told how far it is.

        Raises:
            ParamsError: No motion under one of the loads keeps the limits.
        """
        tight = self.limits.with_margin(MARGIN)
        tried = [candidates(joint, self.basis, tight, rng, known) for joint in self.joints]
        plans = self._first(tried, progress)[:starts]
        begun, short = [], trials // (2 * len(plans)) if starts > 1 else 0
        for number, plan in enumerate(plans):
            progress(f"start {number + 1} of {len(plans)}", 0.3 + 0.35 * number / len(plans))
            begun.append(self._refined(plan, tight, rng, short))
        progress("the best start", 0.65)
        most = max(begun, key=lambda plan: plan.value)
        found = [*plans, self._split(self._refined(most, tight, rng, trials - short * len(plans)))]
        values = [self._simulated(plan) for plan in found]
        best = int(np.argmax(values))
        return replace(found[best], value=values[best], start_value=values[0], starts=len(plans))

    def _first(self, tried: Sequence[Sequence[FloatArray]], progress: Progress) -> list[MotionPlan]:
        """Plans of candidates, the best first; under several loads these are exchanged load by load."""
        even = tuple(self.slots // len(tried) + (k < self.slots % len(tried)) for k in range(len(tried)))
        plans, chosen = [], [xs[-1] for xs in tried]
        for k, xs in enumerate(tried):
            together = [self._plan([*chosen[:k], x, *chosen[k + 1 :]], even) for x in xs]
            chosen[k] = max(together, key=lambda plan: plan.value).x[k]
            plans += together
            progress("candidates", 0.3 * (k + 1) / len(tried))
        plans.append(self._split(max(plans, key=lambda plan: plan.value)))
        distinct = {plan.value: plan for plan in plans}
        return [distinct[value] for value in sorted(distinct, reverse=True)]

    def _plan(self, x: Sequence[FloatArray], slots: tuple[int, ...]) -> MotionPlan:
        value = self.worth(x, slots).total
        return MotionPlan(np.stack(x), slots, value, value)

    def _split(self, plan: MotionPlan) -> MotionPlan:
        """The plan with the best split of the time among the loads."""
        if len(self.joints) == 1:
            return plan
        each = (self._plan(list(plan.x), slots) for slots in splits(self.slots, len(self.joints)))
        return max((plan, *each), key=lambda other: other.value)

    def _refined(self, plan: MotionPlan, tight: JointLimits, rng: np.random.Generator, trials: int) -> MotionPlan:
        """The plan with better motions."""
        step, share = FIRST_STEP, CHANGED / self.basis.size
        for _ in range(trials):
            x = plan.x + step * (rng.random(plan.x.shape) < share) * rng.normal(size=plan.x.shape)
            kept = [
                within(joint, self.basis, tight, own) if count else old
                for joint, own, old, count in zip(self.joints, x, plan.x, plan.slots, strict=True)
            ]
            other = self._plan(kept, plan.slots)
            if other.value > plan.value:
                plan, step = other, step * GROWTH
            else:
                step *= GROWTH**-0.25
            if step < LEAST_STEP:
                step = FIRST_STEP
        return plan


def candidates(
    joint: DesignJoint, basis: MotionBasis, limits: JointLimits, rng: np.random.Generator, known: Sequence[FloatArray]
) -> list[FloatArray]:
    """Motions within the limits: random ones, sinusoids, slow passes over the range, and those that are known."""
    out = [random_start(joint, basis, limits, rng) for _ in range(RANDOM_STARTS)]
    out += single_waves(joint, basis, limits) + slow_passes(joint, basis, limits)
    return out + [within(joint, basis, limits, x) for x in known]


def random_start(joint: DesignJoint, basis: MotionBasis, limits: JointLimits, rng: np.random.Generator) -> FloatArray:
    """A random motion that fills the limits: amplitudes fall with a random power of the frequency."""
    power, (low, high) = rng.uniform(0.3, 1.8), limits.position
    scale = np.where(basis.frequency_hz > 0.0, (basis.frequency_hz + 1e-9) ** -power, 0.0)
    x = scale * rng.normal(size=basis.size) / basis.scale
    swing = basis.matrices[0] @ x
    x = (x - float(np.mean(swing)) * basis.one) * (high - low) / max(float(np.ptp(swing)), 1e-12)
    middle = rng.uniform(-0.5, 0.5) * 0.5 * (high - low) + 0.5 * (low + high)
    return within(joint, basis, limits, x + middle * basis.one)


def single_waves(joint: DesignJoint, basis: MotionBasis, limits: JointLimits) -> list[FloatArray]:
    """A sinusoid of each frequency about the middle, as large as the limits allow and smaller ones, which are slower.

    None for B-splines.
    """
    if basis.kind != "fourier":
        return []
    (low, high), sines = limits.position, slice(basis.size // 2 + 1, None)
    rest = 0.5 * (low + high) * basis.one
    waves = np.eye(basis.size)[sines] * 0.5 * (high - low) / basis.scale[sines, None]
    largest = [within(joint, basis, limits, rest + wave) for wave in waves]
    return [rest + share * (wave - rest) for share in SHARES for wave in largest]


def within(joint: DesignJoint, basis: MotionBasis, limits: JointLimits, x: FloatArray) -> FloatArray:
    """The motion scaled about its mean position until it keeps the limits.

    Raises:
        ParamsError: Not even a motion without amplitude keeps them.
    """
    found = shrunk(
        (basis,), (limits,), x[None], lambda motion: joint.keeps_torque(motion[:, :, 0], basis.step, limits.torque)
    )
    if found is None:
        raise ParamsError(
            f"joint {joint.name}: no motion about {float(np.mean(basis.matrices[0] @ x)):.3g} {limits.units.position} "
            f"keeps the torque limit of {limits.torque:.3g} {limits.units.text(TORQUE)}; raise it or move the position "
            "limits"
        )
    return np.asarray(found[0])


def slow_passes(joint: DesignJoint, basis: MotionBasis, limits: JointLimits) -> list[FloatArray]:
    """Passes through the range at constant speed, once in each direction in a period, as far as the basis has them.

    Under a known load they are the postures of a static pull, approached slowly from both sides: while a joint stands
    still its friction is not determined, so that a diagnosis takes moving rows alone.
    """
    phase = np.arange(basis.matrices.shape[1]) / basis.matrices.shape[1]
    triangle = np.abs(2.0 * np.mod(phase + 0.25, 1.0) - 1.0) * 2.0 - 1.0
    low, high = limits.position
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    passes = [np.linalg.lstsq(basis.matrices[0], middle + share * half * triangle, rcond=None)[0] for share in PASSES]
    return [within(joint, basis, limits, x) for x in passes]


def splits(slots: int, loads: int) -> list[tuple[int, ...]]:
    """Every way to give a number of slots to a number of loads."""
    return [each for each in product(range(slots + 1), repeat=loads) if sum(each) == slots]
