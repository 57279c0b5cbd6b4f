"""Strict reading of YAML fields: every error names the file, the field, what was expected and what came.

Where things sit on links: poses, sensor frames, contact frames.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from drake_tc.errors import ParamsError

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Pose:
    """A pose as in URDF.

    Attributes:
        xyz: Translation [m].
        rpy: Roll, pitch, yaw about the fixed x, y, z axes [rad].
    """

    xyz: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)

    @property
    def transform(self) -> RigidTransform:
        """X: the same as Drake's transform."""
        translation: Any = np.array(self.xyz)
        return RigidTransform(RollPitchYaw(*self.rpy), translation)


@dataclass(frozen=True)
class Mount:
    """A named frame on a link.

    Attributes:
        name: As it stands in logs and ports.
        link: Link it is fixed to.
        pose: X_LM: frame M in the link's frame L.
    """

    name: str
    link: str
    pose: Pose = Pose()


@dataclass(frozen=True)
class ForceTorqueMount:
    """A 6-axis force/torque sensor inside a fixed joint.

    Attributes:
        name: As it stands in logs and ports.
        joint: The fixed joint that carries all of the load.
        pose: X_LS: sensor frame S in the frame L of the joint's child link.
        contact: Link and frame C that takes the external wrench of the part beyond the sensor.
    """

    name: str
    joint: str
    pose: Pose
    contact: Mount


Reader = Callable[[str, object], Any]
"""(Place of a value in its file, value as YAML has it) to the value that is used; raises ParamsError."""


def mapping(
    where: str, entry: object, required: Iterable[str] = (), optional: Iterable[str] | None = ()
) -> dict[str, Any]:
    """`entry` as a mapping whose keys are as expected; `optional` None allows any; an absent entry is empty.

    Raises:
        ParamsError: no mapping, an unknown key, a missing one, or two that are the same text.
    """
    entry = {} if entry is None else entry
    required = sorted(required)
    if not isinstance(entry, dict):
        raise ParamsError(f"{where}: expected a mapping, got {entry!r}")
    if optional is not None:
        known = sorted({*required, *optional})
        for key in entry:
            if key not in known:
                raise ParamsError(f"{where}: unknown key {key!r}; possible: {', '.join(known)}")
    for key in required:
        if key not in entry:
            raise ParamsError(f"{where}: missing key {key!r}; expected: {', '.join(required)}")
    return dict(zip(different(where, entry), entry.values(), strict=True))


def different(where: str, keys: Iterable[object]) -> list[str]:
    """Keys as texts, each once: 5 and '5' are two to YAML.

    Raises:
        ParamsError: two that are the same text.
    """
    texts: dict[str, object] = {}
    for key in keys:
        if str(key) in texts:
            raise ParamsError(f"{where}: expected different keys, got both {texts[str(key)]!r} and {key!r}")
        texts[str(key)] = key
    return list(texts)


def text(where: str, value: object) -> str:
    """A non-empty text.

    Raises:
        ParamsError: something else.
    """
    if isinstance(value, str) and value:
        return value
    raise ParamsError(f"{where}: expected a text, got {value!r}")


def names(where: str, value: object) -> tuple[str, ...]:
    """A non-empty list of different names.

    Raises:
        ParamsError: something else.
    """
    if not isinstance(value, list) or not value:
        raise ParamsError(f"{where}: expected a list of names, got {value!r}")
    listed = tuple(text(where, item) for item in value)
    twice = [name for i, name in enumerate(listed) if name in listed[:i]]
    if twice:
        raise ParamsError(f"{where}: {twice[0]!r} is listed twice")
    return listed


def number(where: str, value: object) -> float:
    """A finite float; text such as 1e-4, which YAML 1.1 does not take for a number, is read as one.

    Raises:
        ParamsError: something else.
    """
    if isinstance(value, (int, float, str)) and not isinstance(value, bool):
        try:
            result = float(value)
        except ValueError:
            result = math.nan
        if math.isfinite(result):
            return result
    raise ParamsError(f"{where}: expected a finite number, got {value!r}")


def number_list(where: str, value: object) -> list[float]:
    """A list of finite numbers.

    Raises:
        ParamsError: something else.
    """
    if not isinstance(value, list):
        raise ParamsError(f"{where}: expected a list of numbers, got {value!r}")
    return [number(f"{where}[{i}]", item) for i, item in enumerate(value)]


def numbers(where: str, value: object) -> float | list[float]:
    """A finite number, or a list of them.

    Raises:
        ParamsError: something else.
    """
    return number_list(where, value) if isinstance(value, list) else number(where, value)


def flags(where: str, value: object) -> list[bool]:
    """A non-empty list of true and false.

    Raises:
        ParamsError: something else.
    """
    if isinstance(value, list) and value and all(isinstance(item, bool) for item in value):
        return value
    raise ParamsError(f"{where}: expected a list of true and false, got {value!r}")


def read_keys(
    where: str, entry: object, required: Mapping[str, Reader], optional: Mapping[str, Reader]
) -> dict[str, Any]:
    """The values of a mapping, each by the reader of its key.

    Raises:
        ParamsError: as `mapping`, or a value that its reader refuses.
    """
    readers = {**required, **optional}
    given = mapping(where, entry, required, optional)
    return {key: readers[key](f"{where}.{key}", value) for key, value in given.items()}


def triple(where: str, value: object) -> Triple:
    """Three finite numbers.

    Raises:
        ParamsError: something else.
    """
    if not isinstance(value, list) or len(value) != 3:
        raise ParamsError(f"{where}: expected three numbers, got {value!r}")
    x, y, z = (number(where, item) for item in value)
    return x, y, z


def pose(where: str, entry: dict[str, Any]) -> Pose:
    """The pose in the keys `xyz` and `rpy` of `entry`; each is optional.

    Raises:
        ParamsError: not three numbers.
    """
    zero = [0.0, 0.0, 0.0]
    return Pose(triple(f"{where}.xyz", entry.get("xyz", zero)), triple(f"{where}.rpy", entry.get("rpy", zero)))
