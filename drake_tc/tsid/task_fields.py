"""Tasks from YAML: which kinds there are, which keys each has, and how another package adds one."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

from drake_tc.errors import ParamsError
from drake_tc.extensions import TASKS
from drake_tc.robot import fields
from drake_tc.robot.fields import Reader
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

KindT = TypeVar("KindT")


def checked_kind(name: str, given: object, expected: type[KindT]) -> KindT:
    """What was registered as a kind.

    Raises:
        ParamsError: it is no `expected`.
    """
    if not isinstance(given, expected):
        raise ParamsError(f"kind {name!r}: expected a {expected.__name__}, got {given!r}")
    return given


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


_GAINS: Mapping[str, Reader] = {"kp": fields.numbers, "kd": fields.numbers}
_WEIGHT: Mapping[str, Reader] = {"weight": fields.numbers}
_FRAME: Mapping[str, Reader] = {**_WEIGHT, "mask": fields.flags, "axes_of": fields.text}
_KINDS: Mapping[str, TaskKind] = {
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


def register_task(kind: str, reader: TaskKind) -> None:
    """Let the controller files of this process use `kind: KIND` in their tasks.

    A package does the same for every process by an entry point of the group `drake_tc.tsid.tasks`, whose name is the
    kind and whose object is a TaskKind.

    Raises:
        ParamsError: the kind is taken, or `reader` is no TaskKind.

    Example:
        >>> register_task("mine", TaskKind(lambda model, *, kp, name: None, required={"kp": float}))
    """
    if kind in _KINDS:
        raise ParamsError(f"task kind {kind!r}: this name is already taken; kinds: {', '.join(_KINDS)}")
    TASKS.add(kind, checked_kind(kind, reader, TaskKind))


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
    possible = (*_KINDS, *TASKS.names())
    if kind not in possible:
        raise ParamsError(f"{where}.kind: expected one of {', '.join(possible)}, got {kind!r}")
    reader = _KINDS[kind] if kind in _KINDS else TASKS.get(kind, lambda n, made: checked_kind(n, made, TaskKind))
    values = fields.read_keys(where, entry, {"kind": fields.text, **reader.required}, reader.optional)
    del values["kind"]
    try:
        return reader.make(model, **values, name=name)
    except ParamsError as error:
        raise ParamsError(f"{where}: {error}") from None
