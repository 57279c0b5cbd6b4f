"""The rig file as a whole: its keys, how it is read, and its JSON schema.

Many keys hold one value for all joints or a mapping by joint. Their types look up the joints of the document, so its
keys `joint` and `joints` come before all that use them.
"""

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, TypeAlias, TypeVar, get_args

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, ValidationInfo, field_validator

from drake_tc.config.joint_units import JointType
from drake_tc.config.keys import Keys, Number, PositiveNumber, key, one_of, saying
from drake_tc.config.page import json_schema
from drake_tc.config.quoted import did_you_mean, quoted
from drake_tc.config.records import validated
from drake_tc.errors import RigError
from drake_tc.extensions import EFFECTS
from drake_tc.logs.rig_document.declared import EFFECT_IDS, DeclaredEntry
from drake_tc.logs.rig_document.loads import LoadEntry
from drake_tc.logs.rig_document.sensors import SensorsKeys, sorted_by_owner
from drake_tc.logs.units import JOINT_SUFFIXES, SENSOR_SUFFIXES, allowed_units, parse_unit
from drake_tc.types import BoolArray, FloatArray


class ByJoint(dict[str, Any]):
    """A mapping that was recognised as one by joint."""


def joints_of(info: ValidationInfo) -> tuple[str, ...]:
    """The joints of the document, as far as they were valid."""
    joint = info.data.get("joint")
    return (joint,) if joint is not None else tuple(info.data.get("joints") or ())


def values_by_joint(value: Any, joints: tuple[str, ...]) -> dict[str, Any]:
    """The value of each joint: None for a joint that a mapping by joint leaves out; empty where there is none."""
    if isinstance(value, ByJoint):
        return {joint: value.get(joint) for joint in joints}
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


def _canonical_name(name: str, joints: Sequence[str]) -> str:
    """A full canonical name: `time`, `<joint>/<suffix>`, a sensor's, or a bare suffix of the only joint."""
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


def _canonical_columns(columns: Mapping[str, str | int], joints: Sequence[str]) -> dict[str, str]:
    """Full canonical name to the name in the file.

    A last part stands for the columns of all joints, where the name in the file has `<joint>` in place of a joint's
    name; a column with an entry of its own keeps that.
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
            own[_canonical_name(name, joints)] = in_log
    return of_all | own


def _check_units(units: Mapping[str, str | float], joints: Sequence[str]) -> None:
    """Every unit is one of its column's quantity."""
    for name, unit in units.items():
        if not allowed_units(name) or "/" in name:
            _canonical_name(name, joints)
        try:
            parse_unit(name, unit)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None


COMPARISONS: Mapping[str, Callable[[Any, Any], Any]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
}
_CONDITION = re.compile(r"(?P<column>.*\S)\s*(?P<sign>[<>=!]=|[<>])\s*(?P<limit>\S+)")


@dataclass(frozen=True)
class Condition:
    """A column, and what its values are compared with.

    Attributes:
        column: Name in the log.
        sign: One of `COMPARISONS`.
        limit: In the unit of the column in the log.
    """

    column: str
    sign: str = "!="
    limit: float = 0.0

    @staticmethod
    def of(text: str) -> "Condition":
        """From `COLUMN`, whose samples are valid where it is neither 0 nor missing, or `COLUMN < NUMBER`.

        Raises:
            ValueError: No number follows the comparison; says what was expected.
        """
        found = _CONDITION.fullmatch(text.strip())
        if found is None:
            return Condition(text.strip())
        try:
            limit = float(found["limit"])
        except ValueError:
            signs = ", ".join(COMPARISONS)
            raise ValueError(f"expected a column, or a column, one of {signs}, and a number, got {text!r}") from None
        return Condition(found["column"], found["sign"], limit)

    @property
    def text(self) -> str:
        """As a rig file says it."""
        return self.column if (self.sign, self.limit) == ("!=", 0.0) else f"{self.column} {self.sign} {self.limit!r}"

    def holds(self, values: FloatArray) -> BoolArray:
        """(T,) where the condition holds; it does not where a value is missing."""
        return np.asarray(COMPARISONS[self.sign](values, self.limit) & np.isfinite(values), dtype=np.bool_)


DriveKind: TypeAlias = Literal["position_servo", "current", "voltage", "torque"]
Type = Annotated[JointType, one_of(get_args(JointType))]
Drive = Annotated[DriveKind, one_of(get_args(DriveKind))]
NumberOrByJoint: TypeAlias = PlainOrByJoint[PositiveNumber]
JointName = Annotated[str, Field(pattern=r"\S"), saying("a name (text)")]
FileName = Annotated[str, Field(min_length=1), saying("the name of a robot file (YAML)")]


class RigDocument(Keys):
    """What a rig file may say."""

    SCHEMA: ClassVar[str] = "rig"

    joint: JointName | None = key(
        "Name of the joint.",
        example="knee",
        absent="required without `joints` or `robot`",
    )
    joints: list[JointName] | None = key(
        "Names of the joints, in place of `joint`.",
        example=["hip", "knee"],
        absent="the driven joints of the robot file",
    )
    robot: FileName | None = key(
        "Robot file, relative to the rig file. Its model gives the load torques.",
        example="leg_robot.yaml",
        absent="no robot",
    )
    drive: PlainOrByJoint[Drive] = key(
        "What the drive is commanded with, its effort: `position_servo` (column `position_command`, rad), `current` "
        "(`current`, A), `voltage` (`voltage`, V) or `torque` (`torque_command`, N·m).",
        example="position_servo",
        default=...,
        expected=f"one of {', '.join(get_args(DriveKind))}",
    )
    joint_type: PlainOrByJoint[Type] | None = key(
        "Whether the joint turns (`revolute`) or slides (`prismatic`).",
        example="prismatic",
        absent="that of the URDF; without one, `prismatic` where `units` has a unit such as mm or N, else `revolute`",
    )
    columns: dict[str, ColumnName] | None = key(
        "Canonical column: its name in the log.",
        example={"time": "t", "position": "q_meas"},
        absent="the canonical names",
    )
    units: dict[str, Unit] | None = key(
        "Canonical column: its unit in the log. A leading `-` reverses the sign; a number is a factor to SI.",
        example={"time": "ms", "position": "deg", "torque": "-N*m", "current": 0.001},
        absent="SI",
    )
    load: EntryOrByJoint[LoadEntry] | None = key(
        "Where the load torque comes from.",
        example={"pendulum": {"mass": 1.2, "length": 0.3}},
        absent="`torque`; with the key `robot`, `{robot: estimate}`",
    )
    declared: EntryOrByJoint[DeclaredEntry] | None = key(
        "Effects that you already model. They are part of the model before and are not searched for.",
        example={"rotor_inertia": 0.31, "stribeck": None},
        absent="viscous and Coulomb friction alone",
    )
    enabled: LogColumn | None = key(
        "Column of the log that is 0 (or false) while the drive is off. Those rows are left out.",
        example="torque_on",
        absent="`enabled` or `<joint>/enabled`, where the log has it",
    )
    valid: LogColumn | list[LogColumn] | None = key(
        "Which samples may be used (those without a hand on the joint): a column that is neither 0 nor false, or its "
        "comparison with a number in its own unit (`<`, `<=`, `>`, `>=`, `==`, `!=`). Of a list, all must hold. A "
        "missing value does not hold.",
        example="tip_height > 0.02",
        absent="all samples",
    )
    saturation: NumberOrByJoint | None = key(
        "Known limit of the drive's effort.", unit="rad, A, V or N·m", example=12.0, absent="not known"
    )
    drive_gain: NumberOrByJoint | None = key(
        "Effort for 1 N·m, as the maker states it.",
        unit="effort/(N·m)",
        example=0.08,
        absent="identified; 1 is expected of a torque drive",
    )
    torque_constant: NumberOrByJoint | None = key(
        "Torque constant of a current drive's motor, without the losses of the gear. The drive gain is "
        "1/(`torque_constant` · `gear_ratio`).",
        unit="N·m/A",
        example=0.07,
        absent="identified",
    )
    gear_ratio: NumberOrByJoint | None = key(
        "Turns of the motor for one turn of the joint. For a prismatic joint, its angle [rad] for 1 m: 2π/(lead of a "
        "screw) or 1/(radius of a pinion).",
        unit="–",
        example=100.0,
        absent="required with `torque_constant`, and only there",
    )
    proportional_gain: NumberOrByJoint | None = key(
        "Torque of a position servo for 1 rad of position error. The drive gain is 1/`proportional_gain`.",
        unit="N·m/rad",
        example=20.0,
        absent="identified",
    )
    derivative_gain: NumberOrByJoint | None = key(
        "Damping of a servo with the torque proportional_gain · (command − position) − derivative_gain · velocity. It "
        "is part of the identified viscous friction; the report lists the rest.",
        unit="N·m·s/rad",
        example=1.5,
        absent="not known",
    )
    command_hold: bool | None = key(
        "Whether the recorded effort acts unchanged until the next sample (true) or is sampled from a continuous curve "
        "(false), as a measured current is.",
        example=True,
        absent="true where the training runs confirm it; for a position servo only at 250 Hz or slower",
    )
    coupled: dict[str, dict[str, Number]] | None = key(
        "Gears that couple joints, with `load: {robot: ...}`: the turns of the first joint's motor for one turn of the "
        "other joint, gear ratio taken out. Positions and their commands are those of the joints, currents, voltages "
        "and commanded torques those of the motors.",
        example={"wrist_3": {"wrist_2": 1.0}},
        absent="no coupling",
    )
    sensors: SensorsKeys | None = key(
        "Noise of the joints' channels, and tolerances of all sensors.",
        example={"torque_noise": "0.25 N*m", "encoder_step": "1.5 mrad"},
        absent="the noise is estimated; F/T sensors and IMUs have typical tolerances, a joint's own sensors none",
    )

    @classmethod
    def check_together(cls, value: Mapping[str, object]) -> None:
        """One of `joint` and `joints` is there."""
        if ("joint" in value) == ("joints" in value):
            raise ValueError("expected one of the keys 'joint' (a name) or 'joints' (a list of names)")

    @field_validator("joint", mode="before")
    @classmethod
    def _one_name(cls, value: object) -> object:
        if isinstance(value, list):
            raise ValueError(f"expected one name, got {quoted(value)}; a list goes under 'joints'")
        if value is None:
            raise ValueError("expected a name, got nothing")
        return value

    @field_validator("joints", mode="before")
    @classmethod
    def _names(cls, value: object) -> object:
        names = value if isinstance(value, list) else [value]
        if not names or any(not isinstance(name, str) or not name.strip() for name in names):
            raise ValueError(f"expected names (text), got {quoted(value)}")
        if len(set(names)) != len(names):
            raise ValueError(f"a name stands twice in {quoted(names)}")
        return names

    @field_validator("drive", mode="before")
    @classmethod
    def _every_joint(cls, value: object, info: ValidationInfo) -> object:
        if not isinstance(value, Mapping):
            return value
        for joint in joints_of(info):
            if joint not in value:
                raise ValueError(
                    f"no entry for joint {joint!r}; entries here: {sorted(value)}{did_you_mean(joint, value)}"
                )
        return value

    @field_validator("columns")
    @classmethod
    def _canonical(cls, value: dict[str, ColumnName] | None, info: ValidationInfo) -> dict[str, str]:
        return _canonical_columns(value or {}, joints_of(info))

    @field_validator("units")
    @classmethod
    def _units(cls, value: dict[str, Unit] | None, info: ValidationInfo) -> dict[str, Unit]:
        _check_units(value or {}, joints_of(info))
        return value or {}

    @field_validator("valid", mode="before")
    @classmethod
    def _conditions(cls, value: object) -> object:
        conditions = value if isinstance(value, list) else [value]
        texts = [text for text in conditions if isinstance(text, str) and text.strip()]
        if not texts or len(texts) < len(conditions):
            raise ValueError(f"expected a column of the log, or a column compared with a number, got {quoted(value)}")
        for text in texts:
            Condition.of(text)
        return value

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Those of `valid`."""
        texts = [self.valid] if isinstance(self.valid, str) else self.valid or []
        return tuple(Condition.of(text) for text in texts)

    @field_validator("sensors", mode="before")
    @classmethod
    def _owners(cls, value: object, info: ValidationInfo) -> object:
        return sorted_by_owner(value, joints_of(info))

    @field_validator("coupled", mode="before")
    @classmethod
    def _coupled(cls, value: object, info: ValidationInfo) -> object:
        joints = joints_of(info)
        for joint, others in value.items() if isinstance(value, Mapping) else ():
            for name in (joint, *(others if isinstance(others, Mapping) else ())):
                if name not in joints:
                    raise ValueError(
                        f"{quoted(name)} is not a joint of this rig{did_you_mean(str(name), joints)}; "
                        f"joints: {list(joints)}"
                    )
        return value

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints, in the order of the file."""
        return (self.joint,) if self.joint is not None else tuple(self.joints or ())


def read_document(source: str, document: object) -> RigDocument:
    """The checked document.

    Raises:
        RigError: The first thing that is wrong in it; one line.
    """
    return validated(RigDocument, document, source, RigError)


def rig_schema() -> dict[str, Any]:
    """The schema of a rig file; it has `joint`, `joints` or `robot`."""
    schema = json_schema(RigDocument, "drake_tc rig file")
    _add_installed_effects(schema)
    joints = [{"required": [name]} for name in ("joint", "joints", "robot")]
    return {**schema, "anyOf": joints}


def _add_installed_effects(value: Any) -> None:
    """Let the schema know the effects of other packages that are installed here."""
    for each in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        _add_installed_effects(each)
    if isinstance(value, dict) and value.get("enum") == list(EFFECT_IDS):
        value["enum"] = [*EFFECT_IDS, *EFFECTS.names()]
