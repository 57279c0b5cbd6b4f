"""An effect as it takes part in a goal: what it does at its strength, and what a fit with it can explain.

Whether two effects are the same function, whatever the motion and the known loads.

Two effects are the same function when the columns of the one are combinations of the columns of the other and of the
declared model at every state of the joint, with the same coefficients under every load:

    phi_A(q, qdot, qddot) = X(q, qdot, qddot) beta + Phi_B(q, qdot, qddot) theta                          (identity)

An identity at random states in general position, which outnumber the coefficients a hundredfold, is one everywhere,
because the columns are analytic in each direction of motion.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.regression import solve_bounded
from drake_tc.effects.base import Effect, JointNumbers, Signals
from drake_tc.effects.library import effect
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.experiments.design.joint import BalanceColumns, DesignJoint
from drake_tc.experiments.sizes import Size, acts_through_shape
from drake_tc.types import FloatArray

MOST_SHAPES = 3
FACTORS = np.geomspace(1.0 / 3.0, 3.0, 9)
"""Sizes, in units of the strength, between which the size of an effect that is a shape is looked for."""


@dataclass(frozen=True, eq=False)
class EffectForm:
    """One effect with its size, as it takes part in a goal.

    Attributes:
        effect: The effect.
        size: Its size.
        strength: Size that is put in.
        shapes: Values of its shape parameters that are tried.
    """

    effect: Effect
    size: Size
    strength: float
    shapes: tuple[Mapping[str, float], ...]

    @property
    def either_sign(self) -> bool:
        """Whether its contribution may have either sign."""
        if isinstance(self.effect, ServoGain):
            return True
        return bool(self.effect.coefficients) and self.effect.coefficients[0].lower < 0.0

    def change(self, columns: BalanceColumns, shape: Mapping[str, float]) -> FloatArray:
        """(T, p) contribution [N m] at the strength, one column for each phase."""
        if acts_through_shape(self.effect):
            return self.at_sizes(columns, np.array([self.strength]))
        return self.scaled(columns, _columns_of(columns, Term(self.effect, shape)))

    def scaled(self, columns: BalanceColumns, phi: FloatArray) -> FloatArray:
        """(T, p) contribution [N m] at the strength from Phi (T, k)."""
        if isinstance(self.effect, ServoGain):
            return self.strength * phi
        return np.asarray(self.strength * phi @ _phases(self.effect, columns.joint.numbers))

    def at_sizes(self, columns: BalanceColumns, sizes: FloatArray) -> FloatArray:
        """(T, g) contribution [N m] of an effect whose size is its shape, at several sizes."""
        terms = [Term(self.effect, {self.size.name: float(size)}) for size in sizes]
        return np.asarray(columns.changes(terms) / columns.joint.numbers.gain)

    def left(self, declared: "Projection", columns: BalanceColumns, targets: FloatArray) -> FloatArray:
        """(p,) smallest sums of squares that a fit with this effect leaves of targets (T, p), over all its parameters.

        An effect whose size is a shape leaves min_s |t - c(s)|^2, with c(s) linear between the sizes of `FACTORS`;
        another one min_theta |t - Phi theta|^2 with theta inside its bounds, the smallest over its shapes.

        Args:
            declared: Takes the declared model's columns out.
            columns: Of the motion.
            targets: What declared columns leave of the true contribution, weighted.
        """
        if acts_through_shape(self.effect):
            return _least_on_path(declared.of(self.at_sizes(columns, FACTORS * self.strength)), targets)
        spans = [declared.of(_columns_of(columns, Term(self.effect, shape))) for shape in self.shapes]
        coefficients = self.effect.parameters if isinstance(self.effect, ServoGain) else self.effect.coefficients
        low, high = (np.array([getattr(c, side) for c in coefficients]) for side in ("lower", "upper"))
        return np.asarray(np.min([_least_in_box(span, targets, low, high) for span in spans], axis=0))


@lru_cache
def _phases(effect: Effect, numbers: JointNumbers) -> FloatArray:
    """Theta (k, p) of size 1, one column for each phase."""
    return np.stack(effect.unit_coefficients(numbers), axis=-1)


def contributions(forms: Sequence[EffectForm], columns: BalanceColumns) -> list[FloatArray]:
    """(T, p) contribution [N m] of each effect at its strength and the middle one of its shapes."""
    middle = {form: form.shapes[len(form.shapes) // 2] for form in forms}
    linear = [f for f in forms if not (acts_through_shape(f.effect) or isinstance(f.effect, ServoGain))]
    known = dict(zip(linear, columns.of_each([Term(f.effect, middle[f]) for f in linear]), strict=True))
    return [f.scaled(columns, known[f]) if f in known else f.change(columns, middle[f]) for f in forms]


def _columns_of(columns: BalanceColumns, term: Term) -> FloatArray:
    """Phi (T, k) [N m] of a term; an error of the drive gain scales the torque of the effort, y/K."""
    if isinstance(term.effect, ServoGain):
        return np.asarray(columns.effort(())[:, None] / columns.joint.numbers.gain)
    return columns.of(term)


class Projection:
    """What the columns that are always fitted leave of weighted columns: the declared terms, and a free drive gain."""

    def __init__(self, columns: BalanceColumns) -> None:
        """Of the columns of a motion and the weights of its rows."""
        design = columns.design(columns.joint.declared)
        declared = design[:, 1:] if columns.joint.context.declared.get("drive_gain") else design
        self._root = np.sqrt(columns.weight)[:, None]
        self._basis = orthonormal(self._root * declared)

    def of(self, values: FloatArray) -> FloatArray:
        """(T, k) remainder of sqrt(w) times columns (T, k)."""
        weighted = self._root * values
        return np.asarray(weighted - self._basis @ (self._basis.T @ weighted))


def orthonormal(basis: FloatArray) -> FloatArray:
    """(T, r) orthonormal columns of the space of columns (T, m); columns that are zero or alike do not count twice."""
    norms = np.linalg.norm(basis, axis=0)
    live = basis[:, norms > 1e-9 * max(float(norms.max(initial=0.0)), 1e-300)]
    u, s, _ = np.linalg.svd(live / np.linalg.norm(live, axis=0), full_matrices=False)
    return np.asarray(u[:, s > 1e-7 * s.max(initial=0.0)])


def _least_on_path(path: FloatArray, targets: FloatArray) -> FloatArray:
    """(p,) smallest squared distance of targets (T, p) from the broken line 0, path_1, ..., path_g (T, g)."""
    points = np.concatenate([np.zeros((path.shape[0], 1)), path], axis=1)
    step = np.diff(points, axis=1)
    lengths = np.maximum(np.sum(step**2, axis=0), 1e-300)
    # |t - p - s d|^2 with s = d'(t - p)/|d|^2 clipped to [0, 1]
    along = step.T @ targets - np.sum(step * points[:, :-1], axis=0)[:, None]
    share = np.clip(along / lengths[:, None], 0.0, 1.0)
    apart = np.sum(points[:, :-1] ** 2, axis=0)[:, None] - 2.0 * points[:, :-1].T @ targets + np.sum(targets**2, axis=0)
    squares = apart - 2.0 * share * along + share**2 * lengths[:, None]
    return np.asarray(np.maximum(np.min(squares, axis=0), 0.0))


def _least_in_box(span: FloatArray, targets: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """(p,) smallest squared distance of targets (T, p) from span (T, k) times coefficients between bounds."""
    gram, moments = span.T @ span, span.T @ targets
    out: FloatArray = np.asarray(np.sum(targets**2, axis=0))
    if not gram.any():
        return out
    for j in range(targets.shape[1]):
        theta = solve_bounded(gram, moments[:, j], low, high)
        out[j] += theta @ gram @ theta - 2.0 * moments[:, j] @ theta
    return np.asarray(np.maximum(out, 0.0))


def form_of(joint: DesignJoint, key: str, size: Size, strength: float | None = None) -> EffectForm:
    """An effect at its typical size, or at a strength, with a few of its shapes."""
    member = effect(key)
    if acts_through_shape(member):
        shapes: tuple[Mapping[str, float], ...] = ({},)
    else:
        grid = member.shape_grid(joint.context)
        every = max(1, -(-len(grid) // MOST_SHAPES))
        shapes = tuple(grid[::every])
    return EffectForm(member, size, size.typical if strength is None else strength, shapes)


STATES = 4000
"""Random states at which an identity is tried, under each load."""
SAME = 1e-8
"""Largest share of a column that an identity may leave."""


def identity(joint: DesignJoint, truth: EffectForm, other: EffectForm, under: Sequence[DesignJoint] = ()) -> str | None:
    """The coefficients of (identity) in words, with the error at random states; None where it does not hold.

    Effects with memory or with a shape in which they are not linear are never the same function.

    Args:
        joint: The joint.
        truth: Phi_A.
        other: Phi_B.
        under: The joint with each of the loads under which it is moved; empty for the joint as it is.
    """
    if any(acts_through_shape(form.effect) for form in (truth, other)) or truth.effect.shapes or other.effect.shapes:
        return None
    motion = _random_states(joint)
    rows = np.abs(motion[1]) > 0.1 * joint.numbers.speed
    parts = [each.signals(motion, 1.0, sharp=True) for each in under or (joint,)]
    phi = np.concatenate([_columns(truth, s)[rows] for s in parts])
    names = [] if joint.context.declared.get("drive_gain") else ["effort"]
    declared = [term for term in joint.declared if term.effect.coefficients]
    names += [p.name for term in declared for p in term.effect.coefficients] + _names(other)
    basis = np.concatenate([_modelled(joint, declared, other, s)[rows] for s in parts])
    if not (np.isfinite(phi).all() and np.isfinite(basis).all()):
        return None
    scale = np.linalg.norm(basis, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    solution = np.linalg.lstsq(basis / scale, phi, rcond=1e-12)[0] / scale[:, None]
    error = float(np.max(np.abs(phi - basis @ solution)) / max(float(np.max(np.abs(phi))), 1e-300))
    if error > SAME:
        return None
    return _written(truth, names, solution, basis, phi, error)


def _modelled(joint: DesignJoint, declared: Sequence[Term], other: EffectForm, signals: Signals) -> FloatArray:
    """(T, m) columns [effort, X, Phi_B] of the declared model and of the other effect; effort only where K is free."""
    free = [] if joint.context.declared.get("drive_gain") else [signals.effort[:, None]]
    known = [term.effect.columns(signals, term.shape) for term in declared]
    return np.concatenate([*free, *known, _columns(other, signals)], axis=1)


def _columns(form: EffectForm, signals: Signals) -> FloatArray:
    """Columns (T, k) of an effect at its first shape; of an error of the drive gain, the effort."""
    if isinstance(form.effect, ServoGain):
        return signals.effort[:, None]
    return form.effect.columns(signals, form.shapes[0])


def _names(form: EffectForm) -> list[str]:
    """Names of the columns of `_columns`."""
    named = form.effect.parameters if isinstance(form.effect, ServoGain) else form.effect.coefficients
    return [p.name for p in named]


def _written(
    truth: EffectForm, names: Sequence[str], solution: FloatArray, basis: FloatArray, phi: FloatArray, error: float
) -> str:
    parts = []
    for j, name in enumerate(_names(truth)):
        size = float(np.sqrt(np.mean(phi[:, j] ** 2)))
        weights = solution[:, j] * np.sqrt(np.mean(basis**2, axis=0))
        terms = [
            f"{solution[i, j]:.6g} {names[i]}" for i in range(len(names)) if abs(weights[i]) > 1e-6 * max(size, 1e-300)
        ]
        parts.append(f"the column of {name} equals {' + '.join(terms) or '0'}")
    return f"{'; '.join(parts)} at {basis.shape[0]} random states (largest difference {error:.1g})"


def _random_states(joint: DesignJoint) -> FloatArray:
    """(4, STATES) positions, velocities, accelerations and jerks in the ranges of the logs."""
    rng = np.random.default_rng(0)
    low, high = joint.context.position_span
    speed = joint.numbers.speed
    q = rng.uniform(low, high, STATES)
    v = rng.choice([-1.0, 1.0], STATES) * rng.uniform(0.2, 1.0, STATES) * speed
    a = rng.normal(size=STATES) * max(joint.numbers.torque / max(joint.numbers.inertia, 1e-9), 1.0)
    return np.stack([q, v, a, rng.normal(size=STATES)])
