"""A robot that falls: where ticks go on without a solution, the torques give way to damping of the joints.

    s[n] = min(1, s[n-1] + period/GIVE_WAY)    a tick without a solution, or with a contact that was dropped
           max(0, s[n-1] - period/REGAIN)      else
    tau  = a (1 - w) tau_tick - w D v,  w = clip((s - START)/(1 - START), 0, 1)

A few ticks without a solution, as a push brings them, leave the torque that misses least as it is (s <= START). From
GIVE_WAY on the joints are damped alone. In between a <= 1 is the largest with which the joints' power is bounded,

    tau . v <= (1 - u) max(tau_tick . v, 0),  u = min(w/NO_POWER, 1),

so that it is not positive from 2 ms after START on. D is the law's `fallback_damping`, less where that would be more
than a tick can damp: the largest eigenvalue of period M^-1 D stays below STABLE, M^-1 the joints' block of the inverse
mass matrix. While s > 0 a contact that moves carries nothing and is dropped from the tick.

Where no torques keep all limits: which limits conflict, by how much, the torques that miss least, safe ones.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from drake_tc.tsid.model import Scratch, TsidModel
from drake_tc.tsid.qp import Outcome, QpSolution, QpSolver, QuadraticProgram
from drake_tc.tsid.qp import solver as solver_named
from drake_tc.tsid.rows import Polytope, Terms
from drake_tc.types import BoolArray, FloatArray, IntArray

GIVE_WAY, START, REGAIN = 0.04, 0.5, 0.5
"""Time without a solution after which there is damping alone [s]; share of it before which nothing is changed; time
with solutions after which nothing is left of it [s]."""
SLIDING, TURNING = 0.3, 3.0
"""Speed of a contact that no longer stands [m/s, rad/s]: a foot that rolls over its edge turns with less."""
STABLE = 0.5
NO_POWER = 0.1
"""Share w of the damping from which on the joints give no power."""


class Standing(NamedTuple):
    """Contacts of a tick.

    Attributes:
        active: One a contact: whether the tick stands on it.
        dropped: How many of those that were to carry move.
    """

    active: tuple[bool, ...]
    dropped: int


def standing_contacts(terms: Terms, active: tuple[bool, ...]) -> Standing:
    """The contacts that do not move."""
    moves = iter(_moving(terms))
    kept = tuple(carries and not next(moves) for carries in active)
    return Standing(kept, sum(active) - sum(kept))


def _moving(terms: Terms) -> list[bool]:
    """Of the active contacts, one after the other."""
    found: list[bool] = []
    for contact, rows in zip(terms.contacts.contacts, terms.contacts.rows, strict=True):
        velocity = terms.contact_velocity[rows]
        turns = contact.size == 6 and float(np.linalg.norm(velocity[3:])) > TURNING
        found.append(turns or float(np.linalg.norm(velocity[:3])) > SLIDING)
    return found


def falling_share(before: float, period: float, *, unsolved: bool) -> float:
    """s[n]."""
    return min(1.0, before + period / GIVE_WAY) if unsolved else max(0.0, before - period / REGAIN)


def damped_torque(terms: Terms, torque: FloatArray, share: float, damping: float, period: float) -> FloatArray:
    """(n,) tau of the module.

    Args:
        terms: At the state.
        torque: (n,) of the tick [N m].
        share: s.
        damping: Of the law [N m s/rad].
        period: Of the ticks [s].
    """
    weight = min(max((share - START) / (1.0 - START), 0.0), 1.0)
    if weight == 0.0:
        return torque
    joints = terms.actuated
    moved = np.linalg.inv(terms.mass_matrix)[np.ix_(joints, joints)]
    fastest = period * damping * float(np.linalg.eigvalsh(moved)[-1])
    own = damping * min(1.0, STABLE / fastest) if fastest > 0.0 else damping
    velocity = terms.v[joints]
    power, taken = float(torque @ velocity), weight * own * float(velocity @ velocity)
    kept = 1.0 - weight
    if power > 0.0:
        allowed = (1.0 - min(weight / NO_POWER, 1.0)) * power
        kept = min(kept, (allowed + taken) / power)
    return np.asarray(kept * torque - weight * own * velocity)


def terms_at(model: TsidModel, scratch: Scratch, state: FloatArray, active: tuple[bool, ...]) -> Terms:
    """At a state (nq + nv,)."""
    return model.terms(scratch, state[: model.nq], state[model.nq : model.nq + model.nv], active)


MOMENT_ARM = 0.1
"""A moment of a contact counts as much as the force that makes it at this arm [m]."""
_CENTRE = 1e-4
"""How much less a unit of torque off the centre counts than one of slack (squared, as both)."""
_STEPS = 3
_NAMED = 1e-4
"""Rows whose push is less than this share of the largest take no part in a conflict."""
_KEPT = 1e-7


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What stands in the way, worst first.

    Attributes:
        outcome: SOLVED where the elastic phase has an answer; FAILED where the problem has numbers that are none.
        torque: (n,) that misses least, within the torque limits; NaN where FAILED.
        rows: (c,) of the polytope that conflict with each other; empty where all can be kept.
        missed: (c,) by how much, in each row's unit; 0 for torque limits, which are kept and push others out.
        upper: (c,) whether it is the upper side (else the lower) of the row.
        labels: (c,) of these rows, as the polytope has them.
    """

    outcome: Outcome
    torque: FloatArray
    rows: IntArray
    missed: FloatArray
    upper: BoolArray
    labels: tuple[str, ...]

    def __str__(self) -> str:
        if self.outcome is not Outcome.SOLVED:
            return "no diagnosis: the problem has values that are not numbers"
        if not self.labels:
            return "no conflict: all limits can be kept"
        parts = zip(self.labels, self.missed, self.upper, strict=True)
        told = [f"{label} ({'above' if up else 'below'} by {missed:.3g})" for label, missed, up in parts]
        return f"limits conflict: {', '.join(told)}"


def diagnose(polytope: Polytope, *, solver: QpSolver | None = None, centre: FloatArray | None = None) -> Diagnosis:
    """The elastic phase: as little slack as possible, and who needs it.

        min 1/2 sum_i (s_i / w_i)^2   s.t.  lower <= G tau + s <= upper,  no slack for the torque limits (bounds)

    w_i = |G_i T|: what full torques do to the row, T half of each joint's range of torque, so that no unit matters.
    At the optimum G^T lambda = 0 with lambda_i = s_i / w_i^2 (of torque limits: their multipliers), while lambda^T of
    the sides is negative: a proof that the rows with lambda_i != 0, those named, cannot hold together. Proximal steps
    from `centre` settle what slack leaves open.

    Args:
        polytope: Limits over the torques.
        solver: Of quadratic programs; None for the default.
        centre: (n,) torques to stay near where slack is the same, say the safe ones; None for zero.

    Never raises on numbers.
    """
    m, n = polytope.matrix.shape
    k = polytope.bounds
    unit = _torque_unit(polytope)
    scaled = polytope.matrix[k:] * unit
    weight = np.sqrt(np.einsum("ij,ij->i", scaled, scaled))
    weight[weight == 0.0] = 1.0
    low, high = polytope.lower.copy(), polytope.upper.copy()
    crossed = low > high
    low[crossed] = high[crossed] = 0.5 * (low[crossed] + high[crossed])
    program = QuadraticProgram(
        np.diag(np.concatenate([np.full(n, _CENTRE**2), np.ones(m - k)])),
        np.zeros(n + m - k),
        np.block([[np.eye(k, n), np.zeros((k, m - k))], [scaled / weight[:, None], np.eye(m - k)]]),
        np.concatenate([low[:k] / unit[:k], low[k:] / weight]),
        np.concatenate([high[:k] / unit[:k], high[k:] / weight]),
        k,
    )
    z = np.zeros(n) if centre is None else centre / unit
    last: QpSolution | None = None
    push = np.zeros(m)
    for _ in range(_STEPS):
        program.gradient[:n] = -(_CENTRE**2) * z
        last = (solver or solver_named()).solve(program, last)
        if last.outcome is not Outcome.SOLVED:
            return _nothing(n)
        z, push = last.x[:n], last.multipliers
    return _read(polytope, unit * z, np.concatenate([unit[:k], weight]), push, crossed)


def _read(
    polytope: Polytope, torque: FloatArray, unit: FloatArray, multipliers: FloatArray, crossed: BoolArray
) -> Diagnosis:
    value = polytope.matrix @ torque
    above, below = value - polytope.upper, polytope.lower - value
    missed = np.maximum(np.maximum(above, below), 0.0)
    missed[: polytope.bounds] *= crossed[: polytope.bounds]
    slack, push = missed / unit, np.abs(multipliers)
    named = np.flatnonzero((push > _NAMED * push.max(initial=0.0)) | crossed)
    if slack.max(initial=0.0) <= _KEPT:
        named = named[:0]
    rows = named[np.argsort(-slack[named], kind="stable")]
    upper = np.where(missed[rows] > 0.0, above[rows] > below[rows], multipliers[rows] > 0.0)
    labels = tuple(polytope.labels[row] for row in rows) if polytope.labels else tuple(f"row {row}" for row in rows)
    return Diagnosis(Outcome.SOLVED, torque, rows, missed[rows], upper, labels)


def _torque_unit(polytope: Polytope) -> FloatArray:
    """(n,) half of each joint's range of torque, 1 where it has none."""
    unit = np.ones(polytope.matrix.shape[1])
    reach = 0.5 * (polytope.upper[: polytope.bounds] - polytope.lower[: polytope.bounds])
    unit[: polytope.bounds] = np.where(np.isfinite(reach) & (reach > 0.0), reach, 1.0)
    return unit


def _nothing(n: int) -> Diagnosis:
    empty = np.zeros(0)
    return Diagnosis(Outcome.FAILED, np.full(n, np.nan), empty.astype(np.int64), empty, empty.astype(bool), ())


def safe_torque(
    terms: Terms,
    damping: float | FloatArray = 0.0,
    lower: float | FloatArray = -np.inf,
    upper: float | FloatArray = np.inf,
) -> FloatArray:
    """(n,) torques that hold the robot up without any program: weight and velocity terms, and damping of the joints.

        tau = [h + M vdot - J^T f]_joints - D qdot,  clipped to lower, upper

    f is the least contact force (moments over MOMENT_ARM) that balances the base, whether or not the contacts can give
    it; what it leaves of the base's balance (in flight: all) becomes the base's vdot, joints' vdot is zero.

    Args:
        terms: At this state.
        damping: D >= 0 [N m s/rad].
        lower: Of the torques [N m].
        upper: The same.

    Returns:
        Always finite; zeros where the terms are not.
    """
    nv, joints = terms.bias.size, terms.actuated
    free = np.ones(nv, dtype=bool)
    free[joints] = False
    base = np.flatnonzero(free)
    jacobian, bias, mass = terms.contact_jacobian, terms.bias, terms.mass_matrix
    sums = jacobian.sum() + bias.sum() + mass.sum() + terms.v.sum()
    if not np.isfinite(sums):
        return np.zeros(joints.size)
    arm = np.ones(jacobian.shape[0])
    for contact, rows in zip(terms.contacts.contacts, terms.contacts.rows, strict=True):
        if contact.size == 6:
            arm[rows.start + 3 : rows.stop] = MOMENT_ARM
    try:
        push = jacobian * arm[:, None]
        force = np.linalg.lstsq(push[:, base].T, bias[base], rcond=1e-9)[0] if base.size else np.zeros(arm.size)
        rest = bias - push.T @ force
        falling = np.linalg.solve(mass[np.ix_(base, base)], rest[base]) if base.size else np.zeros(0)
    except np.linalg.LinAlgError:
        return np.zeros(joints.size)
    torque = rest[joints] - mass[np.ix_(joints, base)] @ falling - damping * terms.v[joints]
    clipped: FloatArray = np.clip(torque, lower, upper)
    return clipped if np.isfinite(clipped).all() else np.zeros(joints.size)
