"""What a design is for: parameters, two effects that shall be told apart, or everything; and whether it can be reached.

Two effects are the same function when the columns of the one are combinations of the columns of the other and of the
declared model at every state of the joint, whatever the motion:

    phi_A(q, qdot, qddot) = X(q, qdot, qddot) beta + Phi_B(q, qdot, qddot) theta                          (identity)

An identity at random states in general position, which outnumber the coefficients a hundredfold, is one everywhere,
because the columns are analytic in each direction of motion.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from drake_tc.effects.base import Signals
from drake_tc.effects.library import effect, looked_for
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.errors import ParamsError
from drake_tc.experiments.check.contributions import is_late
from drake_tc.experiments.design.criteria import AllEffects, Criterion, Parameters
from drake_tc.experiments.design.discrimination import Discrimination
from drake_tc.experiments.design.forms import EffectForm, form_of
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.sizes import acts_through_shape, size_of
from drake_tc.types import FloatArray

GoalKind = Literal["parameters", "tell", "all"]
STATES = 4000
"""Random states at which an identity is tried."""
SAME = 1e-8
"""Largest share of a column that an identity may leave."""


@dataclass(frozen=True)
class Goal:
    """What a design is for.

    Attributes:
        kind: Of the goal.
        effects: Keys or ids of the two effects of "tell"; effects estimated along for "parameters". An id stands for
            its first form that a joint's logs can show.
        strengths: Sizes of effects that are known, by id; typical ones are taken for the others.
    """

    kind: GoalKind
    effects: tuple[str, ...] = ()
    strengths: Mapping[str, float] = field(default_factory=dict)

    @property
    def whole(self) -> bool:
        """Whether it asks for the parameters of the declared model alone, as a whole robot's motion does."""
        return self.kind == "parameters" and not self.effects

    @property
    def text(self) -> str:
        """As on the command line."""
        return self.kind if self.kind != "tell" else f"tell:{','.join(self.effects)}"


def parse_goal(text: str) -> Goal:
    """A goal from the command line.

    Raises:
        ParamsError: Another word, or `tell:` without two different effects.
    """
    kind, _, rest = text.partition(":")
    names = tuple(name.strip() for name in rest.split(",") if name.strip())
    if kind == "tell":
        if len(names) != 2 or effect(names[0]).key == effect(names[1]).key:
            raise ParamsError(f"goal {text!r}: expected two different effects, as in tell:stribeck,viscous_power")
        return Goal("tell", names)
    if kind == "parameters":
        for name in names:
            effect(name)
        return Goal("parameters", names)
    if kind == "all" and not rest:
        return Goal("all")
    raise ParamsError(f"goal {text!r}: expected parameters, tell:A,B or all")


def criterion_of(goal: Goal, joint: DesignJoint, duration: float, *, smallest: bool = False) -> Criterion:
    """The criterion of a goal.

    Raises:
        ParamsError: An effect that these logs cannot show, or two effects that are the same function.
    """
    if goal.kind == "tell":
        forms = _alike_late([_form(joint, key, goal) for key in goal.effects], goal)
        require_different(joint, forms[0], forms[1])
        # of two models that fit equally well a diagnosis takes the one with fewer parameters, so that only the other
        # one has to be distinguished from it
        pairs = ((forms[0], forms[1]), (forms[1], forms[0]))
        larger = [(t, o) for t, o in pairs if o.effect.degrees_of_freedom <= t.effect.degrees_of_freedom]
        orders = tuple(pair for pair in larger if identity(joint, *pair) is None)
        if not orders:
            truth, other = larger[0]
            raise ParamsError(
                f"while the joint slides, {other.effect.key} describes all that {truth.effect.key} does with fewer "
                f"parameters, so no motion shows {truth.effect.key}: {identity(joint, truth, other)}"
            )
        return Discrimination(joint, orders, duration, tuple(each for pair in pairs for each in _ties(joint, *pair)))
    if goal.kind == "parameters":
        return Parameters(joint, tuple(_form(joint, key, goal) for key in goal.effects), duration, smallest)
    taken = {t.effect.id for t in joint.declared} | set(joint.context.declared)
    forms = [
        form_of(joint, e.key, size_of(e, joint.numbers, joint.context))
        for e in looked_for(joint.context)
        if e.id not in taken and not e.unavailable(joint.context) and _computable(joint, e.key)
    ]
    return AllEffects(joint, tuple(forms), duration)


def _computable(joint: DesignJoint, key: str) -> bool:
    """Whether the effect can be computed for a motion that was not recorded: it needs no temperature or supply."""
    member = effect(key)
    return (
        not member.needs and key not in ("servo_gain", "torque_sensor_drift") and bool(member.shape_grid(joint.context))
    )


def _form(joint: DesignJoint, key: str, goal: Goal) -> EffectForm:
    member = effect(key)
    if key == member.id:
        forms = [e for e in looked_for(joint.context) if e.id == key and not e.unavailable(joint.context)]
        member = forms[0] if forms else member
    obstacle = member.unavailable(joint.context)
    if obstacle:
        raise ParamsError(f"joint {joint.name}: {key} cannot be looked for: {obstacle.statement}")
    if member.needs:
        raise ParamsError(
            f"joint {joint.name}: {key} depends on {', '.join(sorted(member.needs))}, which a motion alone does not "
            f"set; {_isolated(member.id)}"
        )
    size = size_of(member, joint.numbers, joint.context)
    return form_of(joint, member.key, size, goal.strengths.get(member.id))


def _alike_late(forms: list[EffectForm], goal: Goal) -> list[EffectForm]:
    """A delay and a lag imitate each other at the same time: one whose size is not known has that of the other."""
    known = [form.strength for form in forms if form.effect.id in goal.strengths]
    if len(known) != 1 or not all(is_late(form.effect) for form in forms):
        return forms
    return [replace(form, strength=known[0]) for form in forms]


def _isolated(effect_id: str) -> str:
    from drake_tc.report.sentences.experiments import ISOLATES

    return f"to show it alone, {ISOLATES[effect_id]}" if effect_id in ISOLATES else "design an experiment by hand"


def require_different(joint: DesignJoint, first: EffectForm, second: EffectForm) -> None:
    """Refuse two effects each of which can be written as the other, with the identity that proves it.

    Where only the first can be written as the second, the second has more to it, and a motion can show that.

    Raises:
        ParamsError: One line with the identity and its largest error.
    """
    proof = identity(joint, first, second)
    if proof is not None and identity(joint, second, first) is not None:
        raise ParamsError(
            f"{first.effect.key} and {second.effect.key} are the same function while the joint slides, so no motion "
            f"distinguishes them: {proof}; {_isolated(first.effect.id)}, or {_isolated(second.effect.id)}"
        )


def _ties(joint: DesignJoint, truth: EffectForm, other: EffectForm) -> list[tuple[str, str, str]]:
    """(truth, form, proof) for the forms of the other effect that contain the truth with no more parameters.

    A diagnosis takes the model with fewer parameters, so that a larger one that contains the truth is no alternative.
    """
    out = []
    for member in looked_for(joint.context):
        small = member.degrees_of_freedom <= truth.effect.degrees_of_freedom
        if member.id != other.effect.id or not small or member.unavailable(joint.context):
            continue
        proof = identity(joint, truth, form_of(joint, member.key, size_of(member, joint.numbers, joint.context)))
        if proof is not None:
            out.append((truth.effect.key, member.key, proof))
    return out


def identity(joint: DesignJoint, truth: EffectForm, other: EffectForm) -> str | None:
    """The coefficients of (identity) in words, with the error at random states; None where it does not hold.

    Effects with memory or with a shape in which they are not linear are never the same function.
    """
    if any(acts_through_shape(form.effect) for form in (truth, other)) or truth.effect.shapes or other.effect.shapes:
        return None
    motion = _random_states(joint)
    signals = replace(joint.signals(motion, 1.0), direction=np.sign(motion[1]))
    rows = np.abs(motion[1]) > 0.1 * joint.numbers.speed
    phi = _columns(truth, signals)[rows]
    gain_declared = bool(joint.context.declared.get("drive_gain"))
    names = [] if gain_declared else ["effort"]
    blocks = [] if gain_declared else [signals.effort[rows, None]]
    for term in joint.declared:
        if term.effect.coefficients:
            blocks.append(term.effect.columns(signals, term.shape)[rows])
            names += [p.name for p in term.effect.coefficients]
    blocks.append(_columns(other, signals)[rows])
    names += _names(other)
    basis = np.concatenate(blocks, axis=1)
    if not (np.isfinite(phi).all() and np.isfinite(basis).all()):
        return None
    scale = np.linalg.norm(basis, axis=0)
    solution = np.linalg.lstsq(basis / scale, phi, rcond=1e-12)[0] / scale[:, None]
    error = float(np.max(np.abs(phi - basis @ solution)) / max(float(np.max(np.abs(phi))), 1e-300))
    if error > SAME:
        return None
    return _written(truth, names, solution * 1.0, basis, phi, error)


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
