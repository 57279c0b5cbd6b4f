"""A joint ready for a search: both sides filtered (`preparation`), its declared model fitted and known to columns."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial, wraps
from typing import Concatenate, ParamSpec, TypeVar

from drake_tc.diagnosis.data.channels import HELD
from drake_tc.diagnosis.data.preparation import build_samples, context_of, load_scale
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.declared import (
    command_is_held,
    declared_terms,
    fit_declared,
    known_taken_off,
    require_positions,
)
from drake_tc.diagnosis.problem.drive_gain import at_reverse_regression, require_consistent_signs, require_torque_unit
from drake_tc.diagnosis.problem.regression import fit, noise_floor
from drake_tc.diagnosis.problem.sensor_errors import errors_of, weighed
from drake_tc.diagnosis.problem.unknown_load import (
    possible_loads,
    require_identified_load,
    with_fitted_load,
    with_torque_span,
)
from drake_tc.diagnosis.thresholds import MAX_CONDITION
from drake_tc.effects.base import Context
from drake_tc.errors import IdentificationError
from drake_tc.identification.regression import least_squares
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig

P = ParamSpec("P")
R = TypeVar("R")
OfJoint = Callable[Concatenate[Sequence[Run], Sequence[Run], Rig, str, P], R]


def errors_in_joint_units(function: OfJoint[P, R]) -> OfJoint[P, R]:
    """The function of (training runs, held-out runs, rig, joint, ...), whose errors have the units of the joint."""

    @wraps(function)
    def told(
        train: Sequence[Run], held: Sequence[Run], rig: Rig, joint: str, /, *args: P.args, **kwargs: P.kwargs
    ) -> R:
        try:
            return function(train, held, rig, joint, *args, **kwargs)
        except IdentificationError as error:
            if not rig.units_of(joint).slides:
                raise
            raise IdentificationError(rig.units_of(joint).text(str(error))) from error

    return told


@dataclass(frozen=True, eq=False)
class Prepared:
    """One joint with its declared model.

    Attributes:
        train, held: Columns of both sides that know the declared model's coefficients.
        terms: The declared model.
        floor: Noise floor [effort].
        context: What the training logs offer to the effects.
        declared: Ids of all that the owner models, fitted or known.
    """

    train: Columns
    held: Columns
    terms: tuple[Term, ...]
    floor: float
    context: Context
    declared: tuple[str, ...]


@contextmanager
def _naming(split: str) -> Iterator[None]:
    """Say in a refusal which runs it concerns."""
    try:
        yield
    except IdentificationError as error:
        raise IdentificationError(f"{split}: {error}") from None


Build = Callable[..., Samples]


def _samples(build: Build, train_runs: Sequence[Run], held_runs: Sequence[Run]) -> tuple[Samples, Samples]:
    """Both splits under the training runs' kernels. A wide final kernel gives way to the narrowest one where it would
    leave too few rows of held-out runs, whose strokes may be shorter.
    """
    with _naming("training runs"):
        train = build(train_runs)
    if not held_runs:
        return train, train
    same = partial(build, width_s=train.light.width_s, at_rest=train.resolution.speed_at_rest)
    with _naming("held-out runs"):
        try:
            return train, same(held_runs, final_s=train.kernel.width_s)
        except IdentificationError:
            narrow = train.light.actual_width_s
            if train.kernel.width_s <= narrow:
                raise
            return same(train_runs, final_s=narrow), same(held_runs, final_s=narrow)


@errors_in_joint_units
def prepare_joint(
    train_runs: Sequence[Run],
    held_runs: Sequence[Run],
    rig: Rig,
    joint: str,
    common: Sequence[Term] = (),
    sampled_late: float = 0.0,
    command_held: bool | None = None,
) -> Prepared:
    """Filter one joint's runs, take off what is known of it and fit its declared model.

    Args:
        train_runs: To fit.
        held_runs: Held-out runs; where there are none, the training rows stand for them.
        rig: Says drive, load and what is declared.
        joint: Which.
        common: Terms of all joints, which the declared model has besides the joint's own.
        sampled_late: Age of the effort beyond that of a held command [sampling periods].
        command_held: Whether position servos hold their commands, where that is decided; None lets this joint decide.

    Raises:
        IdentificationError: the joint hardly moves in the training or in the held-out runs, or the training runs cannot
            identify the declared model.
    """
    loads = possible_loads(rig, joint)
    build = partial(build_samples, rig=rig, joint=joint)
    servo = rig.drive[joint] == "position_servo"
    if command_held is None or not servo:
        command_held = command_is_held(partial(build, train_runs), rig, joint, loads)
    held_for = HELD if command_held else 0.0
    build = partial(build, effort_age=held_for + sampled_late)
    train, held = _samples(build, train_runs, held_runs)
    context = context_of(train, rig, joint)
    require_positions(rig, joint, context)
    train, held = (known_taken_off(each, rig, joint) for each in (train, held))
    scale = load_scale(rig, joint)
    first, other = (Columns(each, declared_gain=scale.gain) for each in (train, held))
    plain = fit_declared(first, declared_terms(rig, joint), context, loads)
    plain = fit(first, [*plain.terms, *common]) if common else plain
    if train.load_unknown:
        require_identified_load(first, plain, joint, context)
    elif context.load != "links":
        names = ["drive gain", *(p.name for t in plain.terms for p in t.effect.coefficients)]
        least_squares(first.design(plain.terms), first.target, names=names, max_condition=MAX_CONDITION)
    if context.load != "links":  # else the load is not yet fitted
        require_torque_unit(first, rig, joint, context.load)
        require_consistent_signs(first, plain, rig, joint, context.load)
        plain = at_reverse_regression(first, plain, context.drive)
    context = replace(context, tolerances=rig.joint_sensors(joint).tolerances(context.drive, plain.gain))
    errors = errors_of(context)
    if errors is not None:
        first, other = (weighed(each, first, plain) for each in (first, other))
        plain = fit(first, [*plain.terms, Term(errors)])
    first, other = (with_fitted_load(c.with_model(plain.terms, plain.beta, servo=servo), plain) for c in (first, other))
    return Prepared(
        train=first,
        held=other,
        terms=plain.terms,
        floor=noise_floor(first, plain),
        context=with_torque_span(context, first.samples),
        declared=(*(t.effect.id for t in plain.terms), *(key.partition(".")[0] for key in rig.declared[joint])),
    )
