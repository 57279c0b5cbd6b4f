"""Limits from YAML: which there are, and which keys each has."""

from typing import Any

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.robot import fields
from drake_tc.tsid.limits.acceleration import AccelerationLimit
from drake_tc.tsid.limits.base import Limit
from drake_tc.tsid.limits.capture_point import CapturePointLimit
from drake_tc.tsid.limits.torque import TorqueLimit
from drake_tc.tsid.limits.wrench_cone import WrenchCones
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.task_fields import numbers

NEVER_LEFT_OUT = ("torque", "contact", "acceleration")
"""Kinds that a controller has with their defaults unless its file says null."""


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
    given = {name: {} for name in NEVER_LEFT_OUT} | fields.mapping(where, entry, optional=_KINDS)
    made = []
    for kind, keys in given.items():
        if keys is None or (kind == "contact" and not model.contacts):
            continue
        at = f"{where}.{kind}"
        try:
            made.append(_KINDS[kind](at, keys, model, period))
        except ParamsError as error:
            raise ParamsError(str(error) if str(error).startswith(at) else f"{at}: {error}") from None
    return tuple(made)


def _torque(where: str, keys: object, model: TsidModel, period: float) -> Limit:
    given = fields.mapping(where, keys, optional=("share",))
    return TorqueLimit.of(model.robot, fields.number(f"{where}.share", given.get("share", 1.0)))


def _contact(where: str, keys: object, model: TsidModel, period: float) -> Limit:
    given = fields.mapping(where, keys, optional=("pyramid",))
    pyramid: Any = fields.text(f"{where}.pyramid", given.get("pyramid", "inner"))
    return WrenchCones(model.contacts, pyramid=pyramid)


def _acceleration(where: str, keys: object, model: TsidModel, period: float) -> Limit:
    given = fields.mapping(where, keys, optional=("period", "acceleration", "velocity", "margin"))
    values: dict[str, Any] = {
        key: np.array(numbers(f"{where}.{key}", value))
        for key, value in given.items()
        if key in ("acceleration", "velocity")
    }
    n = len(model.robot.joints)
    for key, value in values.items():
        if value.ndim and value.size != n:
            raise ParamsError(f"{where}.{key}: wanted a number or {n} of them, one a joint; got {value.size}")
    held = _held(where, given, period)
    margin = fields.number(f"{where}.margin", given.get("margin", 0.0))
    return AccelerationLimit.of(model.robot, model.actuated, model.nv, period=held, margin=margin, **values)


def _capture_point(where: str, keys: object, model: TsidModel, period: float) -> Limit:
    given = fields.mapping(where, keys, optional=("period", "margin"))
    held = _held(where, given, period)
    margin = fields.number(f"{where}.margin", given.get("margin", 0.0))
    return CapturePointLimit(model.contacts, period=held, margin=margin)


def _held(where: str, given: dict[str, Any], period: float) -> float:
    """How long an acceleration is taken to last: the controller's period or more, as it decides no earlier."""
    held = fields.number(f"{where}.period", given.get("period", period))
    if held < (1.0 - 1e-9) * period:
        raise ParamsError(f"{where}.period: wanted the controller's period, {period:g} s, or more; got {held:g}")
    return held


_KINDS = {
    "torque": _torque,
    "contact": _contact,
    "acceleration": _acceleration,
    "capture_point": _capture_point,
}
