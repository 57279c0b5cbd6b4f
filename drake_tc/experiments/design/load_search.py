"""Which known loads, how long each, and which motion under each: the best plan of an experiment.

The experiment has N equal slots of time. Load k takes n_k of them, in which it repeats its own motion x_k, and

    max_{n, x} f(sum_k n_k/N rows(load k, x_k)),   n_k >= 0, sum n_k = N

for a criterion f of all rows together, since a diagnosis fits all logs of a joint with one model. The search begins
with candidates (random motions, sinusoids, slow passes over the whole range in both directions), exchanges them load
by load, tries every split of the slots, and then lets the solver improve the motion of one load at a time.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.experiments.design.basis import MotionBasis
from drake_tc.experiments.design.criteria import Criterion
from drake_tc.experiments.design.joint import BalanceColumns, DesignJoint, MotionColumns
from drake_tc.experiments.design.limits import JointLimits
from drake_tc.experiments.design.solve import MARGIN, RANDOM_STARTS, random_start, single_waves, solved_from, within
from drake_tc.experiments.design.stacked import RememberedColumns, StackedColumns
from drake_tc.types import FloatArray

Progress = Callable[[str, float], None]
SWEEPS = 3
"""Most exchanges of the candidates of every load."""
PASSES = (1.0, 0.5)
"""Shares of the position range that slow passes cover."""


@dataclass(frozen=True, eq=False)
class LoadPlan:
    """An experiment under known loads.

    Attributes:
        x: By load, (n,) parameters of its motion.
        slots: By load, the slots of time that it takes; 0 for one that is not used.
        value: Of the criterion. start_value: of the best plan of candidates.
        solver: Name of the solver. solved: loads whose motion it ended by itself.
    """

    x: tuple[FloatArray, ...]
    slots: tuple[int, ...]
    value: float
    start_value: float
    solver: str = ""
    solved: int = 0

    @property
    def used(self) -> tuple[int, ...]:
        """Numbers of the loads that take part."""
        return tuple(k for k, count in enumerate(self.slots) if count)


@dataclass(frozen=True, eq=False)
class LoadSearch:
    """What a plan is looked for with.

    Attributes:
        joints: The joint under each load.
        basis: Of every motion; its period is one slot. rough: the same functions at a wider step, for the solver.
        limits: That every motion keeps.
        criterion: Of all rows together.
        slots: N.
    """

    joints: tuple[DesignJoint, ...]
    basis: MotionBasis
    rough: MotionBasis
    limits: JointLimits
    criterion: Criterion
    slots: int

    def rows(self, load: int, x: FloatArray, *, sharp: bool = True) -> BalanceColumns:
        """Rows of one load's motion; rough ones for the solver unless `sharp`."""
        basis = self.basis if sharp else self.rough
        return RememberedColumns(MotionColumns(self.joints[load], basis.motion(x), basis.step, sharp=sharp))

    def value(self, rows: Sequence[BalanceColumns], slots: Sequence[int]) -> float:
        """Of the rows of each load together; minus infinity where a load that takes part has none."""
        used = [k for k, count in enumerate(slots) if count]
        if not all(rows[k].weight.any() for k in used):
            return -np.inf
        parts = [rows[k] for k in used]
        return self.criterion.value(StackedColumns(parts, [slots[k] / sum(slots) for k in used]))

    def best(
        self, rng: np.random.Generator, known: Sequence[FloatArray], iterations: int, progress: Progress
    ) -> LoadPlan:
        """The best plan.

        Args:
            rng: Of the random motions.
            known: Motions (n,) that are candidates under every load.
            iterations: Of the solver for each load.
            progress: Told how far it is.

        Raises:
            ParamsError: No motion under one of the loads keeps the limits.
        """
        tight = self.limits.with_margin(MARGIN)
        tried: list[list[tuple[FloatArray, BalanceColumns]]] = []
        for k, joint in enumerate(self.joints):
            xs = candidates(joint, self.basis, tight, rng, known)
            tried.append([(x, self.rows(k, x)) for x in xs])
            progress("candidates", 0.1 * (k + 1) / len(self.joints))
        picked, slots, value = self._exchanged(tried)
        progress("loads", 0.3)
        plan = LoadPlan(tuple(tried[k][i][0] for k, i in enumerate(picked)), slots, value, value)
        return self._improved(plan, tight, iterations, progress)

    def _exchanged(
        self, tried: Sequence[Sequence[tuple[FloatArray, BalanceColumns]]]
    ) -> tuple[list[int], tuple[int, ...], float]:
        """(candidate of each load, slots of each load, value) of the best plan of candidates."""
        loads = range(len(tried))
        plans, picked = [], [0 for _ in loads]
        for k in loads:  # each load alone
            own = tuple(self.slots if j == k else 0 for j in loads)
            values = [self.value([rows for _ in loads], own) for _, rows in tried[k]]
            picked[k] = int(np.argmax(values))
            plans.append((max(values), k, own))
        alone, slots = list(picked), even_split(self.slots, len(tried))
        best = max(plans)
        found = (alone, best[2], best[0])
        for _ in range(SWEEPS):
            before = list(picked)
            for k in (k for k in loads if slots[k]):
                rows = [tried[j][i][1] for j, i in enumerate(picked)]
                values = [self.value([*rows[:k], own, *rows[k + 1 :]], slots) for _, own in tried[k]]
                picked[k] = int(np.argmax(values))
            slots, value = self.split([tried[j][i][1] for j, i in enumerate(picked)])
            if value > found[2]:
                found = (list(picked), slots, value)
            if picked == before:
                break
        return found

    def split(self, rows: Sequence[BalanceColumns]) -> tuple[tuple[int, ...], float]:
        """(slots of each load, value) of the best split of the time for these rows."""
        values = {slots: self.value(rows, slots) for slots in splits(self.slots, len(rows))}
        best = max(values, key=lambda slots: values[slots])
        return best, values[best]

    def _improved(self, plan: LoadPlan, tight: JointLimits, iterations: int, progress: Progress) -> LoadPlan:
        """The plan with the motion of one load after the other improved by the solver, and the time split anew."""
        sharp = [self.rows(k, x) for k, x in enumerate(plan.x)]
        for number, k in enumerate(plan.used):
            joint = self.joints[k]
            smooth = self._with_one_free(plan, k)
            visited, ended, name = solved_from(joint, self.rough, tight, smooth, plan.x[k], iterations)
            plan = replace(plan, solver=name, solved=plan.solved + int(ended))
            for x in (within(joint, self.basis, tight, each) for each in visited):
                rows = [*sharp[:k], self.rows(k, x), *sharp[k + 1 :]]
                value = self.value(rows, plan.slots)
                if value > plan.value:
                    sharp = rows
                    plan = replace(plan, x=(*plan.x[:k], x, *plan.x[k + 1 :]), value=value)
            progress(f"load {number + 1} of {len(plan.used)}", 0.3 + 0.7 * (number + 1) / len(plan.used))
        slots, value = self.split(sharp)
        return replace(plan, slots=slots, value=value) if value > plan.value else plan

    def _with_one_free(self, plan: LoadPlan, load: int) -> Callable[[FloatArray], float]:
        """The smooth value of a plan as a function of one load's motion."""
        fixed = {j: self.rows(j, plan.x[j], sharp=False) for j in plan.used if j != load}

        def value(x: FloatArray) -> float:
            own = MotionColumns(self.joints[load], self.rough.motion(x), self.rough.step)
            return self.value([fixed.get(j, own) for j in range(len(self.joints))], plan.slots)

        return value


def candidates(
    joint: DesignJoint, basis: MotionBasis, limits: JointLimits, rng: np.random.Generator, known: Sequence[FloatArray]
) -> list[FloatArray]:
    """Motions within the limits: random ones, sinusoids, slow passes over the range, and those that are known."""
    out = [random_start(joint, basis, limits, rng) for _ in range(RANDOM_STARTS)]
    out += single_waves(joint, basis, limits) + slow_passes(joint, basis, limits)
    return out + [within(joint, basis, limits, x) for x in known]


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


def splits(slots: int, loads: int) -> Iterator[tuple[int, ...]]:
    """Every way to give a number of slots to a number of loads."""
    if loads == 1:
        yield (slots,)
        return
    for own in range(slots + 1):
        for rest in splits(slots - own, loads - 1):
            yield (own, *rest)


def even_split(slots: int, loads: int) -> tuple[int, ...]:
    """The slots, as evenly as possible, at least one for each load."""
    return tuple(slots // loads + (k < slots % loads) for k in range(loads))
