"""Keys of the rig file that hold one value for all joints, or a mapping by joint.

The types below look up the joints of the document, so its keys `joint` and `joints` come before all that use them.
"""

from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BeforeValidator, Discriminator, Tag, ValidationInfo

from drake_tc.config.did_you_mean import did_you_mean


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
