"""What a design is for: parameters, two effects that shall be told apart, or everything; whether it can be reached."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from drake_tc.effects.base import Effect
from drake_tc.effects.library import effect, looked_for
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.criteria import (
    AllEffects,
    Criterion,
    Discrimination,
    EffectForm,
    Parameters,
    form_of,
)
from drake_tc.experiments.design.identity import identity
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.loads import carrying, trial_load
from drake_tc.experiments.sizes import is_late
from drake_tc.report.notes import ISOLATES

GoalKind = Literal["parameters", "tell", "all"]


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


def criterion_of(
    goal: Goal, joint: DesignJoint, *, smallest: bool = False, under: Sequence[DesignJoint] = ()
) -> Criterion:
    """The criterion of a goal.

    Args:
        goal: What the design is for.
        joint: The joint.
        smallest: E- instead of D-optimality.
        under: The joint with each of the known loads under which it is moved; empty for the joint as it is.

    Raises:
        ParamsError: An effect that these logs cannot show, or two effects that are the same function.
    """
    if goal.kind == "parameters":
        return Parameters(joint, tuple(_form(joint, key, goal) for key in goal.effects), smallest)
    if goal.kind == "tell":
        return _told_apart(joint, _alike_late([_form(joint, key, goal) for key in goal.effects], goal), under)
    taken = {t.effect.id for t in joint.declared} | set(joint.context.declared)
    listed = [e for e in looked_for(joint.context) if e.id not in taken and not e.unavailable(joint.context)]
    return AllEffects(tuple(form_of(joint, e.key) for e in listed if _computable(joint, e)))


def _computable(joint: DesignJoint, member: Effect) -> bool:
    """Whether the effect can be computed for a motion that was not recorded: it needs no temperature or supply."""
    never = member.needs or member.key in ("servo_gain", "torque_sensor_drift")
    return not never and bool(member.shape_grid(joint.context))


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
            f"set; {_isolated(member)}"
        )
    return form_of(joint, member.key, goal.strengths.get(member.id))


def _alike_late(forms: list[EffectForm], goal: Goal) -> list[EffectForm]:
    """A delay and a lag imitate each other at the same time: one whose size is not known has that of the other."""
    known = [form.strength for form in forms if form.effect.id in goal.strengths]
    if len(known) != 1 or not all(is_late(form.effect) for form in forms):
        return forms
    return [replace(form, strength=known[0]) for form in forms]


def _isolated(member: Effect) -> str:
    how = ISOLATES.get(member.id, "design an experiment by hand")
    return f"to show {member.id} alone, {how}"


Order = tuple[EffectForm, EffectForm]
"""An effect that is taken for the truth, and the other one."""


def _told_apart(joint: DesignJoint, forms: Sequence[EffectForm], under: Sequence[DesignJoint]) -> Discrimination:
    """The criterion for two effects.

    Raises:
        ParamsError: No motion shows that one of them is not the other; with the identity that proves it.
    """
    first, second = forms
    pairs = ((first, second), (second, first))
    # of two models that fit equally well a diagnosis takes the one with fewer parameters
    orders = [(t, o) for t, o in pairs if o.effect.degrees_of_freedom <= t.effect.degrees_of_freedom]
    apart = _apart(joint, orders, under)
    if apart:
        contained = [each for pair in pairs for each in _contained(joint, *pair, under)]
        return Discrimination(apart, tuple(contained))
    proof, back = (identity(joint, a.effect, b.effect, under) for a, b in pairs)
    if proof is not None and back is not None:
        text = f"{first.effect.key} and {second.effect.key} are the same function while the joint slides, so no motion "
        text += f"distinguishes them: {proof}; {_isolated(first.effect)}; {_isolated(second.effect)}"
    else:
        truth, other = (each.effect for each in orders[0])
        text = f"while the joint slides, {other.key} describes all that {truth.key} does with fewer parameters, so no "
        text += f"motion shows {truth.key}: {identity(joint, truth, other, under)}"
    loaded = _trial(joint, under)
    if loaded and _apart(joint, orders, loaded):
        shape = "MASS" if joint.context.joint_type == "prismatic" else "MASS@ARM"
        text += "; motions under known loads do distinguish them: name the loads that you have, --load 0 --load "
        text += shape
    raise ParamsError(text)


def _apart(joint: DesignJoint, orders: Sequence[Order], under: Sequence[DesignJoint]) -> tuple[Order, ...]:
    """Those in which some motion under the loads shows that the truth is not the other."""
    return tuple((t, o) for t, o in orders if identity(joint, t.effect, o.effect, under) is None)


def _trial(joint: DesignJoint, under: Sequence[DesignJoint]) -> tuple[DesignJoint, ...]:
    """The joint without and with a load, to try whether loads help; empty where several are given, or none can be."""
    load = None if len(under) > 1 else trial_load(joint)
    return () if load is None else (joint, carrying(joint, load))


def _contained(
    joint: DesignJoint, truth: EffectForm, other: EffectForm, under: Sequence[DesignJoint]
) -> list[tuple[str, str, str]]:
    """(truth, form, proof) for the forms of the other effect that contain the truth with no more parameters.

    A diagnosis takes the model with fewer parameters, so that a larger one that contains the truth is no alternative.
    """
    out = []
    for member in looked_for(joint.context):
        small = member.degrees_of_freedom <= truth.effect.degrees_of_freedom
        if member.id != other.effect.id or not small or member.unavailable(joint.context):
            continue
        proof = identity(joint, truth.effect, member, under)
        if proof is not None:
            loaded = _trial(joint, under)
            helps = bool(loaded) and identity(joint, truth.effect, member, loaded) is None
            out.append((truth.effect.key, member.key, proof + "; motions under known loads (--load) do" * helps))
    return out
