"""Tasks from YAML: which kinds there are, and which keys each has."""

from collections.abc import Callable, Mapping
from typing import Any

from drake_tc.errors import ParamsError
from drake_tc.robot import fields
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.tasks.angular_momentum import AngularMomentumTask
from drake_tc.tsid.tasks.base import Task
from drake_tc.tsid.tasks.com import ComTask
from drake_tc.tsid.tasks.cop import CopTask
from drake_tc.tsid.tasks.force import ForceTask
from drake_tc.tsid.tasks.frame import FrameTask
from drake_tc.tsid.tasks.orientation import OrientationTask
from drake_tc.tsid.tasks.posture import PostureTask
from drake_tc.tsid.tasks.torque import TorqueTask

Reader = Callable[[str, object], Any]


def numbers(where: str, value: object) -> float | list[float]:
    """A number, or a list of them.

    Raises:
        ParamsError: something else.
    """
    if isinstance(value, list):
        return [fields.number(f"{where}[{i}]", item) for i, item in enumerate(value)]
    return fields.number(where, value)


def mask(where: str, value: object) -> list[bool]:
    """A list of true and false.

    Raises:
        ParamsError: something else.
    """
    if isinstance(value, list) and value and all(isinstance(item, bool) for item in value):
        return value
    raise ParamsError(f"{where}: wanted a list of true and false; got {value!r}")


_GAINS: Mapping[str, Reader] = {"kp": numbers, "kd": numbers}
_WEIGHT: Mapping[str, Reader] = {"weight": numbers}
_FRAME: Mapping[str, Reader] = {**_WEIGHT, "mask": mask, "axes_of": fields.text}
_KINDS: Mapping[str, tuple[Mapping[str, Reader], Mapping[str, Reader], Callable[..., Task]]] = {
    "com": (_GAINS, {**_WEIGHT, "mask": mask}, lambda model, **keys: ComTask(**keys)),
    "posture": (_GAINS, {**_WEIGHT, "joints": fields.names}, PostureTask),
    "frame": ({"frame": fields.text, **_GAINS}, _FRAME, FrameTask),
    "orientation": ({"frame": fields.text, **_GAINS}, _FRAME, OrientationTask),
    "angular_momentum": (
        {"kp": numbers},
        {**_WEIGHT, "mask": mask},
        lambda model, **keys: AngularMomentumTask(**keys),
    ),
    "force": ({}, {"weight": fields.number, "components": numbers}, ForceTask),
    "cop": ({"contact": fields.text}, _WEIGHT, CopTask),
    "torque": ({}, _WEIGHT, TorqueTask),
}
"""Kind to its needed keys, its optional keys and what it makes; all have `kind` beside them."""


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
    if kind not in _KINDS:
        raise ParamsError(f"{where}.kind: wanted one of {', '.join(_KINDS)}; got {kind!r}")
    needed, optional, make = _KINDS[kind]
    given = fields.mapping(where, entry, ("kind", *needed), optional)
    readers = {**needed, **optional}
    values = {key: readers[key](f"{where}.{key}", value) for key, value in given.items() if key != "kind"}
    if isinstance(values.get("components"), float):
        raise ParamsError(f"{where}.components: wanted a list of numbers; got {values['components']!r}")
    try:
        return make(model, **values, name=name)
    except ParamsError as error:
        raise ParamsError(f"{where}: {error}") from None
