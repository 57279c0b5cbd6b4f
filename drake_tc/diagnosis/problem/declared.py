"""What the owner already models: terms to fit, and known values that are taken off before any fit.

Whether a position servo holds its command between samples belongs to it (`command_is_held`). A goal that is written
once a cycle acts unchanged until the next one, so the command that acts at a sample is on average half a period T/2
older than the one recorded there. Taken for a continuous command, a stiffness K makes of it a viscous friction that is
too large by K T/2, and a delay of T/2. Free runs hold the command too.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from drake_tc.config.quoted import did_you_mean
from drake_tc.diagnosis.data.channels import HELD
from drake_tc.diagnosis.data.preparation import context_of, load_scale
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.priors import CERTAINLY_BETTER, HELD_CERTAIN, HELD_FROM_PERIOD, SAME_ERROR
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import Fit, fit
from drake_tc.effects.base import Context, Effect, SensorEffect, TorqueEffect
from drake_tc.effects.library import all_effects, effect
from drake_tc.errors import IdentificationError, RigError
from drake_tc.logs.loads import RobotLoad, unknown_form
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

ALWAYS = ("viscous", "coulomb")
RESAMPLES = 400


def on_joint(name: str, rig: Rig, joint: str) -> str:
    """A declared effect as joints of this type have it: its name, or the key of its form for the type.

    Raises:
        RigError: Joints of this type do not have the effect.
    """
    kind, member = rig.joint_type(joint), effect(name)
    if kind in member.joint_types:
        return name
    form = next((each.key for each in all_effects() if each.id == member.id and kind in each.joint_types), None)
    if form is None:
        raise RigError(
            f"{rig.source or 'rig'}: declared: {name}: {joint} is {kind}, and only {' and '.join(member.joint_types)} "
            "joints have this effect; leave it out"
        )
    return form


def effect_of(key: str) -> tuple[str, str]:
    """(effect, parameter) of a key of `declared`: `id`, `id.form`, `id.parameter` or `id.form.parameter`."""
    name, _, rest = key.partition(".")
    form, _, parameter = rest.partition(".")
    with_form = f"{name}.{form}"
    return (with_form, parameter) if any(each.key == with_form for each in all_effects()) else (name, rest)


def known_values(rig: Rig, joint: str) -> dict[str, dict[str, float]]:
    """Declared effects whose values the owner gives: id to parameters. Not the inertia, which is part of the target,
    and not viscous and Coulomb friction, which every log tells better (they hold the drive's damping too).

    Raises:
        RigError: A declared parameter is not one of its effect.
    """
    out: dict[str, dict[str, float]] = {}
    for key, value in rig.declared[joint].items():
        name, parameter = effect_of(key)
        if value is None or name in (*ALWAYS, "rotor_inertia"):
            continue
        name = on_joint(name, rig, joint)
        known = [p.name for p in effect(name).parameters]
        if parameter and parameter not in known:
            raise RigError(
                f"{rig.source or 'rig'}: declared: {name}: no parameter {parameter!r}{did_you_mean(parameter, known)}; "
                f"parameters: {', '.join(known)}"
            )
        out.setdefault(name, {})[parameter or known[0]] = value
    return {
        name: {p.name: given.get(p.name, p.default) for p in effect(name).parameters}
        for name, given in out.items()
        if can_be_held(name)
    }


def can_be_held(name: str) -> bool:
    """Whether a fit takes a declared value of the effect as it is; the logs tell those of drives and gears anew."""
    return isinstance(effect(name), TorqueEffect | SensorEffect)


def known_taken_off(samples: Samples, rig: Rig, joint: str) -> Samples:
    """The samples as if the effects of known values were not there: sensors restored, torques added to the load."""
    signals, known = samples.signals, [(effect(name), values) for name, values in known_values(rig, joint).items()]
    for member, parameters in known:
        if isinstance(member, SensorEffect):
            signals = member.restore(signals, parameters)
    extra = sum(member.torque(signals, values) for member, values in known if isinstance(member, TorqueEffect))
    return replace(samples, signals=replace(signals, known_torque=signals.known_torque + extra))


def simplest(fits: Sequence[Fit]) -> Fit:
    """The first of the fits whose cross-validated error is as small as the smallest one, up to 2 %."""
    least = min(f.cv_rms for f in fits)
    return next(f for f in fits if f.cv_rms <= (1.0 + SAME_ERROR) * least)


def require_positions(rig: Rig, joint: str, context: Context) -> None:
    """Refuse a declared effect that depends on the position where the logs have none.

    Raises:
        IdentificationError: Names the effect.
    """
    names = {on_joint(effect_of(key)[0], rig, joint) for key in rig.declared[joint]}
    for name in sorted(names):
        if effect(name).depends_on_position and not context.position_recorded:
            raise IdentificationError(
                f"joint {joint}: the declared effect {name} depends on the position, and the logs have the velocity "
                f"alone; record {joint}/position, or do not declare it"
            )


def declared_terms(rig: Rig, joint: str) -> list[str]:
    """Ids fitted with the baseline: viscous, Coulomb, and what is declared without a value that can be held."""
    known = known_values(rig, joint)
    open_keys = [key for key, value in rig.declared[joint].items() if value is None or key not in known]
    names = [on_joint(effect_of(key)[0], rig, joint) for key in open_keys]
    in_load = unknown_form(rig.load[joint]) is not None  # an unknown load has an inertia of its own
    fitted = [
        n
        for n in names
        if n not in known and not (n == "rotor_inertia" and (in_load or rig.declared[joint][n] is not None))
    ]
    return list(dict.fromkeys([*ALWAYS, *fitted]))


def fit_declared(columns: Columns, names: Sequence[str], context: Context, loads: Sequence[Effect] = ()) -> Fit:
    """The declared model: each effect at the best point of its shape grid or its declared value, in the order declared.

    A grid need not contain the declared value: that of a saturation spans the largest recorded effort, and a command
    that winds up can be many times the limit. Where links are fitted, the declared value alone is tried, because the
    first fit of a joint has no load by which it could choose.

    `loads`: of an unknown load, what it may be, the simplest first; one of them is part of the model.
    """
    best = fit(columns, [Term(effect(n)) for n in ALWAYS])
    if loads:
        best = simplest([fit(columns, [*best.terms, Term(e, s)]) for e in loads for s in e.shape_grid(context)])
    for name in names:
        if name in ALWAYS:
            continue
        member = effect(name)
        declared = _declared_shape(member, context)
        shapes = declared if declared and context.load == "links" else [*member.shape_grid(context), *declared]
        tried = [fit(columns, [*best.terms, Term(member, shape)]) for shape in shapes]
        best = simplest([*tried[len(tried) - len(declared) :], min(tried, key=lambda f: f.cv_rms)])
    return best


def _declared_shape(member: Effect, context: Context) -> list[dict[str, float]]:
    """The declared values of an effect whose parameters are its shape; none where one of them is not declared."""
    shapes = (*member.shapes, *member.given_shapes)
    if not member.shapes or [p.name for p in shapes] != [p.name for p in member.parameters]:
        return []
    given = context.declared
    own = {p.name: given.get(f"{member.key}.{p.name}", given.get(f"{member.id}.{p.name}")) for p in shapes}
    first = shapes[0].name
    own[first] = given.get(member.key, given.get(member.id, own[first]))
    return [{name: value for name, value in own.items() if value is not None}] if None not in own.values() else []


def command_is_held(build: Callable[..., Samples], rig: Rig, joint: str, loads: Sequence[Effect]) -> bool:
    """As the rig file states; else true of a position servo on a slow clock whose training runs say so.

    They say so where the declared model, with a rotor inertia, leaves a smaller error in 90 % of the block resamples
    when the command is taken to hold. What counts are the rows that lie alike on both sides of a reversal: friction
    that turns over within a small speed looks like an older command in the others. A log of few reversals has few such
    rows. Where more than half of their resamples, but fewer than 90 %, speak for a held command, all rows decide, and
    98 % of their resamples must.
    """
    if rig.command_hold is not None or rig.drive[joint] != "position_servo":
        return bool(rig.command_hold)
    load = rig.load[joint]
    if isinstance(load, RobotLoad) and load.fitted:
        return bool(build().signals.period >= HELD_FROM_PERIOD)  # the load is not yet fitted
    alike = _drop_by_hold(partial(build, both_sides=True), rig, joint, loads)
    if alike.size == 0:
        return False
    share = _better_share(alike)
    if 0.5 < share < HELD_CERTAIN:
        return _better_share(_drop_by_hold(build, rig, joint, loads)) >= CERTAINLY_BETTER
    return share >= HELD_CERTAIN


def _drop_by_hold(build: Callable[..., Samples], rig: Rig, joint: str, loads: Sequence[Effect]) -> FloatArray:
    """(B,) by how much the squared error of each block drops if the command is held, over the mean of all blocks.

    Empty on a fast clock. One number where the kernels leave other rows: nothing can be compared block by block.
    """
    continuous = build()
    if continuous.signals.period < HELD_FROM_PERIOD:
        return np.zeros(0)
    both = (known_taken_off(each, rig, joint) for each in (continuous, build(effort_age=HELD)))
    without, with_hold = (_block_errors(each, rig, joint, loads) for each in both)
    if without.size != with_hold.size:
        return np.array([1.0 - with_hold.sum() / without.sum()])
    return np.asarray((without - with_hold) / without.mean())


def _block_errors(samples: Samples, rig: Rig, joint: str, loads: Sequence[Effect]) -> FloatArray:
    """(B,) cross-validated squared error by block of the declared model with a rotor inertia [effort^2]."""
    names = declared_terms(rig, joint)
    inertia = [] if samples.load_unknown or "rotor_inertia" in rig.declared[joint] else ["rotor_inertia"]
    columns = Columns(samples, declared_gain=load_scale(rig, joint).gain)
    return fit_declared(columns, [*names, *inertia], context_of(samples, rig, joint), loads).block_sse


def _better_share(difference: FloatArray, seed: int = 0) -> float:
    """Share of resamples of pairs of neighbouring blocks in which a sum of differences (B,) is positive."""
    if difference.size % 2:
        difference = np.append(difference, 0.0)
    pairs = difference.reshape(-1, 2).sum(axis=1)
    rng = np.random.default_rng(seed)
    draws = rng.integers(0, pairs.size, (RESAMPLES, pairs.size))
    return float(np.mean(pairs[draws].sum(axis=1) > 0.0))
