"""Whether two effects are the same function, whatever the motion and the known loads.

Two effects are the same function when the columns of the one are combinations of the columns of the other and of the
declared model at every state of the joint, with the same coefficients under every load:

    phi_A(q, qdot, qddot) = X(q, qdot, qddot) beta + Phi_B(q, qdot, qddot) theta                          (identity)

An identity at random states in general position, which outnumber the coefficients a hundredfold, is one everywhere,
because the columns are analytic in each direction of motion.
"""

from collections.abc import Sequence

import numpy as np

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.effects.base import Signals
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.experiments.design.forms import EffectForm
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.sizes import acts_through_shape
from drake_tc.types import FloatArray

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
        parts.append(f"column of {name} = {' + '.join(terms) or '0'}")
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
