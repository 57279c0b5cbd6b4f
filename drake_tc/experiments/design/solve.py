"""The best motion of a criterion within limits, by Drake's MathematicalProgram from several starts.

    max_x f(x)   s.t.   q_low <= P x <= q_high, |V x| <= v, |A x| <= a, |J x| <= j, |y(x)/K - D V x| <= tau  at samples

Linear constraints but the last. The gradient of f is a forward difference: f is a function of a few tens of numbers.
The solver sees friction that turns over smoothly. All motions that it visits are judged with sharp friction, and the
best of them is refined by a search that needs no gradient. From the best point found,


    x' = x + s m o n,   n ~ N(0, I),   m: a random third of the functions

is kept where the sharp criterion is larger; s grows by half after a success and shrinks after a failure, so that about
one trial in five succeeds (Rechenberg, 1973). A step that has become too small begins anew.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue
from pydrake.solvers import IpoptSolver, MathematicalProgram, SnoptSolver, SolverOptions

from drake_tc.config.joint_units import TORQUE
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.basis import MotionBasis
from drake_tc.experiments.design.criteria import Criterion
from drake_tc.experiments.design.joint import DesignJoint, MotionColumns
from drake_tc.experiments.design.limits import JointLimits
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
    q, v, a, j = (basis.matrices[order] @ swing for order in range(4))
    rooms = [
        ((high - mean), float(q.max())),
        ((mean - low), float(-q.min())),
        (limits.velocity, float(np.abs(v).max())),
        (limits.acceleration, float(np.abs(a).max())),
        (limits.jerk, float(np.abs(j).max())),
    ]
    share = min([1.0, *(room / size for room, size in rooms if size > 0.0)])
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
    low, high = limits.position
    bounds = [
        (low, high),
        (-limits.velocity, limits.velocity),
        (-limits.acceleration, limits.acceleration),
        (-limits.jerk, limits.jerk),
    ]
    for order, (lower, upper) in enumerate(bounds):
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
