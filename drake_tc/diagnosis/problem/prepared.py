"""A joint ready for a search: both sides filtered (`preparation`), its declared model fitted and known to columns.

Errors of a joint's own sensors within tolerance are part of the model before and of the model after
(`effects.within_tolerance`): theta ~ N(0, diag(t_i^2)), cut off at 3 t_i. Least squares with this prior counts N rows
that are correlated in time as their n effective samples.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial, wraps
from typing import Concatenate, ParamSpec, TypeVar

import numpy as np

from drake_tc.diagnosis.data.channels import HELD
from drake_tc.diagnosis.data.preparation import build_samples, context_of, load_scale
from drake_tc.diagnosis.data.samples import Samples, SensorPrior
from drake_tc.diagnosis.priors import MAX_CONDITION
from drake_tc.diagnosis.problem.columns import Columns, Term, coefficients_by_term
from drake_tc.diagnosis.problem.declared import (
    command_is_held,
    declared_terms,
    fit_declared,
    known_taken_off,
    require_positions,
)
from drake_tc.diagnosis.problem.drive_gain import at_reverse_regression, require_consistent_signs, require_torque_unit
from drake_tc.diagnosis.problem.regression import Fit, fit, noise_floor
from drake_tc.diagnosis.problem.unknown_load import (
    possible_loads,
    require_identified_load,
    with_fitted_load,
    with_torque_span,
)
from drake_tc.effects.base import Context, plain_signals
from drake_tc.effects.library import effect
from drake_tc.effects.within_tolerance import WithinTolerance, within_tolerance
from drake_tc.errors import IdentificationError
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.identification.regression import least_squares
from drake_tc.logs.record import Run
from drake_tc.logs.rig import COMMAND_COLUMN, Rig

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
    errors = _errors_of(context)
    if errors is not None:
        first, other = (_weighed(each, first, plain) for each in (first, other))
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


def _errors_of(context: Context) -> WithinTolerance | None:
    """The errors that are part of a joint's model, or None where no tolerance is declared that concerns it.

    A torque sensor's scale counts without a declared inertia too: the balance does not tell it, but the scale of drive
    gain and friction is no surer than the sensor's. With a robot's model the encoders' zeros are not fitted.
    """
    found = []
    for name, size in context.tolerances.items():
        if name.startswith("torque_sensor"):
            acts = context.load == "torque"
        else:
            of_model = name == "encoder_offset" and context.load in ("robot", "links")
            acts = not of_model and not effect(name).unavailable(context)
        if acts:
            found.append((name, size))
    return within_tolerance(tuple(found)) if found else None


def _weighed(columns: Columns, rows: Columns, fitted: Fit) -> Columns:
    """The columns with the errors' prior weighed by what a fit to the training rows `rows` leaves.

    Effective samples are N over the integrated autocorrelation time, no lag counted across runs; at least 3.
    """
    residual = rows.target - rows.design(fitted.terms) @ fitted.beta
    lengths = [int(n) for n in np.bincount(rows.samples.run) if n]
    effective = max(residual.size / correlation_time(residual - residual.mean(), lengths), 3.0)
    prior = SensorPrior(variance=float(np.mean(residual**2)), share=effective / residual.size)
    return columns.changed(samples=replace(columns.samples, sensor_prior=prior))


def without_errors(runs: Sequence[Run], rig: Rig, joint: str, fitted: Fit) -> list[Run]:
    """The runs as the joint's sensors would have recorded them without the errors within tolerance."""
    for term, theta in coefficients_by_term(fitted.terms, fitted.beta):
        if isinstance(term.effect, WithinTolerance):
            values = term.effect.physical(theta, {}, fitted.gain)
            effort = f"{joint}/{COMMAND_COLUMN[rig.drive[joint]]}"
            bias = fitted.gain * values.get("bias_torque", 0.0)
            return [_restored(run, joint, term.effect, values, {effort: bias}) for run in runs]
    return list(runs)


def _restored(
    run: Run, joint: str, errors: WithinTolerance, values: Mapping[str, float], bias: Mapping[str, float]
) -> Run:
    """The run without the errors, and without the constant errors `bias` of the efforts among its columns."""
    names = {"load_torque": f"{joint}/torque", "position": f"{joint}/position"}
    known = {signal: run.columns[name] for signal, name in names.items() if name in run.columns}
    restored = errors.restore(plain_signals(run.time.size, known), values)
    changed = {names[signal]: getattr(restored, signal) for signal in known}
    changed |= {name: run.columns[name] - by for name, by in bias.items() if name in run.columns}
    return replace(run, columns=dict(run.columns) | changed)
