"""Tasks and limits from YAML: which kinds there are, which keys each has, and how another package adds one."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.extensions import LIMITS, TASKS, ExtensionPoint
from drake_tc.robot import fields
from drake_tc.robot.fields import Reader
from drake_tc.tsid.limits import AccelerationLimit, CapturePointLimit, TorqueLimit, WrenchCones
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import Limit, Task
from drake_tc.tsid.tasks import (
    AngularMomentumTask,
    ComTask,
    CopTask,
    ForceTask,
    FrameTask,
    OrientationTask,
    PostureTask,
    TorqueTask,
)

NEVER_LEFT_OUT = ("torque", "contact", "acceleration")
"""Kinds of limits that a controller has with their defaults unless its file says null."""


@dataclass(frozen=True)
class TaskKind:
    """A kind of task as a controller file writes it: `kind: NAME` with the keys below.

    Attributes:
        make: Called with the model, then with `name` and the keys that the file gives as keywords; returns the task.
        required, optional: Key to its reader, a function of (place in the file, value) that returns the value or raises
            ParamsError, such as `number`, `numbers`, `text`, `names` and `flags` of `drake_tc.robot.fields`.

    Example:
        >>> TaskKind(lambda model, *, kp, name: None, required={"kp": float}).required["kp"].__name__
        'float'
    """

    make: Callable[..., Task]
    required: Mapping[str, Reader] = field(default_factory=dict)
    optional: Mapping[str, Reader] = field(default_factory=dict)


@dataclass(frozen=True)
class LimitKind:
    """A kind of limit as a controller file writes it: `KIND: {keys}`.

    Attributes:
        make: Called with the model and the controller's period [s], then with the keys that the file gives as keywords;
            returns the limit.
        required, optional: Key to its reader, as in `TaskKind`.

    Example:
        >>> LimitKind(lambda model, period, *, watts: None, required={"watts": float}).required["watts"].__name__
        'float'
    """

    make: Callable[..., Limit]
    required: Mapping[str, Reader] = field(default_factory=dict)
    optional: Mapping[str, Reader] = field(default_factory=dict)


def _acceleration(
    model: TsidModel, tick: float, period: float | None = None, margin: float = 0.0, **values: float | list[float]
) -> Limit:
    n = len(model.robot.joints)
    arrays: dict[str, Any] = {key: np.array(value) for key, value in values.items()}
    for key, value in arrays.items():
        if value.ndim and value.size != n:
            raise ParamsError(f"{key}: expected a number or {n} of them, one a joint, got {value.size}")
    held = _held(period, tick)
    return AccelerationLimit.of(model, period=held, margin=margin, **arrays)


def _capture_point(model: TsidModel, tick: float, period: float | None = None, margin: float = 0.0) -> Limit:
    return CapturePointLimit(model.contacts, period=_held(period, tick), margin=margin)


def _held(period: float | None, tick: float) -> float:
    """How long an acceleration is taken to last: the controller's period or more, as it decides no earlier."""
    held = tick if period is None else period
    if held < (1.0 - 1e-9) * tick:
        raise ParamsError(f"period: expected the controller's period, {tick:g} s, or more, got {held:g}")
    return held


_GAINS: Mapping[str, Reader] = {"kp": fields.numbers, "kd": fields.numbers}
_WEIGHT: Mapping[str, Reader] = {"weight": fields.numbers}
_FRAME: Mapping[str, Reader] = {**_WEIGHT, "mask": fields.flags, "axes_of": fields.text}
_HELD: Mapping[str, Reader] = {"period": fields.number, "margin": fields.number}
OWN_TASKS: Mapping[str, TaskKind] = {
    "com": TaskKind(lambda model, **keys: ComTask(**keys), _GAINS, {**_WEIGHT, "mask": fields.flags}),
    "posture": TaskKind(PostureTask, _GAINS, {**_WEIGHT, "joints": fields.names}),
    "frame": TaskKind(FrameTask, {"frame": fields.text, **_GAINS}, _FRAME),
    "orientation": TaskKind(OrientationTask, {"frame": fields.text, **_GAINS}, _FRAME),
    "angular_momentum": TaskKind(
        lambda model, **keys: AngularMomentumTask(**keys), {"kp": fields.numbers}, {**_WEIGHT, "mask": fields.flags}
    ),
    "force": TaskKind(ForceTask, {}, {"weight": fields.number, "components": fields.number_list}),
    "cop": TaskKind(CopTask, {"contact": fields.text}, _WEIGHT),
    "torque": TaskKind(TorqueTask, {}, _WEIGHT),
}
OWN_LIMITS: Mapping[str, LimitKind] = {
    "torque": LimitKind(
        lambda model, period, share=1.0: TorqueLimit.of(model.robot, share), optional={"share": fields.number}
    ),
    "contact": LimitKind(
        lambda model, period, pyramid="inner": WrenchCones(model.contacts, pyramid=pyramid),
        optional={"pyramid": fields.text},
    ),
    "acceleration": LimitKind(
        _acceleration, optional={**_HELD, "acceleration": fields.numbers, "velocity": fields.numbers}
    ),
    "capture_point": LimitKind(_capture_point, optional=_HELD),
}

KindT = TypeVar("KindT", TaskKind, LimitKind)


@dataclass(frozen=True)
class _Kinds(Generic[KindT]):
    """The kinds of this package and those that others add."""

    what: str
    own: Mapping[str, KindT]
    added: ExtensionPoint
    type: type[KindT]

    def register(self, name: str, kind: KindT) -> None:
        if name in self.own:
            raise ParamsError(f"{self.what} kind {name!r}: this name is already taken; kinds: {', '.join(self.own)}")
        self.added.add(name, self._checked(name, kind))

    def names(self) -> tuple[str, ...]:
        return (*self.own, *self.added.names())

    def get(self, name: str) -> KindT:
        return self.own[name] if name in self.own else self.added.get(name, self._checked)

    def _checked(self, name: str, given: object) -> KindT:
        if not isinstance(given, self.type):
            raise ParamsError(f"kind {name!r}: expected a {self.type.__name__}, got {given!r}")
        return given


_TASKS = _Kinds("task", OWN_TASKS, TASKS, TaskKind)
_LIMITS = _Kinds("limit", OWN_LIMITS, LIMITS, LimitKind)


def register_task(kind: str, reader: TaskKind) -> None:
    """Let the controller files of this process use `kind: KIND` in their tasks.

    A package does the same for every process by an entry point of the group `drake_tc.tsid.tasks`, whose name is the
    kind and whose object is a TaskKind.

    Raises:
        ParamsError: the kind is taken, or `reader` is no TaskKind.

    Example:
        >>> register_task("mine", TaskKind(lambda model, *, kp, name: None, required={"kp": float}))
    """
    _TASKS.register(kind, reader)


def register_limit(kind: str, reader: LimitKind) -> None:
    """Let the controller files of this process use KIND in their limits.

    A package does the same for every process by an entry point of the group `drake_tc.tsid.limits`, whose name is the
    kind and whose object is a LimitKind.

    Raises:
        ParamsError: the kind is taken, or `reader` is no LimitKind.

    Example:
        >>> register_limit("watts", LimitKind(lambda model, period, *, watts: None, required={"watts": float}))
    """
    _LIMITS.register(kind, reader)


def read_task(where: str, name: str, entry: object, model: TsidModel) -> Task:
    """The task `name`.

    Args:
        where: Of the entry, for messages.
        name: Of the task.
        entry: Its mapping.
        model: Of the robot.

    Raises:
        ParamsError: an unknown kind, a key that is unknown or missing, or a value that is not possible.
    """
    kind = fields.text(f"{where}.kind", fields.mapping(where, entry, ("kind",), None)["kind"])
    if kind not in _TASKS.names():
        raise ParamsError(f"{where}.kind: expected one of {', '.join(_TASKS.names())}, got {kind!r}")
    reader = _TASKS.get(kind)
    values = fields.read_keys(where, entry, {"kind": fields.text, **reader.required}, reader.optional)
    del values["kind"]
    return _made(where, lambda: reader.make(model, **values, name=name))


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
    given = {name: {} for name in NEVER_LEFT_OUT} | fields.mapping(where, entry, optional=_LIMITS.names())
    return tuple(
        _limit(f"{where}.{kind}", kind, keys, model, period)
        for kind, keys in given.items()
        if keys is not None and (kind != "contact" or model.contacts)
    )


def _limit(where: str, kind: str, keys: object, model: TsidModel, period: float) -> Limit:
    reader = _LIMITS.get(kind)
    values = fields.read_keys(where, keys, reader.required, reader.optional)
    return _made(where, lambda: reader.make(model, period, **values))


MadeT = TypeVar("MadeT")


def _made(where: str, make: Callable[[], MadeT]) -> MadeT:
    """What `make` returns; its errors say where in the file the entry stands."""
    try:
        return make()
    except ParamsError as error:
        raise ParamsError(f"{where}: {error}") from None
