"""The best motion of a criterion within limits, by Drake's MathematicalProgram from several starts.

    max_x f(x)   s.t.   q_low <= P x <= q_high, |V x| <= v, |A x| <= a, |J x| <= j, |y(x)/K - D V x| <= tau  at samples

Linear constraints but the last. The gradient of f is a forward difference: f is a function of a few tens of numbers.
The solver sees friction that turns over smoothly. All motions that it visits are judged with sharp friction, and the
best of them is refined by a search that needs no gradient. From the best point found,

    x' = x + s m o n,   n ~ N(0, I),   m: a random third of the functions

is kept where the sharp criterion is larger; s grows by half after a success and shrinks after a failure, so that about
one trial in five succeeds (Rechenberg, 1973). A step that has become too small begins anew.

The motions of an experiment: of the joint as it is, or under known loads, each with its own motion and time.

The experiment has N equal slots of time. Load k takes n_k of them, in which it repeats its own motion x_k, and

    max_{n, x} f(sum_k n_k/N rows(load k, x_k)),   n_k >= 0, sum n_k = N

for a criterion f of all rows together, since a diagnosis fits all logs of a joint with one model. The search begins
with candidates (random motions, sinusoids, slow passes over the whole range in both directions), exchanges them load
by load, tries every split of the slots, and then lets the solver improve the motion of one load at a time. A single
motion is refined at the end.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue
from pydrake.solvers import IpoptSolver, MathematicalProgram, SnoptSolver, SolverOptions

from drake_tc.config.joint_units import TORQUE
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.criteria import Criterion
from drake_tc.experiments.design.joint import BalanceColumns, DesignJoint, MotionColumns
from drake_tc.experiments.design.motions import JointLimits, MotionBasis
from drake_tc.types import FloatArray

Progress = Callable[[str, float], None]
MARGIN = 0.01
"""Share by which the limits are narrowed, for what the motion does between two constrained samples."""
RANDOM_STARTS = 16
"""Random motions among which the best are taken as starts."""
SHARES = (1.0, 0.3, 0.1)
"""Sizes of single waves among the starts, over what the limits allow: effects of small speeds need slow motions."""
DIFFERENCE = 1e-3
"""Step of the forward difference, as a share of the amplitude that the limits allow each function."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best motion found.

    Attributes:
        x: (n,) its parameters.
        value: Of the criterion.
        start_value: Best value among the random motions inside the limits.
        solver: Name of the solver.
        starts: Number of starts. solved: of them, those that the solver ended by itself.
    """

    x: FloatArray
    value: float
    start_value: float
    solver: str
    starts: int
    solved: int


def sharp_value(joint: DesignJoint, criterion: Criterion, basis: MotionBasis, x: FloatArray) -> float:
    """Of a criterion with the rows and the friction of a diagnosis; minus infinity for a motion without such rows."""
    columns = MotionColumns(joint, basis.motion(x), basis.step, sharp=True)
    return criterion.value(columns) if columns.weight.any() else -np.inf


def random_start(joint: DesignJoint, basis: MotionBasis, limits: JointLimits, rng: np.random.Generator) -> FloatArray:
    """A random motion that fills the limits: amplitudes fall with a random power of the frequency."""
    power = rng.uniform(0.3, 1.8)
    scale = np.where(basis.frequency_hz > 0.0, (basis.frequency_hz + 1e-9) ** -power, 0.0)
    x = scale * rng.normal(size=basis.size) / basis.scale
    span = basis.matrices[0] @ x
    low, high = limits.position
    middle = rng.uniform(-0.5, 0.5) * 0.5 * (high - low) + 0.5 * (low + high)
    x = x / max(float(np.ptp(span)), 1e-12)
    return within(joint, basis, limits, _centred(basis, x * (high - low), middle))


def single_waves(joint: DesignJoint, basis: MotionBasis, limits: JointLimits) -> list[FloatArray]:
    """A sinusoid of each frequency about the middle, as large as the limits allow and smaller ones, which are slower.

    None for B-splines.
    """
    if basis.kind != "fourier":
        return []
    low, high = limits.position
    waves = np.eye(basis.size)[basis.size // 2 + 1 :] * 0.5 * (high - low) / basis.scale[basis.size // 2 + 1 :, None]
    middle = 0.5 * (low + high)
    largest = [within(joint, basis, limits, _centred(basis, wave, middle)) for wave in waves]
    rest = middle * _constant(basis)
    return [rest + share * (wave - rest) for share in SHARES for wave in largest]


def _constant(basis: MotionBasis) -> FloatArray:
    """(n,) parameters of the constant motion 1."""
    one = np.zeros(basis.size)
    if basis.kind == "fourier":
        one[0] = 1.0
    else:
        one[:] = 1.0
    return np.asarray(one / basis.scale)


def _centred(basis: MotionBasis, x: FloatArray, middle: float) -> FloatArray:
    span = basis.matrices[0] @ x
    return np.asarray(x + (middle - 0.5 * (float(span.max()) + float(span.min()))) * _constant(basis))


def within(joint: DesignJoint, basis: MotionBasis, limits: JointLimits, x: FloatArray) -> FloatArray:
    """The motion scaled about its mean position until it keeps the limits.

    Raises:
        ParamsError: Not even a motion without amplitude keeps them.
    """
    low, high = limits.position
    one = _constant(basis)
    mean = float(np.mean(basis.matrices[0] @ x))
    mean = float(np.clip(mean, low + 0.02 * (high - low), high - 0.02 * (high - low)))
    swing = x - float(np.mean(basis.matrices[0] @ x)) * one
    share = limits.share_kept(mean, basis.motion(swing))
    for _ in range(60):
        motion = basis.motion(mean * one + share * swing)
        torque = np.abs(joint.motor_torque(motion, basis.step))
        if float(torque.max()) <= limits.torque * (1.0 + 1e-9):
            return np.asarray(mean * one + share * swing)
        share *= 0.93
    raise ParamsError(
        f"joint {joint.name}: no motion about {mean:.3g} {limits.units.position} keeps the torque limit of "
        f"{limits.torque:.3g} {limits.units.text(TORQUE)}; raise it or move the position limits"
    )


def solved_from(
    joint: DesignJoint,
    basis: MotionBasis,
    limits: JointLimits,
    value: Callable[[FloatArray], float],
    start: FloatArray,
    iterations: int,
) -> tuple[list[FloatArray], bool, str]:
    """(all x at which the solver asked for a gradient and its result, whether it ended by itself, its name)."""
    visited: list[FloatArray] = []
    program: Any = MathematicalProgram()
    x = program.NewContinuousVariables(basis.size, "x")
    _add_limits(program, basis, limits, x)
    if np.isfinite(limits.torque):
        _add_torque(program, joint, basis, limits.torque, x)
    program.AddCost(differentiable(lambda at: -value(at), visited), vars=x)
    solver: Any = SnoptSolver() if SnoptSolver().available() else IpoptSolver()
    options = SolverOptions()
    options.SetOption(SnoptSolver.id(), "Major iterations limit", iterations)
    options.SetOption(SnoptSolver.id(), "Major optimality tolerance", 1e-4)
    options.SetOption(SnoptSolver.id(), "Timing level", 0)
    options.SetOption(IpoptSolver.id(), "max_iter", iterations)
    result = solver.Solve(program, start, options)
    found = np.asarray(result.GetSolution(x))
    name = str(result.get_solver_id().name())
    if not np.isfinite(found).all():
        return visited, False, name
    return [*visited, found], bool(result.is_success()), name


def _add_limits(program: Any, basis: MotionBasis, limits: JointLimits, x: Any) -> None:
    """Linear constraints at samples, eight for each wave of the highest frequency."""
    highest = float(basis.frequency_hz.max())
    every = max(1, int(1.0 / (8.0 * highest * basis.step)))
    for order, (lower, upper) in enumerate(limits.bounds):
        if np.isfinite(upper):
            rows = basis.matrices[order, ::every]
            program.AddLinearConstraint(rows, np.full(len(rows), lower), np.full(len(rows), upper), x)


def _add_torque(program: Any, joint: DesignJoint, basis: MotionBasis, torque: float, x: Any) -> None:
    """|torque of the motor| at a hundred samples, with the slopes by position, velocity and acceleration at each."""
    at = np.linspace(0, basis.matrices.shape[1] - 1, 100).astype(int)
    rows = basis.matrices[:, at]

    def effort(motion: FloatArray) -> FloatArray:
        return joint.motor_torque(motion, basis.step) / torque

    def values(point: Any) -> Any:
        if point.dtype != object:
            return effort(rows @ point)
        plain = ExtractValue(point).ravel()
        motion = rows @ plain
        here = effort(motion)
        jacobian = np.zeros((at.size, plain.size))
        for order in range(3):
            moved = motion.copy()
            moved[order] += 1e-6
            jacobian += ((effort(moved) - here) / 1e-6)[:, None] * rows[order]
        slopes = jacobian @ ExtractGradient(point)
        return np.array([AutoDiffXd(v, s) for v, s in zip(here, slopes, strict=True)])

    program.AddConstraint(values, lb=-np.ones(at.size), ub=np.ones(at.size), vars=x)


def differentiable(value: Callable[[FloatArray], float], visited: list[FloatArray]) -> Callable[[Any], Any]:
    """A cost for Drake with forward differences for its gradient; `visited` gets the points at which these were taken.

    A solver asks for many points that lie closer together than the step of the differences, as at the end of a line
    search. They share one gradient, which is known no better there.
    """
    slopes: list[FloatArray] = []

    def slope_at(plain: FloatArray, here: float) -> FloatArray:
        near = np.flatnonzero([np.max(np.abs(plain - each)) < DIFFERENCE for each in visited])
        if not near.size:
            moved = [value(plain + DIFFERENCE * unit) for unit in np.eye(plain.size)]
            slopes.append((np.array(moved) - here) / DIFFERENCE)
            visited.append(plain)
            return slopes[-1]
        nearest: FloatArray = slopes[near[-1]]
        return nearest

    def cost(at: Any) -> Any:
        if at.dtype != object:
            return value(at)
        plain = ExtractValue(at).ravel()
        here = value(plain)
        return AutoDiffXd(here, slope_at(plain, here) @ ExtractGradient(at))

    return cost


TRIALS = 400
FIRST_STEP, LEAST_STEP = 0.1, 1e-3
"""Steps s, over the amplitude that the limits allow each function alone."""
GROWTH = 1.5
SHARE = 1.0 / 3.0
"""Of the functions that are changed together."""


def refined(
    value: Callable[[FloatArray], tuple[float, FloatArray]],
    best: tuple[float, FloatArray],
    rng: np.random.Generator,
    trials: int = TRIALS,
) -> tuple[float, FloatArray]:
    """The best (value, x (n,)) after a number of trials; never less than that of `best`.

    Args:
        value: (criterion, the motion within limits) of a motion (n,).
        best: From which the search begins.
        rng: Of the trials.
        trials: Their number.
    """
    found, x = best
    step = FIRST_STEP
    for _ in range(trials):
        moved = rng.random(x.size) < SHARE
        tried, at = value(x + step * moved * rng.normal(size=x.size))
        if tried > found:
            found, x, step = tried, at, step * GROWTH
        else:
            step *= GROWTH**-0.25
        if step < LEAST_STEP:
            step = FIRST_STEP
    return found, x


class StackedColumns(BalanceColumns):
    """Rows of several parts, each with its share of the time of the whole experiment."""

    def __init__(self, parts: Sequence[BalanceColumns], shares: Sequence[float]) -> None:
        """Parts with the same noise and filters; shares of the time, which add up to 1."""
        self.parts, self.shares = tuple(parts), tuple(shares)
        self.joint = parts[0].joint
        rows = sum(part.weight.size for part in parts)
        self.weight = np.concatenate(
            [part.weight * (share * rows / part.weight.size) for part, share in zip(parts, shares, strict=True)]
        )

    def effort(self, terms: Sequence[Term]) -> FloatArray:
        """y* (T,) after the drive effects among the terms."""
        return np.concatenate([part.effort(terms) for part in self.parts])

    def changes(self, terms: Sequence[Term]) -> FloatArray:
        """(T, g) change of y* by each of several drive effects alone."""
        return np.concatenate([part.changes(terms) for part in self.parts])

    def of_each(self, terms: Sequence[Term]) -> list[FloatArray]:
        """Phi (T, k) of each."""
        each = zip(*(part.of_each(terms) for part in self.parts), strict=True)
        return [np.concatenate(blocks) for blocks in each]


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
        return MotionColumns(self.joints[load], basis.motion(x), basis.step, sharp=sharp)

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
