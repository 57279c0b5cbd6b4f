"""What a design is for: parameters, two effects that shall be told apart, or everything; whether it can be reached."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from drake_tc.effects.library import effect, looked_for
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.criteria import AllEffects, Criterion, Discrimination, Parameters
from drake_tc.experiments.design.forms import EffectForm, form_of, identity
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.known import carrying, trial_load
from drake_tc.experiments.sizes import is_late, size_of

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
    goal: Goal, joint: DesignJoint, duration: float, *, smallest: bool = False, under: Sequence[DesignJoint] = ()
) -> Criterion:
    """The criterion of a goal.

    Args:
        goal: What the design is for.
        joint: The joint.
        duration: Of the experiment [s].
        smallest: E- instead of D-optimality.
        under: The joint with each of the known loads under which it is moved; empty for the joint as it is.

    Raises:
        ParamsError: An effect that these logs cannot show, or two effects that are the same function.
    """
    if goal.kind == "tell":
        first, second = _alike_late([_form(joint, key, goal) for key in goal.effects], goal)
        orders = _orders(joint, first, second, under)
        if not orders:
            require_different(joint, first, second, under)
            truth, other = _larger(first, second)[0]
            raise ParamsError(
                f"while the joint slides, {other.effect.key} describes all that {truth.effect.key} does with fewer "
                f"parameters, so no motion shows {truth.effect.key}: {identity(joint, truth, other, under)}"
                f"{_by_loads(joint, first, second, under)}"
            )
        ties = tuple(each for pair in ((first, second), (second, first)) for each in _ties(joint, *pair, under))
        return Discrimination(joint, orders, duration, ties)
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
    from drake_tc.report.notes import ISOLATES

    how = ISOLATES.get(effect_id, "design an experiment by hand")
    return f"to show {effect_id} alone, {how}"


def require_different(
    joint: DesignJoint, first: EffectForm, second: EffectForm, under: Sequence[DesignJoint] = ()
) -> None:
    """Refuse two effects each of which can be written as the other, with the identity that proves it.

    Where only the first can be written as the second, the second has more to it, and a motion can show that.

    Raises:
        ParamsError: One line with the identity and its largest error.
    """
    proof = identity(joint, first, second, under)
    if proof is not None and identity(joint, second, first, under) is not None:
        raise ParamsError(
            f"{first.effect.key} and {second.effect.key} are the same function while the joint slides, so no motion "
            f"distinguishes them: {proof}; {_isolated(first.effect.id)}; {_isolated(second.effect.id)}"
            f"{_by_loads(joint, first, second, under)}"
        )


def _larger(first: EffectForm, second: EffectForm) -> list[tuple[EffectForm, EffectForm]]:
    """(truth, other) where the other has no more parameters.

    Of two models that fit equally well a diagnosis takes the one with fewer parameters, so that only the other one has
    to be distinguished from it.
    """
    pairs = ((first, second), (second, first))
    return [(t, o) for t, o in pairs if o.effect.degrees_of_freedom <= t.effect.degrees_of_freedom]


def _orders(
    joint: DesignJoint, first: EffectForm, second: EffectForm, under: Sequence[DesignJoint]
) -> tuple[tuple[EffectForm, EffectForm], ...]:
    """(truth, other) in which some motion under the loads shows that the truth is not the other."""
    return tuple(pair for pair in _larger(first, second) if identity(joint, *pair, under) is None)


def _by_loads(joint: DesignJoint, first: EffectForm, second: EffectForm, under: Sequence[DesignJoint]) -> str:
    """That known loads tell two effects apart which no motion does; empty where they do not either."""
    loaded = _trial(joint, under)
    if not loaded or not _orders(joint, first, second, loaded):
        return ""
    shape = "MASS" if joint.context.joint_type == "prismatic" else "MASS@ARM"
    return f"; motions under known loads do distinguish them: name the loads that you have, --load 0 --load {shape}"


def _trial(joint: DesignJoint, under: Sequence[DesignJoint]) -> tuple[DesignJoint, ...]:
    """The joint without and with a load, to try whether loads help; empty where several are given, or none can be."""
    load = None if len(under) > 1 else trial_load(joint)
    return () if load is None else (joint, carrying(joint, load))


def _ties(
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
        form = form_of(joint, member.key, size_of(member, joint.numbers, joint.context))
        proof = identity(joint, truth, form, under)
        if proof is not None:
            loaded = _trial(joint, under)
            helps = bool(loaded) and identity(joint, truth, form, loaded) is None
            out.append((truth.effect.key, member.key, proof + ("; motions under known loads (--load) do" * helps)))
    return out
