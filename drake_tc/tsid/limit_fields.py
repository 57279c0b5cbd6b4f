"""Limits from YAML: which kinds there are, which keys each has, and how another package adds one."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.extensions import LIMITS
from drake_tc.robot import fields
from drake_tc.robot.fields import Reader
from drake_tc.tsid.limits.acceleration import AccelerationLimit
from drake_tc.tsid.limits.base import Limit
from drake_tc.tsid.limits.capture_point import CapturePointLimit
from drake_tc.tsid.limits.torque import TorqueLimit
from drake_tc.tsid.limits.wrench_cone import WrenchCones
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.task_fields import checked_kind

NEVER_LEFT_OUT = ("torque", "contact", "acceleration")
"""Kinds that a controller has with their defaults unless its file says null."""


@dataclass(frozen=True)
class LimitKind:
    """A kind of limit as a controller file writes it: `KIND: {keys}`.

    Attributes:
        make: Called with the model and the controller's period [s], then with the keys that the file gives as keywords;
            returns the limit.
        required, optional: Key to its reader, as in `drake_tc.tsid.task_fields.TaskKind`.

    Example:
        >>> LimitKind(lambda model, period, *, watts: None, required={"watts": float}).required["watts"].__name__
        'float'
    """

    make: Callable[..., Limit]
    required: Mapping[str, Reader] = field(default_factory=dict)
    optional: Mapping[str, Reader] = field(default_factory=dict)


def register_limit(kind: str, reader: LimitKind) -> None:
    """Let the controller files of this process use KIND in their limits.

    A package does the same for every process by an entry point of the group `drake_tc.tsid.limits`, whose name is the
    kind and whose object is a LimitKind.

    Raises:
        ParamsError: the kind is taken, or `reader` is no LimitKind.

    Example:
        >>> register_limit("watts", LimitKind(lambda model, period, *, watts: None, required={"watts": float}))
    """
    if kind in _KINDS:
        raise ParamsError(f"limit kind {kind!r}: this name is already taken; kinds: {', '.join(_KINDS)}")
    LIMITS.add(kind, checked_kind(kind, reader, LimitKind))


def read_limits(where: str, entry: object, model: TsidModel, period: float) -> tuple[Limit, ...]:
    """The limits of a controller: torque, contact and acceleration unless they are null.

    Args:
        where: Of the entry, for messages.
        entry: Mapping of kind to its keys.
        model: Of the robot.
        period: Of the controller [s].

    Raises:
        ParamsError: an unknown kind or key, or a value that is not possible.
    """
    possible = (*_KINDS, *LIMITS.names())
    given = {name: {} for name in NEVER_LEFT_OUT} | fields.mapping(where, entry, optional=possible)
    made = []
    for kind, keys in given.items():
        if keys is None or (kind == "contact" and not model.contacts):
            continue
        made.append(_limit(f"{where}.{kind}", kind, keys, model, period))
    return tuple(made)


def _limit(where: str, kind: str, keys: object, model: TsidModel, period: float) -> Limit:
    reader = _KINDS[kind] if kind in _KINDS else LIMITS.get(kind, lambda n, made: checked_kind(n, made, LimitKind))
    values = fields.read_keys(where, keys, reader.required, reader.optional)
    try:
        return reader.make(model, period, **values)
    except ParamsError as error:
        raise ParamsError(f"{where}: {error}") from None


def _torque(model: TsidModel, tick: float, share: float = 1.0) -> Limit:
    return TorqueLimit.of(model.robot, share)


def _contact(model: TsidModel, tick: float, pyramid: Any = "inner") -> Limit:
    return WrenchCones(model.contacts, pyramid=pyramid)


def _acceleration(
    model: TsidModel, tick: float, period: float | None = None, margin: float = 0.0, **values: float | list[float]
) -> Limit:
    n = len(model.robot.joints)
    arrays: dict[str, Any] = {key: np.array(value) for key, value in values.items()}
    for key, value in arrays.items():
        if value.ndim and value.size != n:
            raise ParamsError(f"{key}: expected a number or {n} of them, one a joint, got {value.size}")
    held = _held(period, tick)
    return AccelerationLimit.of(model.robot, model.actuated, model.nv, period=held, margin=margin, **arrays)


def _capture_point(model: TsidModel, tick: float, period: float | None = None, margin: float = 0.0) -> Limit:
    return CapturePointLimit(model.contacts, period=_held(period, tick), margin=margin)


def _held(period: float | None, tick: float) -> float:
    """How long an acceleration is taken to last: the controller's period or more, as it decides no earlier."""
    held = tick if period is None else period
    if held < (1.0 - 1e-9) * tick:
        raise ParamsError(f"period: expected the controller's period, {tick:g} s, or more, got {held:g}")
    return held


_HELD: Mapping[str, Reader] = {"period": fields.number, "margin": fields.number}
_KINDS: Mapping[str, LimitKind] = {
    "torque": LimitKind(_torque, optional={"share": fields.number}),
    "contact": LimitKind(_contact, optional={"pyramid": fields.text}),
    "acceleration": LimitKind(
        _acceleration, optional={**_HELD, "acceleration": fields.numbers, "velocity": fields.numbers}
    ),
    "capture_point": LimitKind(_capture_point, optional=_HELD),
}
