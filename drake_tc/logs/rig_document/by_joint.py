"""Keys of the rig file that hold one value for all joints, or a mapping by joint.

The types below look up the joints of the document, so its keys `joint` and `joints` come before all that use them.

The rig file's keys `columns` and `units`: names in the log and units, by canonical column.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, TypeAlias, TypeVar

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, ValidationInfo

from drake_tc.config.keys import saying
from drake_tc.config.quoted import did_you_mean, quoted
from drake_tc.logs.units import JOINT_SUFFIXES, SENSOR_SUFFIXES, allowed_units, parse_unit


class ByJoint(dict[str, Any]):
    """A mapping that was recognised as one by joint."""


def joints_of(info: ValidationInfo) -> tuple[str, ...]:
    """The joints of the document, as far as they were valid."""
    joint = info.data.get("joint")
    return (joint,) if joint is not None else tuple(info.data.get("joints") or ())


def values_by_joint(value: Any, joints: tuple[str, ...], absent: Any = None) -> dict[str, Any]:
    """The value of each joint: `absent` for a joint that a mapping by joint leaves out; empty where there is none."""
    if isinstance(value, ByJoint):
        return {joint: value.get(joint, absent) for joint in joints}
    return dict.fromkeys(joints, value)


def _marked(value: Mapping[str, Any], joints: tuple[str, ...]) -> ByJoint:
    """The mapping as one by joint; every key must be a joint."""
    for joint in value:
        if joint not in joints:
            raise ValueError(
                f"{joint!r} is not a joint of this rig{did_you_mean(joint, joints)}; joints: {list(joints)}"
            )
    return ByJoint(value)


def _mapping_by_joint(value: object, info: ValidationInfo) -> object:
    return _marked(value, joints_of(info)) if isinstance(value, Mapping) else value


def _entry_or_by_joint(value: object, info: ValidationInfo) -> object:
    joints = joints_of(info)
    if not isinstance(value, Mapping) or not set(value) & set(joints) or _is_pendulum(value):
        return value
    return _marked({joint: entry for joint, entry in value.items() if entry is not None}, joints)


def _is_pendulum(value: Mapping[str, Any]) -> bool:
    """Whether `{pendulum: ...}` is the load itself, and not a joint that is called "pendulum"."""
    inner = value.get("pendulum")
    return set(value) == {"pendulum"} and isinstance(inner, Mapping) and "mass" in inner


def _shape(value: object) -> str:
    return "@by_joint" if isinstance(value, ByJoint) else "@one"


T = TypeVar("T")
_Either = Annotated[
    Annotated[T, Tag("@one")] | Annotated[dict[str, T], AfterValidator(ByJoint), Tag("@by_joint")],
    Discriminator(_shape),
]
PlainOrByJoint = Annotated[_Either[T], BeforeValidator(_mapping_by_joint)]
"""One plain value for all joints (a number, a word), or a mapping by joint."""
EntryOrByJoint = Annotated[_Either[T], BeforeValidator(_entry_or_by_joint)]
"""One entry for all joints, which may be a mapping itself, or a mapping by joint; an empty entry counts as absent."""


ColumnName: TypeAlias = Annotated[str | int, saying("a column's name in the file")]
Unit: TypeAlias = Annotated[str | float, saying("a unit or a scale factor")]
EACH_JOINT = "<joint>"
"""In the name of a column in the log: the name of each joint."""
LogColumn: TypeAlias = Annotated[str, Field(min_length=1), saying("the name of a column in the log")]


def canonical_name(name: str, joints: Sequence[str]) -> str:
    """A full canonical name: `time`, `<joint>/<suffix>`, a sensor's, or a bare suffix of the only joint.

    Raises:
        ValueError: It is none of these; with the nearest match.
    """
    if name in ("time", "enabled"):
        return name
    if name in JOINT_SUFFIXES and len(joints) == 1:
        return f"{joints[0]}/{name}"
    owner, _, suffix = name.rpartition("/")
    if owner in joints and suffix in (*JOINT_SUFFIXES, "enabled"):
        return name
    if owner.startswith(("imu_", "ft_")) and suffix in SENSOR_SUFFIXES:
        return name
    known = ["time", *(f"{joint}/{s}" for joint in joints for s in JOINT_SUFFIXES)]
    raise ValueError(
        f"{quoted(name)} is not a canonical column{did_you_mean(name, known)}; possible: time, "
        f"{'|'.join(joints)}/{{{', '.join(JOINT_SUFFIXES)}}}"
    )


def canonical_columns(columns: Mapping[str, str | int], joints: Sequence[str]) -> dict[str, str]:
    """Full canonical name to the name in the file.

    A last part stands for the columns of all joints, where the name in the file has `<joint>` in place of a joint's
    name; a column with an entry of its own keeps that.

    Raises:
        ValueError: A key is not a canonical column.
    """
    of_all: dict[str, str] = {}
    own: dict[str, str] = {}
    for name, entry in columns.items():
        in_log = str(entry)
        if name in JOINT_SUFFIXES and EACH_JOINT in in_log:
            of_all |= {f"{joint}/{name}": in_log.replace(EACH_JOINT, joint) for joint in joints}
        elif name in JOINT_SUFFIXES and len(joints) > 1:
            raise ValueError(
                f"{quoted(name)} is that of {len(joints)} joints: write `{joints[0]}/{name}: {in_log}` for one of them,"
                f" or for all a name that differs only in the joint, such as `{name}: {EACH_JOINT}/{in_log}`"
            )
        else:
            own[canonical_name(name, joints)] = in_log
    return of_all | own


def check_units(units: Mapping[str, str | float], joints: Sequence[str]) -> None:
    """Every unit is one of its column's quantity.

    Raises:
        ValueError: A key is not a canonical column or suffix, or the unit is not one of that quantity.
    """
    for name, unit in units.items():
        if not allowed_units(name) or "/" in name:
            canonical_name(name, joints)
        try:
            parse_unit(name, unit)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None
