"""Whether two effects are the same function, whatever the motion and the known loads.

Two effects are the same function when the columns of the one are combinations of the columns of the other and of the
declared model at every state of the joint, with the same coefficients under every load:

    phi_A(q, qdot, qddot) = X(q, qdot, qddot) beta + Phi_B(q, qdot, qddot) theta                          (identity)

An identity at random states in general position, which outnumber the coefficients a hundredfold, is one everywhere,
because the columns are analytic in each direction of motion.
"""

from collections.abc import Sequence

import numpy as np

from drake_tc.effects.base import Effect, Signals
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.types import FloatArray

STATES = 4000
"""Random states at which an identity is tried, under each load."""
SAME = 1e-8
"""Largest share of a column that an identity may leave."""


def identity(joint: DesignJoint, truth: Effect, other: Effect, under: Sequence[DesignJoint] = ()) -> str | None:
    """The coefficients of (identity) in words, with the error at random states; None where it does not hold.

    Effects with memory or with a shape in which they are not linear are never the same function.

    Args:
        joint: The joint.
        truth: Phi_A.
        other: Phi_B.
        under: The joint with each of the loads under which it is moved; empty for the joint as it is.
    """
    if truth.shapes or other.shapes:
        return None
    motion, declared = _random_states(joint), [term.effect for term in joint.declared if term.effect.coefficients]
    rows = np.abs(motion[1]) > 0.1 * joint.numbers.speed
    parts = [each.signals(motion, 1.0, sharp=True) for each in under or (joint,)]
    free = [] if joint.context.declared.get("drive_gain") else [ServoGain()]  # K is fitted, and scales the effort
    known = [*free, *declared, other]
    phi = np.concatenate([_columns([truth], joint, s)[rows] for s in parts])
    basis = np.concatenate([_columns(known, joint, s)[rows] for s in parts])
    if not (np.isfinite(phi).all() and np.isfinite(basis).all()):
        return None
    scale = np.linalg.norm(basis, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    solution = np.linalg.lstsq(basis / scale, phi, rcond=1e-12)[0] / scale[:, None]
    error = float(np.max(np.abs(phi - basis @ solution)) / max(float(np.max(np.abs(phi))), 1e-300))
    if error > SAME:
        return None
    names = ["effort" for _ in free] + [name for each in (*declared, other) for name in _names(each)]
    sizes, contributions = (np.sqrt(np.mean(each**2, axis=0)) for each in (phi, basis))
    told = []
    for j, name in enumerate(_names(truth)):
        large = np.abs(solution[:, j]) * contributions > 1e-6 * max(float(sizes[j]), 1e-300)
        terms = [f"{solution[i, j]:.6g} {names[i]}" for i in np.flatnonzero(large)]
        told.append(f"the column of {name} equals {' + '.join(terms) or '0'}")
    return f"{'; '.join(told)} at {basis.shape[0]} random states (largest difference {error:.1g})"


def _columns(effects: Sequence[Effect], joint: DesignJoint, signals: Signals) -> FloatArray:
    """(T, k) columns of effects without shapes but given ones; of an error of the drive gain, the effort."""
    shapes = {term.effect.key: term.shape for term in joint.declared}
    each = [
        signals.effort[:, None]
        if isinstance(e, ServoGain)
        else e.columns(signals, shapes.get(e.key) or e.shape_grid(joint.context)[0])
        for e in effects
    ]
    return np.concatenate(each, axis=1)


def _names(effect: Effect) -> list[str]:
    """Names of the columns of `_columns`."""
    named = effect.parameters if isinstance(effect, ServoGain) else effect.coefficients
    return [p.name for p in named]


def _random_states(joint: DesignJoint) -> FloatArray:
    """(4, STATES) positions, velocities, accelerations and jerks in the ranges of the logs."""
    rng = np.random.default_rng(0)
    low, high = joint.context.position_span
    speed = joint.numbers.speed
    q = rng.uniform(low, high, STATES)
    v = rng.choice([-1.0, 1.0], STATES) * rng.uniform(0.2, 1.0, STATES) * speed
    a = rng.normal(size=STATES) * max(joint.numbers.torque / max(joint.numbers.inertia, 1e-9), 1.0)
    return np.stack([q, v, a, rng.normal(size=STATES)])
