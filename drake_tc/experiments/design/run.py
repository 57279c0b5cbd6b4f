"""`design` for one joint: from what is known to the best motion, and what it is expected to tell."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BPoly

from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.experiments.design.basis import BasisKind, MotionBasis, motion_basis, scaled
from drake_tc.experiments.design.criteria import AllEffects, Criterion, Parameters
from drake_tc.experiments.design.default_motion import default_motion
from drake_tc.experiments.design.discrimination import Discrimination
from drake_tc.experiments.design.found_sizes import found_from
from drake_tc.experiments.design.goal import Goal, criterion_of
from drake_tc.experiments.design.intervals import standard_deviations
from drake_tc.experiments.design.joint import BalanceColumns, DesignJoint, LogColumns, MotionColumns
from drake_tc.experiments.design.lead import lead_in, quintic
from drake_tc.experiments.design.limits import JointLimits
from drake_tc.experiments.design.noise import measured_as
from drake_tc.experiments.design.solve import Optimum, optimise
from drake_tc.experiments.design.tracking import tracking_warning
from drake_tc.experiments.design.wider import what_limits
from drake_tc.types import FloatArray

Progress = Callable[[str, float], None]
PERIOD = 10.0
"""Period of the motion [s], about: the experiment holds a whole number of them."""
STEP = 0.005
"""Time between the samples of a design [s]."""
FINE = 1e-3
"""The same of the motion with which it is compared, which is computed once [s]."""
TOLD = 0.8
"""Probability of separating a pair of effects, below which the page says which limit prevents it."""
REFIT = (
    "Give the new run as --log and the earlier ones as --holdout. If they were fitted together, the earlier runs alone "
    "would also have to predict the new run, and their bias could make the diagnosis withdraw the true effect."
)


@dataclass(frozen=True)
class DesignOptions:
    """How a motion is looked for.

    Attributes:
        duration: Of the experiment [s].
        basis: Functions of the motion.
        smallest: E- instead of D-optimality of parameters.
        starts: Of the solver. iterations: from each of them.
        seed: Of the random starts.
    """

    duration: float = 30.0
    basis: BasisKind = "fourier"
    smallest: bool = False
    starts: int = 2
    iterations: int = 20
    seed: int = 0


@dataclass(frozen=True)
class Expected:
    """What one quantity is worth before the experiment, with a growing sinusoid, and with the designed motion.

    Attributes:
        name, unit: Of the quantity.
        before: With the logs so far; NaN without logs.
        default: With a growing sinusoid of the same length and limits alone.
        after: With the designed motion alone.
    """

    name: str
    unit: str
    before: float
    default: float
    after: float


@dataclass(frozen=True, eq=False)
class JointDesign:
    """The designed motion of one joint.

    Attributes:
        joint: The joint. goal: What it is for. limits: That it keeps. basis, optimum: The motion.
        repeats: Periods in the experiment.
        expected: What it is expected to bring.
        sentences: The same in words.
        contained: (truth, other, proof) of an effect that the other one contains: no motion rules that other out.
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

    def motion(self, rate_hz: float) -> tuple[FloatArray, FloatArray]:
        """(time (T,), motion (4, T)) of the whole experiment at a rate [Hz]; it begins and ends at rest."""
        one = _from_reversal(self.basis.motion(self.optimum.x))
        state = one[:3, 0]
        rest, length = lead_in(state, self.limits, self.joint.name)
        whole = self.repeats * self.basis.period
        time = np.arange(round((whole + 2.0 * length) * rate_hz) + 1) / rate_hz
        grid = np.arange(one.shape[1] + 1) * self.basis.step
        closed = np.concatenate([one, one[:, :1]], axis=1)
        place = np.mod(time - length, self.basis.period)
        spline = BPoly.from_derivatives(grid, closed[:3].T)
        out = np.stack([spline(place, order) for order in range(4)])
        begin, end = time < length, time > length + whole
        start = np.array([rest, 0.0, 0.0])
        out[:, begin] = quintic(start, state, length, time[begin])
        # the same polynomial backwards in time: odd derivatives change their sign
        turned = np.array([1.0, -1.0, 1.0, -1.0])[:, None]
        backwards = state * np.array([1.0, -1.0, 1.0])
        rest, _ = lead_in(backwards, self.limits, self.joint.name)
        left = np.maximum(whole + 2.0 * length - time[end], 0.0)
        out[:, end] = turned * quintic(np.array([rest, 0.0, 0.0]), backwards, length, left)
        return time, out


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
    logs: Prepared | None = None,
    progress: Progress = lambda text, share: None,
) -> JointDesign:
    """The best motion for a goal within limits.

    Args:
        joint: What is known of the joint.
        limits: Of the motion.
        goal: What it is for.
        options: How it is looked for.
        logs: The runs so far, for comparison; None where there are none.
        progress: Told how far it is.

    Raises:
        ParamsError: Limits that no motion keeps, or a goal that no motion reaches.
    """
    limits.require_resolved(joint.slowest, joint.name)
    logged, joint = joint, joint_within(joint, limits)
    fill = default_motion(joint, limits, options.duration, FINE)
    if goal.kind != "all":
        joint = measured_as(joint, fill, FINE)
    criterion = criterion_of(goal, joint, options.duration, smallest=options.smallest)
    repeats = max(1, round(options.duration / PERIOD))
    basis = scaled(motion_basis(options.basis, options.duration / repeats, STEP, limits.bandwidth_hz), limits)
    found = optimise(
        joint,
        basis,
        limits,
        criterion,
        np.random.default_rng(options.seed),
        starts=options.starts,
        iterations=options.iterations,
        progress=progress,
    )
    motion = basis.motion(found.x)
    own = measured_as(joint, motion, basis.step) if goal.kind != "all" else joint
    designed = MotionColumns(own, motion, basis.step, sharp=True)
    default = MotionColumns(joint, fill, FINE, periodic=False, sharp=True)
    before = None if logs is None else LogColumns(logged, logs.train)
    expected, sentences = _expected(criterion, before, default, designed)
    if isinstance(criterion, Discrimination) and expected[0].after < TOLD:
        sentences = (*sentences, what_limits(joint, limits, criterion, basis, options.seed))
    sentences = (*sentences, *tracking_warning(joint, limits, motion, basis.step))
    contained = criterion.contained if isinstance(criterion, Discrimination) else ()
    return JointDesign(joint, goal, limits, basis, found, repeats, expected, sentences, contained)


def joint_within(joint: DesignJoint, limits: JointLimits) -> DesignJoint:
    """The joint with the positions and speeds of a run that spans the limits.

    The effects that can be looked for, and their shapes, depend on both.
    """
    wide = replace(joint.context, position_span=limits.position, max_speed=limits.velocity)
    return replace(joint, context=wide)


def _expected(
    criterion: Criterion, before: BalanceColumns | None, default: BalanceColumns, designed: BalanceColumns
) -> tuple[tuple[Expected, ...], tuple[str, ...]]:
    if isinstance(criterion, Discrimination):
        return _of_discrimination(criterion, before, default, designed)
    if isinstance(criterion, Parameters):
        return _of_parameters(criterion, before, default, designed)
    if isinstance(criterion, AllEffects):
        return _of_everything(criterion, before, default, designed)
    return (), ()


def _of_discrimination(
    criterion: Discrimination, before: BalanceColumns | None, default: BalanceColumns, designed: BalanceColumns
) -> tuple[tuple[Expected, ...], tuple[str, ...]]:
    given = ((before, None if before is None else before.seconds), (default, None), (designed, None))
    none = float("nan")
    chances = [none if c is None else criterion.probability(c, seconds) for c, seconds in given]
    rows = [Expected("probability that these runs alone distinguish them", "-", *chances)]
    found = [None if c is None else criterion.distances(c, seconds) for c, seconds in given]
    for truth, other in criterion.orders:
        key = truth.effect.key, other.effect.key
        values = [none if d is None else float(np.sqrt(np.min(d[key]))) for d in found]
        rows.append(Expected(f"{key[0]} fitted by {key[1]}: distance in standard deviations", "-", *values))
    seen = [None if c is None else criterion.visibilities(c, seconds) for c, seconds in given]
    for name in seen[-1] or ():
        values = [none if d is None else float(np.sqrt(np.min(d[name]))) for d in seen]
        rows.append(Expected(f"{name} not modelled: distance in standard deviations", "-", *values))
    names = " and ".join(
        f"{form.effect.key} ({form.strength:.3g} {form.size.unit})".replace(" -)", ")")
        for form in (criterion.orders[0][0], criterion.orders[0][1])
    )
    text = f"The designed motion distinguishes {names} with a probability of {100.0 * rows[0].after:.0f} %"
    text += f"; a growing sinusoid of the same length and limits does so with {100.0 * rows[0].default:.0f} %."
    more = [] if before is None or rows[0].after < TOLD else [REFIT]
    more += [
        f"Where {truth} alone is the cause, no motion rules {other} out, which is the same function while the joint "
        f"slides: {proof}."
        for truth, other, proof in criterion.contained
    ]
    return tuple(rows), (text, *more)


def _of_parameters(
    criterion: Parameters, before: BalanceColumns | None, default: BalanceColumns, designed: BalanceColumns
) -> tuple[tuple[Expected, ...], tuple[str, ...]]:
    none = np.full(len(criterion.names), np.nan)
    own = none
    if before is not None:  # of the logs' own length instead of the experiment's
        own = _spread(criterion.information(before) * before.seconds / criterion.duration) * criterion.units
    spreads = [own, *(_expected_spread(criterion, c) * criterion.units for c in (default, designed))]
    rows = tuple(
        Expected(f"{name}, half 95 % interval", unit, *(1.96 * float(s[i]) for s in spreads))
        for i, (name, unit) in enumerate(zip(criterion.names, criterion.unit_names, strict=True))
    )
    ratio = float(np.median(spreads[2] / spreads[1]))
    text = (
        f"The 95 % intervals after the designed motion are {ratio:.2f} times as wide as those after a growing sinusoid "
        "of the same length and limits (median over the parameters)."
    )
    return rows, (text,)


def _expected_spread(criterion: Parameters, columns: BalanceColumns) -> FloatArray:
    """(p,) after the experiment; by the number of independent samples where the noise of its sensors is not known."""
    found = standard_deviations(criterion, columns)
    return _spread(criterion.information(columns)) if found is None else found


def _spread(information: FloatArray) -> FloatArray:
    """(p,) standard deviations of the parameters (Cramer and Rao); infinite where nothing is known."""
    eigen, vectors = np.linalg.eigh(information)
    with np.errstate(divide="ignore"):
        inverse = np.where(eigen > 1e-12 * max(float(eigen[-1]), 1e-300), 1.0 / eigen, np.inf)
    return np.asarray(np.sqrt(np.sum(np.where(vectors**2 > 1e-12, vectors**2 * inverse, 0.0), axis=1)))


def _of_everything(
    criterion: AllEffects, before: BalanceColumns | None, default: BalanceColumns, designed: BalanceColumns
) -> tuple[tuple[Expected, ...], tuple[str, ...]]:
    given = ((before, None if before is None else before.seconds), (default, None), (designed, None))
    rows, shown = [], [0, 0, 0]
    for form in criterion.forms:
        sizes = [np.nan if c is None else found_from(form, c, criterion.noise(c.joint, each)) for c, each in given]
        word = "largest" if form.size.falling else "smallest"
        rows.append(Expected(f"{word} {form.effect.key} that is found", form.size.unit, *sizes))
        for i, size in enumerate(sizes):
            shown[i] += bool(
                np.isfinite(size) and (size >= form.strength if form.size.falling else size <= form.strength)
            )
    text = (
        f"Of {len(rows)} effects of typical size the designed motion shows {shown[2]}, a growing sinusoid of the same "
        f"length and limits {shown[1]}."
    )
    never = [form.effect.key for form, row in zip(criterion.forms, rows, strict=True) if np.isinf(row.after)]
    more = (f"The designed motion shows no size (∞) of {', '.join(never)}.",) if never else ()
    return tuple(rows), (text, *more)
