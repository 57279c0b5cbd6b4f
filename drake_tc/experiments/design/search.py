"""The motions of an experiment: of the joint as it is, or under known loads, each with its own motion and time.

The experiment has N equal slots of time. Load k takes n_k of them, in which it repeats its own motion x_k, and

    max_{n, x} f(sum_k n_k/N rows(load k, x_k)),   n_k >= 0, sum n_k = N

for a criterion f of all rows together, since a diagnosis fits all logs of a joint with one model. The search begins
with candidates (random motions, sinusoids, slow passes over the whole range in both directions), exchanges them load
by load, tries every split of the slots, and then lets the solver improve the motion of one load at a time. A single
motion is refined at the end.
"""

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.experiments.design.basis import MotionBasis
from drake_tc.experiments.design.criteria import Criterion
from drake_tc.experiments.design.joint import BalanceColumns, DesignJoint, MotionColumns
from drake_tc.experiments.design.limits import JointLimits
from drake_tc.experiments.design.solve import (
    MARGIN,
    RANDOM_STARTS,
    Optimum,
    random_start,
    refined,
    single_waves,
    solved_from,
    within,
)
from drake_tc.types import FloatArray


def _key(terms: Sequence[Term]) -> Hashable:
    return tuple((t.effect.key, tuple(sorted(t.shape.items()))) for t in terms)


class RememberedColumns:
    """Columns that are computed once: parts of an experiment that stay while another part is changed."""

    def __init__(self, columns: BalanceColumns) -> None:
        """Of a motion."""
        self.joint, self.weight, self.seconds = columns.joint, columns.weight, columns.seconds
        self._columns = columns
        self._known: dict[Hashable, FloatArray] = {}

    def effort(self, terms: Sequence[Term]) -> FloatArray:
        """y* (T,)."""
        key = ("effort", _key(terms))
        if key not in self._known:
            self._known[key] = self._columns.effort(terms)
        return self._known[key]

    def changes(self, terms: Sequence[Term]) -> FloatArray:
        """(T, g)."""
        key = ("changes", _key(terms))
        if key not in self._known:
            self._known[key] = self._columns.changes(terms)
        return self._known[key]

    def of(self, term: Term) -> FloatArray:
        """Phi (T, k)."""
        key = ("of", _key([term]))
        if key not in self._known:
            self._known[key] = self._columns.of(term)
        return self._known[key]

    def of_each(self, terms: Sequence[Term]) -> list[FloatArray]:
        """Phi (T, k) of each; those that are not known yet are computed together."""
        keys: list[Hashable] = [("of", _key([term])) for term in terms]
        missing = {key: term for key, term in zip(keys, terms, strict=True) if key not in self._known}
        if missing:
            self._known |= zip(missing, self._columns.of_each(list(missing.values())), strict=True)
        return [self._known[key] for key in keys]

    def design(self, terms: Sequence[Term]) -> FloatArray:
        """[y*, -phi ...] (T, 1 + sum k)."""
        blocks = [self.effort(terms)[:, None]] + [-self.of(t) for t in terms if t.effect.coefficients]
        return np.concatenate(blocks, axis=1)


class StackedColumns:
    """Rows of several parts, each with its share of the time of the whole experiment."""

    def __init__(self, parts: Sequence[BalanceColumns], shares: Sequence[float]) -> None:
        """Parts with the same noise and filters; shares of the time, which add up to 1."""
        self.parts, self.shares = tuple(parts), tuple(shares)
        self.joint = parts[0].joint
        rows = sum(part.weight.size for part in parts)
        self.weight = np.concatenate(
            [part.weight * (share * rows / part.weight.size) for part, share in zip(parts, shares, strict=True)]
        )
        self.seconds = sum(part.seconds for part in parts)

    def effort(self, terms: Sequence[Term]) -> FloatArray:
        """y* (T,) after the drive effects among the terms."""
        return np.concatenate([part.effort(terms) for part in self.parts])

    def changes(self, terms: Sequence[Term]) -> FloatArray:
        """(T, g) change of y* by each of several drive effects alone."""
        return np.concatenate([part.changes(terms) for part in self.parts])

    def of(self, term: Term) -> FloatArray:
        """Phi (T, k) of one term."""
        return np.concatenate([part.of(term) for part in self.parts])

    def of_each(self, terms: Sequence[Term]) -> list[FloatArray]:
        """Phi (T, k) of each."""
        each = zip(*(part.of_each(terms) for part in self.parts), strict=True)
        return [np.concatenate(blocks) for blocks in each]

    def design(self, terms: Sequence[Term]) -> FloatArray:
        """[y*, -phi ...] (T, 1 + sum k)."""
        return np.concatenate([part.design(terms) for part in self.parts])


Progress = Callable[[str, float], None]
SWEEPS = 3
"""Most exchanges of the candidates of every load."""
PASSES = (1.0, 0.5)
"""Shares of the position range that slow passes cover."""


@dataclass(frozen=True, eq=False)
class MotionPlan:
    """The motions of an experiment, the joint as it is being one load.

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

    def optimum(self, load: int, starts: int) -> Optimum:
        """The motion under one load."""
        return Optimum(self.x[load], self.value, self.start_value, self.solver, starts, self.solved)


@dataclass(frozen=True, eq=False)
class MotionSearch:
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
        self,
        rng: np.random.Generator,
        known: Sequence[FloatArray] = (),
        *,
        starts: int = 1,
        iterations: int = 20,
        progress: Progress = lambda text, share: None,
    ) -> MotionPlan:
        """The best plan.

        Args:
            rng: Of the random motions.
            known: Motions (n,) that are candidates under every load.
            starts: Of the solver: the best candidates of a single motion, otherwise those of the plan; 0 leaves the
                candidates as they are.
            iterations: Of the solver for each motion.
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
        plan = MotionPlan(tuple(tried[k][i][0] for k, i in enumerate(picked)), slots, value, value)
        if not starts:
            return plan
        if len(self.joints) > 1:
            return self._improved(plan, tight, iterations, progress)
        others = sorted(tried[0], key=lambda pair: -self.value([pair[1]], slots))[:starts]
        found = [self._improved(replace(plan, x=(x,)), tight, iterations, progress) for x, _ in others]
        best = max(found, key=lambda each: each.value)
        best = replace(best, solved=sum(each.solved for each in found))

        def judged(x: FloatArray) -> tuple[float, FloatArray]:
            kept = within(self.joints[0], self.basis, tight, x)
            return self.value([self.rows(0, kept)], slots), kept

        value, x = refined(judged, (best.value, best.x[0]), rng)
        return replace(best, x=(x,), value=value)

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

    def _improved(self, plan: MotionPlan, tight: JointLimits, iterations: int, progress: Progress) -> MotionPlan:
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

    def _with_one_free(self, plan: MotionPlan, load: int) -> Callable[[FloatArray], float]:
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
